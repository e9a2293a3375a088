"""A beat of the event loop: how late it is is measured, and that it is there is told."""

import asyncio
from collections.abc import Callable

from .notify import notify

EVERY = 0.5


async def beat(late: Callable[[float], None]) -> None:
    """Beat until cancelled; a service manager that set a watchdog hears of each beat."""
    loop = asyncio.get_running_loop()
    while True:
        due = loop.time() + EVERY
        await asyncio.sleep(EVERY)
        late(max(0.0, loop.time() - due))
        notify("WATCHDOG=1")
