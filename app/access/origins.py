"""Where a request may come from: to which host, and from which page.

Host must be on the list, or a page elsewhere could reach a local service by a name of its own
(DNS rebinding). A request that changes something, and every websocket, must come from our own
page, or from no page at all: a program, which for a websocket shows by a bearer that it is none.
"""

from starlette.datastructures import Headers
from starlette.types import Scope

from ..addresses import without_port

READING = ("GET", "HEAD", "OPTIONS")
ELSEWHERE = ("cross-site", "same-site")
"""Pages that a browser says are not ours; another port of this machine is the same site."""


OTHER_ORIGIN = "Requests from pages of another origin are refused; use the service's own page."


def refusal(scope: Scope, hosts: frozenset[str], public_url: str) -> str | None:
    """Why a request may not come in, or None."""
    headers = Headers(scope=scope)
    # Of two it is not known which one is meant.
    host = ",".join(headers.getlist("host")).lower()
    if without_port(host) not in hosts:
        return (
            "This service does not answer to that host name; use its own address, or add the name "
            "to RIDETUNE_ALLOWED_HOSTS."
        )
    elsewhere = headers.get("sec-fetch-site") in ELSEWHERE
    if scope["type"] == "http" and scope["method"] in READING:
        return OTHER_ORIGIN if elsewhere and not _is_a_link(headers) else None
    stated = headers.get("origin")
    if stated is None:
        anonymous = scope["type"] == "websocket" and not bearer(headers)
        return OTHER_ORIGIN if elsewhere or anonymous else None
    if stated.lower() == f"https://{host}" != public_url:
        return "The page comes by https through a proxy; set RIDETUNE_PUBLIC_URL to its address."
    return None if stated.lower() in _own(host, public_url) and not elsewhere else OTHER_ORIGIN


def _own(host: str, public_url: str) -> tuple[str, ...]:
    """Origins of our page. The public host is not reached by http where its address says https."""
    if public_url.endswith(f"//{host}"):
        return (public_url,)
    return (f"http://{host}", *filter(None, [public_url]))


def bearer(headers: Headers) -> str:
    """Token in the Authorization header, or nothing."""
    kind, _, token = headers.get("authorization", "").partition(" ")
    return token.strip() if kind.lower() == "bearer" else ""


def _is_a_link(headers: Headers) -> bool:
    """Whether a person goes to an address, instead of a page fetching or framing it."""
    return headers.get("sec-fetch-mode") == "navigate" and headers.get("sec-fetch-dest") in (
        "document",
        None,
    )
