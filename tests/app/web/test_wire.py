"""What a socket may send that no client library would: the service answers once, or hangs up.

Oracle: RFC 9112. Where a length is told twice or in two ways (section 6.3), or a line is none
(2.2, 5.1, 7.1), the message is refused and the connection closed, so that nothing that follows it
is taken for a request of its own.
"""

import re
import socket
from contextlib import suppress

import pytest

from ..live import LiveService

PATIENCE = 60.0
HOST = b"Host: 127.0.0.1\r\n"
CLOSE = b"Connection: close\r\n\r\n"
SMUGGLED = b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
STATUS = re.compile(rb"HTTP/1\.1 (\d{3}) ")


@pytest.fixture(scope="module")
def service(tmp_path_factory):
    with LiveService(tmp_path_factory.mktemp("wire") / "data") as service:
        yield service


def sent(service: LiveService, request: bytes) -> list[int]:
    """Statuses of all that comes back until the connection is closed, which it has to be."""
    port, received = int(service.address.rpartition(":")[2]), b""
    with (
        socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as wire,
        suppress(ConnectionResetError, BrokenPipeError),
    ):
        wire.sendall(request)
        while piece := wire.recv(65_536):
            received += piece
    return [int(status) for status in STATUS.findall(received)]


def post(*headers: bytes, body: bytes = b"") -> bytes:
    lines = b"".join(header + b"\r\n" for header in headers)
    return b"POST /api/sessions HTTP/1.1\r\n" + HOST + lines + b"\r\n" + body


AMBIGUOUS = {
    "length and chunks": post(
        b"Content-Length: 4", b"Transfer-Encoding: chunked", body=b"0\r\n\r\n"
    ),
    "chunks and length": post(
        b"Transfer-Encoding: chunked", b"Content-Length: 4", body=b"0\r\n\r\n"
    ),
    "two lengths": post(b"Content-Length: 0", b"Content-Length: 44"),
    "a list of lengths": post(b"Content-Length: 0, 44"),
    "a signed length": post(b"Content-Length: +0"),
    "a negative length": post(b"Content-Length: -1"),
    "a hexadecimal length": post(b"Content-Length: 0x2c"),
    "a space before the colon": post(b"Content-Length : 44"),
    "a folded header": post(b"X-A: 1", b" Content-Length: 44"),
    "a control character": post(b"X-A: 1\x00Content-Length: 44"),
    "a chunk without a size": post(b"Transfer-Encoding: chunked", body=b"z\r\n\r\n"),
    "a size beyond 64 bits": post(b"Transfer-Encoding: chunked", body=b"f" * 17 + b"\r\n"),
    "chunked not last": post(b"Transfer-Encoding: chunked, identity", body=b"0\r\n\r\n"),
    "an unknown coding": post(b"Transfer-Encoding: xchunked", body=b"0\r\n\r\n"),
}


@pytest.mark.parametrize("name", AMBIGUOUS)
def test_a_message_of_two_meanings_hides_no_request(service, name):
    assert sent(service, AMBIGUOUS[name] + SMUGGLED) in ([], [400])


@pytest.mark.parametrize(
    "line",
    [
        b"GET /healthz HTTP/9.9\r\n",
        b"GARBAGE\r\n",
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",  # the beginning of a TLS handshake
        b"GET /" + b"a" * 100_000 + b" HTTP/1.1\r\n",
        b"PRI * HTTP/2.0\r\n\r\nSM\r\n",
    ],
)
def test_what_is_no_request_is_not_answered_as_one(service, line):
    statuses = sent(service, line + HOST + CLOSE)
    assert statuses in ([], [400], [404], [414], [431])
    assert service.client.get("/healthz").status_code == 200


@pytest.mark.parametrize(
    "headers",
    [
        b"".join(b"X-%d: %s\r\n" % (k, b"x" * 100) for k in range(20_000)),
        b"X: " + b"x" * 2_000_000 + b"\r\n",
        b"Cookie: " + b"a=b; " * 20_000 + b"\r\n",
    ],
    ids=["many", "long", "cookies"],
)
def test_headers_without_end_are_cut_short_or_of_no_use(service, headers):
    statuses = sent(service, b"GET /healthz HTTP/1.1\r\n" + HOST + headers + CLOSE)
    assert statuses in ([], [200], [400], [431])
    assert service.client.get("/healthz").status_code == 200


def test_a_request_needs_one_host(service):
    """RFC 9112, 3.2: none, or two, and it is not known whom the request is for."""
    for hosts in (b"", HOST + b"Host: evil.example\r\n"):
        statuses = sent(service, b"GET /healthz HTTP/1.1\r\n" + hosts + CLOSE)
        assert statuses in ([], [400], [403])


def test_an_address_in_full_is_judged_by_its_host_header(service):
    """As a proxy sends it; the page of a name that leads here (DNS rebinding) gets nothing."""
    for host, status in ((HOST, 200), (b"Host: evil.example\r\n", 403)):
        whole = b"GET http://127.0.0.1/healthz HTTP/1.1\r\n" + host + CLOSE
        statuses = sent(service, whole)
        assert statuses == [status]
