"""Who may call: hosts, origins, sizes; and what every reply tells the browser."""

import pytest
from starlette.websockets import WebSocketDisconnect

from ..conftest import Visitor, open_client


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "", "localhost:80:80"])
def test_another_host_name_is_refused(client, host):
    """A page elsewhere whose name points at this machine gets nothing (DNS rebinding)."""
    reply = client.get("/api/parameters", headers={"Host": host})
    assert reply.status_code == 403
    assert "RIDETUNE_ALLOWED_HOSTS" in reply.json()["detail"]


@pytest.mark.parametrize("host", ["localhost", "LOCALHOST:8123", "127.0.0.1", "[::1]:8000"])
def test_the_services_own_names_are_answered(client, host):
    assert client.get("/api/parameters", headers={"Host": host}).status_code == 200


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:9999"},
        {"Origin": "http://127.0.0.1:8000.evil.example"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},
    ],
)
def test_a_page_of_another_origin_changes_nothing(client, headers):
    reply = client.post("/api/sessions", headers=headers)
    assert reply.status_code == 403
    assert reply.json()["code"] == "forbidden"
    assert "set-cookie" not in reply.headers


def test_our_own_page_may(client):
    own = {"Origin": "http://127.0.0.1:8000", "Sec-Fetch-Site": "same-origin"}
    assert client.post("/api/sessions", headers=own).status_code == 201


def test_a_websocket_of_another_origin_is_refused(client):
    visitor = Visitor(client)
    with (
        pytest.raises(WebSocketDisconnect),
        client.websocket_connect(
            f"/s/{visitor.id}/viewer",
            headers={"Origin": "http://evil.example", "Authorization": f"Bearer {visitor.token}"},
        ),
    ):
        pass


def test_every_reply_forbids_foreign_scripts_and_guessing(client):
    for path in ("/", "/api/parameters", "/nowhere"):
        headers = client.get(path).headers
        assert "script-src 'self'" in headers["content-security-policy"]
        assert "frame-ancestors 'none'" in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["cross-origin-opener-policy"] == "same-origin"
        assert headers["cross-origin-resource-policy"] == "same-origin"
        assert headers["referrer-policy"] == "same-origin"
        assert "camera=()" in headers["permissions-policy"]


def test_a_long_body_is_refused_with_its_limit(small_limits):
    """The same sentence whether the length is announced or the chunks just keep coming."""
    with open_client(small_limits) as client:
        visitor = Visitor(client)
        body = b'{"name": "' + b"x" * 20_000 + b'"}'
        json_type = {"Content-Type": "application/json"}
        announced = visitor.put("/vehicle", content=body, headers=json_type)
        chunks = (body[k : k + 1000] for k in range(0, len(body), 1000))
        counted = visitor.put("/vehicle", content=chunks, headers=json_type)
        for reply in (announced, counted):
            assert reply.status_code == 413
            assert reply.headers["content-type"] == "application/problem+json"
            assert reply.json()["code"] == "too-large"
            assert "0.01 MB" in reply.json()["detail"]
