"""How a browser gets its session and the page; static files."""

import re

import pytest
from fastapi.testclient import TestClient

from ..conftest import ADDRESS, Visitor, open_client

ELSEWHERE = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate"}


def test_the_start_page_gives_a_session_and_finds_it_again(client):
    first = client.get("/", follow_redirects=False)
    assert first.status_code == 303
    assert re.fullmatch(r"/s/[0-9a-f]{16}/", first.headers["location"])
    again = client.get("/", follow_redirects=False)
    assert again.headers["location"] == first.headers["location"]
    assert "set-cookie" not in again.headers


def test_the_query_goes_along(client):
    location = client.get("/?fixedDpr=0.5&a=b%26c", follow_redirects=False).headers["location"]
    assert location.endswith("/?fixedDpr=0.5&a=b%26c")


def test_the_page_is_served_to_its_session(client):
    page = client.get("/")
    assert page.status_code == 200
    assert page.headers["content-type"].startswith("text/html")
    assert page.headers["cache-control"] == "no-cache"
    assert page.headers["etag"]
    assert "frame-ancestors 'none'" in page.headers["content-security-policy"]


def test_two_browsers_get_two_sessions_and_not_each_others_page(settings):
    with open_client(settings) as first:
        own = first.get("/", follow_redirects=False).headers["location"]
        second = TestClient(first.app, base_url=ADDRESS)
        other = second.get("/", follow_redirects=False).headers["location"]
        assert own != other
        refused = second.get(own)
        assert refused.status_code == 404
        assert 'href="/"' in refused.text
        assert second.get(other).status_code == 200


def test_a_link_from_another_site_finds_the_session_all_the_same(client):
    """The browser keeps the cookie back then, so no session is made; it asks again from here."""
    for path in ("/", "/?a=1&b=%22", "/s/0123456789abcdef/"):
        reply = client.get(path, headers=ELSEWHERE, follow_redirects=False)
        assert reply.status_code == 200
        assert "set-cookie" not in reply.headers
        assert 'http-equiv="refresh"' in reply.text
        assert reply.text.count('"') % 2 == 0


def test_after_deletion_the_start_page_gives_another_session(client):
    visitor = Visitor(client)
    client.cookies.set(f"ridetune_{visitor.id}", visitor.token)
    assert client.get("/", follow_redirects=False).headers["location"] == f"/s/{visitor.id}/"
    visitor.delete()
    assert client.get("/", follow_redirects=False).headers["location"] != f"/s/{visitor.id}/"


@pytest.mark.parametrize(
    "name", ["..%2fpyproject.toml", "../app/main.py", "%2e%2e/app/main.py", "x"]
)
def test_static_files_stay_in_their_folder(client, name):
    reply = client.get(f"/static/{name}")
    assert reply.status_code == 404
    assert reply.headers["content-type"] == "application/problem+json"


def test_static_files_have_their_types_and_are_asked_for_again(client):
    icon = client.get("/static/icon.svg")
    assert icon.headers["content-type"].startswith("image/svg+xml")
    assert icon.headers["cache-control"] == "no-cache"
    unchanged = client.get("/static/icon.svg", headers={"If-None-Match": icon.headers["etag"]})
    assert unchanged.status_code == 304


def test_an_unknown_address_and_a_wrong_method_are_problems(client):
    for reply, status in (
        (client.get("/api/nothing"), 404),
        (client.patch("/api/parameters"), 405),
    ):
        assert reply.status_code == status
        assert reply.headers["content-type"] == "application/problem+json"
        assert reply.json()["status"] == status
