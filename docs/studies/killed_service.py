"""The service, and a cluster for it, as processes that can be killed and started again.

Part of `kills.py`.
"""

import os
import re
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import httpx2
import psutil

PATIENCE = 60.0
SERVE = "from ridetune.app.cli import main; main()"
NO_PAGES = ("--no-dashboard", "--host", "127.0.0.1")
SCHEDULER = ("-m", "distributed.cli.dask_scheduler", *NO_PAGES)
WORKER = ("-m", "distributed.cli.dask_worker", *NO_PAGES, "--nthreads", "1")


class Service:
    """`ridetune serve` on a port of its own, which it keeps over restarts."""

    def __init__(self, data: Path, database: str = "", cluster: "Cluster | None" = None):
        self.data, self.port = data, _free_port()
        self._database = database
        told = {
            "RIDETUNE_DATABASE": database,
            "RIDETUNE_LIMIT_SESSION_JOBS": "100000",
            "PYTHONWARNINGS": "ignore::UserWarning",  # of killed processes, on their semaphores
        }
        if cluster is not None:
            told["RIDETUNE_CLUSTER"] = cluster.address
        kept = {k: v for k, v in os.environ.items() if not k.startswith("RIDETUNE_")}
        cache = {k: v for k, v in os.environ.items() if k == "RIDETUNE_CACHE"}
        self._environment = kept | cache | {k: v for k, v in told.items() if v}
        self.start()

    @property
    def address(self) -> str:
        """Where it answers."""
        return f"http://127.0.0.1:{self.port}"

    def start(self) -> float:
        """Start; seconds until it is ready."""
        began = time.monotonic()
        options = ["serve", "--no-login", "--port", str(self.port), "--data", str(self.data)]
        self._process = subprocess.Popen(
            [sys.executable, "-c", SERVE, *options],
            env=self._environment,
            stdout=subprocess.DEVNULL,
            start_new_session=True,
        )
        while not self._ready():
            if self._process.poll() is not None:
                raise SystemExit("The service did not start again; see what it says above.")
            if time.monotonic() - began > PATIENCE:
                raise SystemExit("The service does not become ready.")
            time.sleep(0.02)
        return time.monotonic() - began

    def _ready(self) -> bool:
        with suppress(httpx2.HTTPError):
            return httpx2.get(f"{self.address}/readyz", timeout=5.0).status_code == 200
        return False

    def tree(self) -> list[psutil.Process]:
        """It and all that it started."""
        with suppress(psutil.NoSuchProcess):
            process = psutil.Process(self._process.pid)
            return [process, *process.children(recursive=True)]
        return []

    def is_simulator(self, process: psutil.Process) -> bool:
        """Whether a process of the tree simulates for sliders, or is forked for it."""
        with suppress(psutil.Error):
            return any("multiprocessing.forkserver" in part for part in process.cmdline())
        return False

    def is_worker(self, process: psutil.Process) -> bool:
        """Whether a process of the tree, or of the cluster, computes for jobs."""
        with suppress(psutil.Error):
            others = process.pid == self._process.pid or self.is_simulator(process)
            return not others and process.num_threads() > 2
        return False

    def kill_group(self) -> None:
        """As a power cut would."""
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()

    def kill(self) -> None:
        """The serving process alone."""
        self._process.kill()
        self._process.wait()

    def stop(self) -> None:
        """In good order."""
        self._process.terminate()
        self._process.wait(PATIENCE)

    def left_behind(self) -> list[str]:
        """Files that nobody needs any more: halves of originals, what was being read."""
        found = [str(path) for path in self.data.rglob("*.tmp")]
        if not self._database:
            # Those who share a directory leave alone what another may be reading, for a while.
            found += [str(path) for path in (self.data / "reading").glob("*")]
        return found


class Cluster:
    """A Dask scheduler and two workers, which are started again when they end."""

    def __init__(self, folder: Path):
        self._folder, self._port = folder, _free_port()
        self.address = f"tcp://127.0.0.1:{self._port}"
        self._run = self._scheduler()
        self._workers = [self._supervised() for _ in range(2)]

    def _scheduler(self) -> subprocess.Popen[bytes]:
        return self._started(*SCHEDULER, "--port", str(self._port))

    def _started(self, *arguments: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, *arguments],
            cwd=self._folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    def _supervised(self) -> subprocess.Popen[bytes]:
        """A worker that comes back: `dask worker` ends with its scheduler."""
        command = " ".join([sys.executable, *WORKER, self.address])
        return subprocess.Popen(
            ["/bin/sh", "-c", f"while :; do {command}; sleep 0.5; done"],
            cwd=self._folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    def kill_scheduler(self) -> None:
        """Kill it and start another at its address."""
        self._run.kill()
        self._run.wait()
        self._run = self._scheduler()

    def tree(self) -> list[psutil.Process]:
        """The processes of the workers."""
        return [
            child
            for one in self._workers
            for child in psutil.Process(one.pid).children(recursive=True)
            if re.search("python", child.name())
        ]

    def close(self) -> None:
        """End all of it."""
        for one in (*self._workers, self._run):
            with suppress(ProcessLookupError):
                os.killpg(one.pid, signal.SIGKILL)
            one.wait()


def _free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]
