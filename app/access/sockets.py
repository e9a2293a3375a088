"""Websockets of a session's pages: who is let in, what may be sent, when they are hung up on."""

import asyncio
from collections.abc import AsyncIterator, Coroutine
from contextlib import asynccontextmanager, suppress
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.websockets import WebSocket, WebSocketDisconnect

from ..errors import Busy, NotFound, Unavailable, UnknownKey
from ..limits import Limits
from ..web.buckets import Buckets
from .sessions import session_of

REFUSED, LATER = 1008, 1013
"""Close codes: to the latter, a page connects again."""
BURST_SECONDS = 5
"""How long a tab may send as fast as it can, in what it may send a second."""
LOOK_AGAIN_SECONDS = 10.0
"""How often it is looked at anew whether what is open is still the visitor's."""


class Flooded(Busy):
    """More messages than a tab may send."""


@asynccontextmanager
async def hanging_up(websocket: WebSocket) -> AsyncIterator[None]:
    """A block that may refuse: then it is hung up, with the reason if the caller may know it. A tab
    that is gone is none of its errors.
    """
    try:
        yield
    except WebSocketDisconnect:
        pass
    except NotFound:
        await hang_up(websocket, REFUSED)
    except (UnknownKey, Flooded) as refused:
        await hang_up(websocket, REFUSED, str(refused))
    except (Busy, Unavailable) as refused:
        await hang_up(websocket, LATER, str(refused))


async def let_in(websocket: WebSocket, sid: str) -> None:
    """Refuse whose session it is not, by an error for `hanging_up`."""
    await run_in_threadpool(session_of, websocket, sid)


async def accept(websocket: WebSocket) -> None:
    """Open it; WebSocketDisconnect where the tab is gone meanwhile."""
    try:
        await websocket.accept()
    except OSError:
        raise WebSocketDisconnect(1006) from None


async def hang_up(websocket: WebSocket, code: int, reason: str = "") -> None:
    """Tell a tab why it gets nothing more; one that is gone meanwhile need not be told."""
    # Starlette's for one that was seen to be gone is a RuntimeError.
    with suppress(OSError, RuntimeError, WebSocketDisconnect):
        await websocket.close(code, reason)


async def messages(websocket: WebSocket, limits: Limits) -> AsyncIterator[str | bytes]:
    """What a tab sends, until it goes; Flooded where that is too many."""
    rate = limits.tab_messages
    allowed = Buckets(rate, BURST_SECONDS * rate)
    while (message := await websocket.receive())["type"] != "websocket.disconnect":
        if allowed.take("tab"):
            raise Flooded("The page sends too many messages; load it again.")
        data = message.get("bytes")
        yield message["text"] if data is None else data


async def while_theirs(websocket: WebSocket, sid: str, *ways: Coroutine[Any, Any, None]) -> None:
    """Go all ways at once until one of them ends, or the session is the caller's no more: deleted,
    or their key removed. Raises the error of the first way that failed; that a tab goes is none.
    """
    lost = asyncio.create_task(_until_lost(websocket, sid))
    tasks = [asyncio.create_task(way) for way in ways]
    try:
        await asyncio.wait((lost, *tasks), return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in (lost, *tasks):
            task.cancel()
    await asyncio.wait((lost, *tasks))
    for task in (*tasks, lost):
        error = None if task.cancelled() else task.exception()
        if error is not None and not isinstance(error, WebSocketDisconnect):
            raise error
    if not lost.cancelled():
        await hang_up(websocket, REFUSED)


async def _until_lost(websocket: WebSocket, sid: str) -> None:
    with suppress(NotFound, UnknownKey):
        while True:
            await asyncio.sleep(LOOK_AGAIN_SECONDS)
            # While nobody can tell, it stays theirs.
            with suppress(Unavailable):
                await let_in(websocket, sid)
