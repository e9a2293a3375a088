"""viser servers that take nobody but our own relay.

viser listens on a loopback port and takes whoever connects: any process of this machine, and by its
browser any page in the world. So each connection must bring a secret of this process before it is
answered at all. viser 1.1.1 offers no such hook; tests of the relay hold it to this one.
"""

import hmac
import secrets
import threading
from http import HTTPStatus
from typing import Any

from websockets.asyncio import server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

HEADER = "X-Ridetune-Relay"
_secret = secrets.token_urlsafe(32)
ADMISSION = {HEADER: _secret}
"""Headers with which a server of this process is reached."""

_usual = server.serve
_starting = threading.Lock()


def closed_server() -> Any:
    """A `viser.ViserServer` on a free loopback port that answers only to `ADMISSION`."""
    import viser

    with _starting:
        server.serve = _serve  # looked up by viser while the server starts
        try:
            return viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        finally:
            server.serve = _usual


def _serve(*arguments: Any, process_request: Any, **options: Any) -> Any:
    """`websockets.asyncio.server.serve`, as viser calls it, with a look at who comes before all."""

    def admit(connection: ServerConnection, request: Request) -> Response | None:
        brought = "".join(request.headers.get_all(HEADER))
        if not hmac.compare_digest(brought.encode(errors="replace"), _secret.encode()):
            return connection.respond(HTTPStatus.FORBIDDEN, "")
        return process_request(connection, request)

    return _usual(*arguments, process_request=admit, **options)
