"""Run the service until it is told to stop."""

import resource
import socket

import uvicorn

from . import logs
from .access.invitation import link, link_command, note_address
from .addresses import in_brackets, is_loopback
from .errors import StartError
from .main import create_app
from .settings import EVERY_ADDRESS, Settings
from .storage.store import Store
from .web.connection import connections
from .web.server import CUT_OFF_SECONDS, Server

FILES = 65_536
WAITING = 1024


def serve(settings: Settings) -> None:
    """Serve; StartError with a sentence if the address or the data directory cannot be had."""
    logs.configure(settings.log, settings.log_level)
    _allow_many_files()
    with _listen(settings) as listener:
        store = Store(settings.data, settings.limits, settings.database)
        try:
            settings.check_bind(keys=store.keys.any())
        except StartError:
            store.close()
            raise
        store.browsers.remove_others(settings.token)
        _invite(settings, store, _address(settings, listener))
        app = create_app(settings, store=store)
        http, websocket = connections(settings.limits, settings.proxy_addresses)
        config = uvicorn.Config(
            app,
            http=http,
            ws=websocket,
            ws_max_size=settings.limits.tab_message_bytes,
            log_config=None,
            log_level="warning",
            access_log=False,
            server_header=False,
            proxy_headers=False,  # what counts is who connects, see proxy_login.py
            ws_per_message_deflate=False,
            timeout_graceful_shutdown=CUT_OFF_SECONDS,
        )
        server = Server(config, app.state.draining, grace=settings.grace, notice=settings.notice)
        server.run(sockets=[listener])


def _address(settings: Settings, listener: socket.socket) -> str:
    """Where visitors find the service."""
    host, port = listener.getsockname()[:2]
    shown = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host) or host
    return settings.public_url or f"http://{in_brackets(shown)}:{port}"


def _invite(settings: Settings, store: Store, address: str) -> None:
    """Tell where the service is and how to get in."""
    note_address(settings, address)
    if not settings.login:
        told = f"ridetune serves {address}/ to everybody on this machine."
    elif settings.token or settings.proxy_user_header or not is_loopback(settings.host):
        token = "?token=<RIDETUNE_TOKEN>" if settings.token else ""
        told = f"ridetune serves {address}/{token}"
    else:
        told = (
            f"Open {link(address, store.browsers.make_link())}\n"
            "This link lets one browser in, which then stays let in; for another: "
            f"{link_command(settings)}"
        )
    if settings.host in EVERY_ADDRESS:
        told += (
            f"\nIt answers to the names {', '.join(sorted(settings.host_names()))} alone; "
            "RIDETUNE_ALLOWED_HOSTS adds others by which it is reached."
        )
    print(f"{told}\nData are kept in {settings.data}.", flush=True)


def _listen(settings: Settings) -> socket.socket:
    """The listening socket, so that a port in use is a sentence and port 0 is told."""
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            settings.host, settings.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listener = socket.socket(family, kind, protocol)
    except OSError as error:
        raise _refused(settings, error) from None
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(WAITING)
    except OSError as error:
        listener.close()
        raise _refused(settings, error) from None
    return listener


def _refused(settings: Settings, error: OSError) -> StartError:
    return StartError(
        f"Cannot listen on {settings.host} port {settings.port} ({error.strerror}); is another "
        "service there? Choose another with --port."
    )


def _allow_many_files() -> None:
    """Each 3D tab takes several file descriptors; take what the system lets us."""
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = FILES if most == resource.RLIM_INFINITY else min(FILES, most)
    resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, most))
