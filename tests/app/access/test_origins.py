"""Which pages may send: exactly our own, by scheme, host and port, also behind a proxy.

Oracle: RFC 6454, two pages are of one origin if scheme, host and port are the same.
"""

import pytest
from ridetune.app.access.origins import refusal

LOCAL = "127.0.0.1:8000"
PUBLIC = "https://ride.example.com"
HOSTS = frozenset({"127.0.0.1", "localhost", "ride.example.com"})
SOCKET, POST, GET = ("websocket", None), ("http", "POST"), ("http", "GET")
LINK = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate", "sec-fetch-dest": "document"}


def refused(kind, public="", **headers):
    """Why a request with these headers is refused, None where it may come in."""
    sent = {"host": LOCAL} | {name.replace("_", "-"): text for name, text in headers.items()}
    scope = {
        "type": kind[0],
        "method": kind[1],
        "headers": [(name.encode(), text.encode()) for name, text in sent.items()],
    }
    return refusal(scope, HOSTS, public)


@pytest.mark.parametrize("kind", [SOCKET, POST])
@pytest.mark.parametrize(
    ("host", "origin", "public"),
    [
        (LOCAL, f"http://{LOCAL}", ""),
        ("localhost", "http://localhost", ""),
        (LOCAL, f"http://{LOCAL}", PUBLIC),
        ("ride.example.com", PUBLIC, PUBLIC),
        (LOCAL, PUBLIC, PUBLIC),
    ],
    ids=["own", "usual port", "on the machine", "proxy", "proxy that puts in its own host"],
)
def test_our_own_page_may(kind, host, origin, public):
    assert refused(kind, public, host=host, origin=origin) is None


@pytest.mark.parametrize("kind", [SOCKET, POST])
@pytest.mark.parametrize(
    ("host", "origin", "public"),
    [
        (LOCAL, "http://127.0.0.1:8001", ""),
        (LOCAL, "http://127.0.0.1", ""),
        (LOCAL, "http://localhost:8000", ""),
        (LOCAL, f"https://{LOCAL}", ""),
        (LOCAL, "null", ""),
        (LOCAL, "", ""),
        (LOCAL, f"http://{LOCAL}.evil.example", ""),
        (LOCAL, f"http://evil.example@{LOCAL}", ""),
        ("ride.example.com", "http://ride.example.com", PUBLIC),
        ("ride.example.com", f"{PUBLIC}:444", PUBLIC),
        ("ride.example.com", "https://evil.ride.example.com", PUBLIC),
    ],
)
def test_a_page_of_another_origin_may_not(kind, host, origin, public):
    assert refused(kind, public, host=host, origin=origin)


def test_a_proxy_that_was_not_told_is_named():
    """Its page comes by https and our own scheme is http."""
    reason = refused(POST, host="ride.example.com", origin=PUBLIC)
    assert "RIDETUNE_PUBLIC_URL" in reason


def test_a_socket_without_a_page_needs_a_bearer():
    """Browsers always tell the origin of a websocket, so this is a program, or a forgery."""
    assert refused(SOCKET)
    assert refused(SOCKET, authorization="Basic cGFnZTpwYWdl")
    assert refused(SOCKET, authorization="Bearer rt_x") is None
    assert refused(SOCKET, authorization="Bearer rt_x", origin="http://evil.example")
    assert refused(POST) is None


@pytest.mark.parametrize("kind", [SOCKET, POST, GET])
@pytest.mark.parametrize("site", ["cross-site", "same-site"])
@pytest.mark.parametrize("mode", ["no-cors", "cors", "websocket", "navigate"])
def test_nothing_of_ours_is_put_into_another_page(kind, site, mode):
    """Another port of this machine is the same site, to which a browser sends our cookies."""
    bearer = {"authorization": "Bearer rt_x"}
    sent = {"sec_fetch_site": site, "sec_fetch_mode": mode, "sec_fetch_dest": "iframe"}
    assert refused(kind, **sent, **bearer)


def test_a_person_may_follow_a_link_from_another_page():
    assert refused(GET, **LINK) is None
    assert refused(POST, **LINK)
    assert refused(GET, sec_fetch_site="none", sec_fetch_mode="navigate") is None
    assert refused(GET, sec_fetch_site="same-origin", sec_fetch_mode="cors") is None
