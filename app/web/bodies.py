"""A request's body while it arrives: not above its limit, and not slower than a line can be.

Only the time spent waiting for the caller counts, not that in which the service does other work.
"""

import asyncio
import time
from collections.abc import Callable

from starlette.exceptions import HTTPException
from starlette.types import Message, Receive

from ..limits import Limits


class Body:
    """What stands between a request and its sender."""

    def __init__(
        self,
        receive: Receive,
        most: int,
        too_large: str,
        limits: Limits,
        clock: Callable[[], float] = time.monotonic,
    ):
        """`most` bytes are taken, beyond which `too_large` is the answer."""
        self._receive, self._clock = receive, clock
        self._most, self._too_large = most, too_large
        self._grace, self._rate = limits.body_seconds, limits.body_rate
        self._taken = 0
        self._waited = 0.0
        self._whole = False

    async def receive(self) -> Message:
        """The next part; HTTP 408 or 413 in its place."""
        if self._whole:
            return await self._receive()
        left = self._grace + self._taken / self._rate - self._waited
        if left <= 0:
            raise self._too_slow()
        began = self._clock()
        try:
            async with asyncio.timeout(left):
                message = await self._receive()
        except TimeoutError:
            raise self._too_slow() from None
        self._waited += self._clock() - began
        self._taken += len(message.get("body", b""))
        if self._taken > self._most:
            raise HTTPException(413, self._too_large)
        self._whole = not message.get("more_body", False)
        return message

    def _too_slow(self) -> HTTPException:
        return HTTPException(
            408,
            f"The body arrives too slowly: after {self._grace:g} s it must come at "
            f"{self._rate / 1e3:g} kB/s; send it over a faster connection, or in parts.",
            headers={"Connection": "close"},
        )
