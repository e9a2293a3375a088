"""One who drags a slider of the page."""

import asyncio
import json
import time
from collections.abc import Mapping
from typing import Any

from websockets.asyncio.client import ClientConnection

from .subject import PATIENCE, Subject, Visitor
from .work import head_of, moved


class Hand:
    """Sends each move over the websocket of the page; some of them are answered."""

    def __init__(self, subject: Subject, visitor: Visitor, vehicle: Mapping[str, Any]):
        self._subject, self._visitor, self._vehicle = subject, visitor, vehicle
        self._known_moves = 0
        self.answered: list[float] = []
        """Of each value that was simulated, from when it was sent to its reply, s."""
        self.known: list[float] = []
        """Of each move, from when it was sent to a reply that knows it or a later one, s."""

    async def drag(self, moves_a_second: float, phase: float, seconds: float) -> None:
        """Move so often, from a share of a move's time on, and wait for the last reply."""
        moves = int(seconds * moves_a_second)
        sent: list[float] = []
        path = f"/api/sessions/{self._visitor.id}/simulations"
        async with self._subject.socket(path, self._visitor) as socket:
            replies = asyncio.create_task(self._hear(socket, sent, moves))
            began = time.perf_counter() + phase / moves_a_second
            for number in range(moves):
                await asyncio.sleep(max(0.0, began + number / moves_a_second - time.perf_counter()))
                sent.append(time.perf_counter())
                await socket.send(json.dumps(moved(self._vehicle, number)))
            async with asyncio.timeout(PATIENCE):
                await replies

    async def _hear(self, socket: ClientConnection, sent: list[float], moves: int) -> None:
        while self._known_moves < moves:
            reply = await socket.recv()
            now = time.perf_counter()
            number = head_of(reply)["seq"]
            self.answered.append(now - sent[number])
            self.known += [now - at for at in sent[self._known_moves : number + 1]]
            self._known_moves = number + 1
