"""The service that is measured: a process of its own with a throw-away data directory.

It takes a token that nobody else knows, and is watched from outside: the memory and the processor
time of its whole tree of processes, the bytes of its directory.
"""

import asyncio
import os
import re
import secrets
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import psutil
from websockets.asyncio.client import connect

from ..startup import SERVE, bare_environment
from .connection import Connection, Unexpected, request

PATIENCE = 120.0
"""Longest wait for the service, s."""


@dataclass(frozen=True)
class Visitor:
    """A session of the service and what opens it."""

    id: str
    token: str

    def request(self, method: str, path: str = "", body=None, accept="application/json") -> bytes:
        """A request below the session, as bytes."""
        return request(method, f"/api/sessions/{self.id}{path}", self.token, body, accept)


UNLIMITED = {"new_sessions": 10**6, "session_simulated_seconds": 1e9, "viewers": 1000}


class Subject:
    """A running service; `close` ends it and removes what it kept."""

    def __init__(self, limits: Mapping[str, float] = {}):
        """limits : by name, in place of the service's own; what one caller may do in a time is not
        limited, as the bench calls for all.
        """
        told = UNLIMITED | dict(limits)
        self._limits = {f"RIDETUNE_LIMIT_{name.upper()}": str(n) for name, n in told.items()}
        self._secret = secrets.token_hex(16)
        self._folder = tempfile.TemporaryDirectory(prefix="ridetune-bench-")
        self.port = 0
        self.start()

    def start(self) -> None:
        """Start, or start again after `kill`; it listens when this returns."""
        command = [sys.executable, "-u", "-c", SERVE]
        told = {**self._limits, "RIDETUNE_TOKEN": self._secret}
        self.began = time.perf_counter()
        self._process = subprocess.Popen(
            [*command, "serve", "--port", str(self.port), "--data", self._folder.name],
            env=bare_environment() | told,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        assert self._process.stdout is not None
        found = re.search(r"http://[\d.]+:(\d+)/", self._process.stdout.readline())
        if found is None:
            raise Unexpected("The service did not start; see what it says above.")
        self.port = int(found[1])

    async def ready(self) -> float:
        """Seconds from its start until it simulates."""
        connection, asked = Connection(self.port), request("GET", "/readyz")
        try:
            while (await connection.ask(asked)).status != 200:
                if time.perf_counter() - self.began > PATIENCE:
                    raise Unexpected("The service does not become ready.")
                await asyncio.sleep(0.005)
            return time.perf_counter() - self.began
        finally:
            connection.close()

    def socket(self, path: str, visitor: Visitor, *protocols: str) -> connect:
        """A websocket of a visitor's, to be awaited or entered."""
        return connect(
            f"ws://127.0.0.1:{self.port}{path}",
            additional_headers={"Authorization": f"Bearer {visitor.token}"},
            subprotocols=protocols or None,  # pyright: ignore[reportArgumentType]
            compression=None,
            max_size=None,
            proxy=None,
        )

    def kill(self) -> None:
        """End it and all its processes as a power cut would."""
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()

    async def visitor(self) -> Visitor:
        """A fresh session."""
        connection = Connection(self.port)
        try:
            asked = request("POST", "/api/sessions", self._secret)
            made = (await connection.wanted(asked, 201)).json
            return Visitor(made["id"], made["token"])
        finally:
            connection.close()

    async def visitors(self, count: int) -> list[Visitor]:
        """Fresh sessions."""
        return [await self.visitor() for _ in range(count)]

    @property
    def memory(self) -> float:
        """Memory of all its processes, bytes: each its proportional share of what is shared."""
        return sum(_of(process, lambda one: one.memory_full_info().pss) for process in self._tree())

    @property
    def own_memory(self) -> float:
        """Memory of the serving process alone, bytes."""
        return psutil.Process(self._process.pid).memory_full_info().pss

    @property
    def processor(self) -> float:
        """Processor time of all its processes, s, those included that have ended."""
        return sum(_of(process, lambda one: sum(one.cpu_times()[:4])) for process in self._tree())

    @property
    def own_processor(self) -> float:
        """Processor time of the serving process alone, s."""
        return sum(psutil.Process(self._process.pid).cpu_times()[:2])

    @property
    def disk(self) -> int:
        """Bytes of its data directory as the disk allots them."""
        files = [file for file in Path(self._folder.name).rglob("*") if file.is_file()]
        return sum(512 * file.stat().st_blocks for file in files)

    def _tree(self) -> list[psutil.Process]:
        root = psutil.Process(self._process.pid)
        return [root, *root.children(recursive=True)]

    def close(self) -> None:
        """End it."""
        self.kill()
        assert self._process.stdout is not None
        self._process.stdout.close()
        self._folder.cleanup()


def _of(process: psutil.Process, asked) -> float:
    """What a process says of itself; nothing of one that has ended."""
    with suppress(psutil.NoSuchProcess, psutil.AccessDenied):
        return asked(process)
    return 0
