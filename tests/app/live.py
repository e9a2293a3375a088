"""The service as a process of its own, for what only a real one shows: kills, sockets, streams."""

import re
import subprocess
import sys
import time
from pathlib import Path

import httpx2

PATIENCE = 240.0
"""How long kernels may take to be compiled, s."""

PROGRAM = """
import sys
from pathlib import Path
from ridetune.app.serve import serve
from ridetune.app.settings import Settings

if __name__ == "__main__":
    serve(Settings(data=Path(sys.argv[1]), port=0, login=False))
"""


class LiveService:
    """A running service on a free port; leaving the block kills it."""

    def __init__(self, data: Path):
        self.process = subprocess.Popen(
            [sys.executable, "-u", "-c", PROGRAM, str(data)], stdout=subprocess.PIPE, text=True
        )
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        found = re.search(r"http://[\d.]+:\d+", line)
        assert found, line
        self.address = found.group()
        self.client = httpx2.Client(base_url=self.address, timeout=60.0)

    def ready(self) -> "LiveService":
        """Itself, once the kernels are loaded."""
        deadline = time.monotonic() + PATIENCE
        while self.client.get("/readyz").status_code != 200:
            assert time.monotonic() < deadline
            time.sleep(0.05)
        return self

    def kill(self) -> None:
        """As a power cut would."""
        self.process.kill()
        self.process.wait()

    def __enter__(self) -> "LiveService":
        return self

    def __exit__(self, *_) -> None:
        self.client.close()
        self.kill()
        assert self.process.stdout is not None
        self.process.stdout.close()
