"""The 3D view: one viser server a session, shown through this service's own address.

viser runs a websocket server of its own on a loopback port, which takes nobody but the relay here
(viser_servers.py); nothing else of it is used. Its single-file page is served here with a bridge
script in front of it, and only the websocket is passed on. So there is one origin and one port, and
nobody gets at a car without its session.
viser is imported with the first view: it takes longer to load than the rest of the service.
"""

import ctypes
import threading
import time
from contextlib import suppress
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from fastapi import APIRouter, Depends
from fastapi.responses import HTMLResponse
from starlette.concurrency import run_in_threadpool
from starlette.websockets import WebSocket
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, WebSocketException

from ...engine.vehicle import Vehicle
from ..access.sessions import opened_session
from ..access.sockets import LATER, hang_up, hanging_up, let_in, messages, while_theirs
from ..errors import Busy, Unavailable
from ..limits import Limits
from ..package_files import package_folder
from .viser_servers import ADMISSION, closed_server

FOG = (18, 22, 27)
GROUND = (120, 124, 130)
"""Colour of the light from below."""
MESSAGE_BYTES = 64 << 20
EYE, TARGET = (3.3, -4.1, 1.45), (0.0, 0.0, 0.5)

router = APIRouter()


class Viewer:
    """One session's viser server and who watches it."""

    def __init__(self):
        import rich
        from viser import _messages as messages

        rich.get_console().quiet = True
        self.server = closed_server()
        self.watchers = 0
        self.seen = time.monotonic()
        # Any tab could ask for a public tunnel to this server.
        self.server._websock_server.unregister_handler(messages.ShareUrlRequest)
        self.server.gui.configure_theme(
            dark_mode=True, show_logo=False, show_share_button=False, control_layout="floating"
        )
        self.server.initial_camera.position = EYE
        self.server.initial_camera.look_at = TARGET
        self.server.initial_camera.fov = 0.62
        self.server.scene.world_axes.visible = False
        # Where there is no graphics card the usual environment map takes seconds to prepare.
        self.server.scene.configure_environment_map(None)
        self.server.scene.add_light_hemisphere("/light", ground_color=GROUND, intensity=1.5)
        self.server.scene.configure_default_lights(cast_shadow=False)
        self.server.scene.configure_fog(14.0, 60.0, color=FOG)

    @property
    def address(self) -> str:
        """Where the relay connects to."""
        return f"ws://127.0.0.1:{self.server.get_port()}"


class Viewers:
    """The viewers of all sessions; every method may be called from any thread."""

    def __init__(self, limits: Limits | None = None):
        self.limits = limits or Limits()
        self._viewers: dict[str, Viewer] = {}
        self._lock = threading.Lock()

    def start(self, sid: str) -> Viewer:
        """The session's viewer, started when there is none, in place of one that nobody watches if
        there are too many; `Unavailable` where all are watched.
        """
        with self._lock:
            replaced = self._unwatched() if sid not in self._viewers else None
            if sid not in self._viewers:
                self._viewers[sid] = Viewer()
            viewer = self._viewers[sid]
            viewer.seen = time.monotonic()
        if replaced is not None:
            replaced.server.stop()
        return viewer

    def _unwatched(self) -> Viewer | None:
        """The viewer that makes room for another, if one must."""
        if len(self._viewers) < self.limits.viewers:
            return None
        unwatched = [sid for sid, viewer in self._viewers.items() if viewer.watchers <= 0]
        if not unwatched:
            raise Unavailable("All 3D views are in use; the page tries again by itself.")
        return self._viewers.pop(min(unwatched, key=lambda sid: self._viewers[sid].seen))

    def show(self, sid: str, vehicle: Vehicle) -> None:
        """Put a vehicle on the stage; the browser shapes the road from the histories."""
        from .scene import build

        try:
            server = self.start(sid).server
        except Unavailable:
            # A tab that wants to see it is told when it connects.
            return
        with server.atomic():
            build(server, vehicle)

    def watch(self, sid: str, tabs: int) -> Viewer:
        """Count a tab in (+1) or out (-1); `Busy` where the session has too many."""
        viewer = self.start(sid)
        with self._lock:
            if viewer.watchers + tabs > self.limits.session_viewers:
                raise Busy(
                    f"The session's 3D view is open in {viewer.watchers} tabs; close one of them."
                )
            viewer.watchers += tabs
        return viewer

    def stop(self, sid: str) -> None:
        """End a session's viewer, if it has one."""
        with self._lock:
            viewer = self._viewers.pop(sid, None)
        if viewer:
            viewer.server.stop()

    def reap(self) -> None:
        """Stop the viewers that nobody has watched for a while; a returning tab starts anew."""
        late = time.monotonic() - self.limits.unwatched_seconds
        with self._lock:
            idle = [sid for sid, v in self._viewers.items() if v.watchers <= 0 and v.seen < late]
        for sid in idle:
            self.stop(sid)
        if idle:
            _give_memory_back()

    def count(self) -> int:
        """How many there are, watched or not."""
        return len(self._viewers)

    def close(self) -> None:
        """Stop every viewer."""
        for sid in list(self._viewers):
            self.stop(sid)


