"""Who follows jobs: one look at the database serves all of them.

It is made once a second, for another process may be running the jobs, and at once for those that
have news in this one. For the event loop.
"""

import asyncio
import logging
import time
from collections.abc import AsyncGenerator, Collection, Mapping
from contextlib import suppress

from ..errors import Unavailable
from ..storage.job_row import Job
from ..storage.job_store import JobStore

log = logging.getLogger(__name__)

POLL_EVERY = 1.0
"""Time between two looks at all jobs that are followed, s."""


class Followers:
    """Those of the jobs of all sessions."""

    def __init__(self, jobs: JobStore):
        self._jobs = jobs
        self._of: dict[str, set[_Follower]] = {}
        self._news: set[str] = set()
        self._some = asyncio.Event()
        self._looking: asyncio.Task[None] | None = None

    @property
    def followed(self) -> frozenset[str]:
        """The ids of the jobs that somebody follows."""
        return frozenset(self._of)

    def wake(self, job: str) -> None:
        """There is news of a job."""
        if job in self._of:
            self._news.add(job)
            self._some.set()

    async def looks(self, job: str) -> AsyncGenerator[Job | None, None]:
        """A job as each look finds it, None where there is none; nothing while the database is
        away, and only the latest where looks come faster than they are taken.
        """
        follower = _Follower()
        self._of.setdefault(job, set()).add(follower)
        self.wake(job)
        if self._looking is None:
            self._looking = asyncio.create_task(self._keep_looking())
        try:
            while True:
                await follower.seen.wait()
                follower.seen.clear()
                yield follower.latest
        finally:
            self._of[job].discard(follower)
            if not self._of[job]:
                del self._of[job]
            if not self._of and self._looking is not None:
                self._looking.cancel()
                self._looking = None

    async def _keep_looking(self) -> None:
        looked = -POLL_EVERY
        while True:
            left = looked + POLL_EVERY - time.monotonic()
            # Not by wait_for, which may swallow that it is cancelled where there are news as well.
            with suppress(TimeoutError):
                async with asyncio.timeout(max(left, 0.0)):
                    await self._some.wait()
            if time.monotonic() >= looked + POLL_EVERY:
                looked, jobs = time.monotonic(), self.followed
            else:
                jobs = self.followed & self._news
            self._news.clear()
            self._some.clear()
            try:
                self._tell(jobs, await asyncio.to_thread(self._jobs.standing, jobs))
            except Unavailable:
                continue
            except Exception:
                log.exception("who follows jobs waits")

    def _tell(self, jobs: Collection[str], found: Mapping[str, Job]) -> None:
        for job in jobs:
            for follower in self._of.get(job, ()):
                follower.latest = found.get(job)
                follower.seen.set()


class _Follower:
    def __init__(self):
        self.seen = asyncio.Event()
        self.latest: Job | None = None
