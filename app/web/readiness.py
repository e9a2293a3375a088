"""Whether the service can do its work, told part by part.

It is looked at once a second at most, however often it is asked for, and never on the event loop: a
part that is silent for `PATIENCE` is not ready, and is not asked again before it has answered.
"""

import asyncio
import logging
import tempfile
import threading
import time
from collections.abc import Awaitable, Callable
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Literal
from urllib.parse import urlsplit

from sqlalchemy import select

from ..storage.database import Database
from ..storage.tables import schema_version
from ..work.warmup import WarmUp
from .draining import GOING, Draining

log = logging.getLogger(__name__)

PATIENCE = 1.0
KEPT_FOR = 1.0
SCHEDULER_PORT = 8786

State = Literal["ready", "degraded", "compiling", "draining", "failed"]


@dataclass(frozen=True)
class Part:
    """What one part of the service says of itself."""

    state: State
    message: str

    @property
    def ready(self) -> bool:
        """Whether it does its work."""
        return self.state == "ready"

    @property
    def serves(self) -> bool:
        """Whether requests can be sent here, be it that some of them wait."""
        return self.state in ("ready", "degraded")


@dataclass(frozen=True)
class _Look:
    """How a part is looked at, and what is said where that fails."""

    look: Callable[[], Awaitable[object]]
    failed: Part


class Readiness:
    """The parts of one service; for the event loop."""

    def __init__(
        self,
        draining: Draining,
        warmup: WarmUp,
        database: Database,
        data: Path,
        cluster: str,
        refused: Callable[[], bool] = lambda: False,
        *,
        clock: Callable[[], float] = time.monotonic,
    ):
        """`data` is the data directory, `cluster` a scheduler's address or empty; `refused` tells
        whether jobs were lately refused there, by its certificate for one.
        """
        self._draining, self._warmup, self._clock = draining, warmup, clock
        self._looks = {
            "database": _Look(
                _Apart(lambda: _read(database)),
                Part("failed", "The database does not answer."),
            ),
            "data_directory": _Look(
                _Apart(lambda: _write(data)),
                Part("failed", "The data directory cannot be written, or its disk is full."),
            ),
        }
        if cluster:
            self._looks["cluster"] = _Look(
                lambda: _reach(cluster, refused),
                Part("degraded", "The job workers cannot be reached; jobs wait for them."),
            )
        self._seen: dict[str, Part] = {}
        self._looked = -KEPT_FOR
        self._one = asyncio.Lock()

    async def parts(self) -> dict[str, Part]:
        """Every part by its name, what is first to be mended first."""
        async with self._one:
            if self._clock() - self._looked >= KEPT_FOR:
                seen = await asyncio.gather(*(self._look(name) for name in self._looks))
                self._seen = dict(zip(self._looks, seen, strict=True))
                self._looked = self._clock()
        going = self._draining.begun
        return {
            "service": Part("draining", GOING) if going else Part("ready", "It takes requests."),
            "kernels": Part(self._warmup.state, self._warmup.message),
            **self._seen,
        }

    async def _look(self, name: str) -> Part:
        how = self._looks[name]
        try:
            await asyncio.wait_for(how.look(), PATIENCE)
        except Exception as error:
            if name not in self._seen or self._seen[name].ready:
                log.warning("%s is not ready: %r", name, error)
            return how.failed
        return Part("ready", "Ready.")


class _Apart:
    """Work on a thread of its own that may hang; not begun again before it has ended."""

    def __init__(self, work: Callable[[], object]):
        self._work = work
        self._answer: Future[object] | None = None

    async def __call__(self) -> object:
        if self._answer is None or self._answer.done():
            self._answer = Future()
            threading.Thread(target=self._run, args=(self._answer,), daemon=True).start()
        return await asyncio.shield(asyncio.wrap_future(self._answer))

    def _run(self, answer: "Future[object]") -> None:
        try:
            answer.set_result(self._work())
        except Exception as error:
            answer.set_exception(error)


def _read(database: Database) -> None:
    with database.reading() as connection:
        connection.execute(select(schema_version.c.version)).all()


def _write(folder: Path) -> None:
    with tempfile.TemporaryFile(dir=folder) as file:
        file.write(bytes(4096))
        file.flush()


async def _reach(address: str, refused: Callable[[], bool]) -> None:
    """Connect to a scheduler at `tls://host:port`; OSError too where jobs were refused there."""
    if refused():
        raise ConnectionRefusedError("jobs were refused")
    place = urlsplit(address if "//" in address else f"//{address}")
    _, writer = await asyncio.open_connection(place.hostname, place.port or SCHEDULER_PORT)
    writer.close()