def _give_memory_back() -> None:
    """Two thirds of what a viewer took stays with glibc's pools of its threads unless told."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


@cache
def _client_page() -> str:
    package = find_spec("viser")
    if package is None or package.origin is None:
        raise ModuleNotFoundError("The 3D view needs viser; install the project's requirements.")
    page = Path(package.origin).parent / "client" / "build" / "index.html"
    return page.read_text(encoding="utf-8")


@router.get("/s/{sid}/viewer/", include_in_schema=False, dependencies=[Depends(opened_session)])
def page() -> HTMLResponse:
    static = package_folder("static")
    bridge = (static / "ride/bridge.js").read_text(encoding="utf-8")
    style = (static / "ride/bridge.css").read_text(encoding="utf-8")
    head = f"<script>{bridge}</script><style>{style}</style>"
    html = _client_page().replace('<meta charset="utf-8" />', f'<meta charset="utf-8" />{head}', 1)
    # The client needs inline and evaluated script (WebAssembly glue). What must not happen is
    # that it talks to another server: ?websocket= would let a stranger's scene run in our origin.
    policy = (
        "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' blob:; "
        "worker-src blob:; style-src 'unsafe-inline'; img-src 'self' data: blob:; "
        "font-src data:; connect-src 'self' data: blob:; base-uri 'none'; form-action 'none'; "
        "frame-ancestors 'self'"
    )
    return HTMLResponse(html, headers={"Content-Security-Policy": policy})


@router.websocket("/s/{sid}/viewer")
async def relay(websocket: WebSocket, sid: str) -> None:
    viewers: Viewers = websocket.app.state.services.viewers
    async with hanging_up(websocket):
        await let_in(websocket, sid)
        viewer = await run_in_threadpool(viewers.watch, sid, 1)
        try:
            await _pass_on(websocket, sid, viewer.address, viewers.limits)
        finally:
            viewer.watchers -= 1
            viewer.seen = time.monotonic()


async def _pass_on(websocket: WebSocket, sid: str, address: str, limits: Limits) -> None:
    """Carry messages both ways until either side hangs up, the session is theirs no more, or the
    browser sends too many.
    """
    offered = [p for p in websocket.scope["subprotocols"] if p.startswith("viser-v")][:1]
    try:
        async with connect(
            address,
            additional_headers=ADMISSION,
            subprotocols=offered or None,
            compression=None,
            max_size=MESSAGE_BYTES,
            ping_interval=None,
            proxy=None,
        ) as upstream:
            await websocket.accept(subprotocol=upstream.subprotocol)
            await while_theirs(
                websocket,
                sid,
                _to_viser(websocket, upstream, limits),
                _to_browser(websocket, upstream),
            )
    except (OSError, WebSocketException):
        await hang_up(websocket, LATER, "The 3D view is restarting.")


async def _to_viser(websocket: WebSocket, upstream: ClientConnection, limits: Limits) -> None:
    async for message in messages(websocket, limits):
        await upstream.send(message)


async def _to_browser(websocket: WebSocket, upstream: ClientConnection) -> None:
    try:
        async for message in upstream:
            await websocket.send_bytes(message if isinstance(message, bytes) else message.encode())
    except ConnectionClosed:
        pass
    # 1002 tells viser's client that it is of another version; after all else it tries again.
    await websocket.close(1002 if upstream.close_code == 1002 else 1012)
