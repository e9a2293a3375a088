"""Requests of every shape to a running service, made by schemathesis from its own description.

    python tests/fuzz/interface.py [--minutes M] [--seed N] [--quick]

A service with a throw-away data directory is started, and a session filled with one of everything,
so that ids lead somewhere. A finding, which ends with status 1: a status of 500 or more that is not
a documented 503, a reply that is not as described or has a status that is not, a method that is
taken though it is not described, a body that breaks the description and yet is taken. `--quick`
sends the examples and one request a route, the same ones at any time.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.app.live import LiveService

PATIENCE = 120.0
CHECKS = (
    "not_a_server_error",
    "status_code_conformance",
    "content_type_conformance",
    "response_schema_conformance",
    "response_headers_conformance",
    "negative_data_rejection",
    "unsupported_method",
)
SWEEP = {
    "design": {"kind": "full-factorial", "levels": {"K_F": [15_000, 20_000]}},
    "manoeuvre": "bump",
    "duration": 1,
}


class Filled:
    """A session that holds one of everything; `ids` by kind."""

    def __init__(self, service: LiveService):
        self._client = service.client
        made = self._client.post("/api/sessions").json()
        self._client.cookies.clear()
        self.sid, self.token = made["id"], made["token"]
        while self._client.get("/readyz").status_code != 200:
            time.sleep(0.2)
        measured = self._call("GET", "/measurements")
        self.measurement = measured[0]["id"]
        fit = self._done("identifications", {"runs": [one["id"] for one in measured]})
        self.jobs = {
            "identifications": fit,
            "profiles": self._done("profiles", {"identification": fit, "parameter": "K_F"}),
            "sweeps": self._done("sweeps", SWEEP),
            "validations": self._done("validations", {"identification": fit}),
            "campaigns": self._done("campaigns", {"manoeuvres": ["bump"]}),
        }

    def _call(self, method: str, path: str, body: Any = None) -> Any:
        reply = self._client.request(
            method,
            f"/api/sessions/{self.sid}{path}",
            headers={"Authorization": f"Bearer {self.token}"},
            **({} if body is None else {"json": body}),
        )
        assert reply.status_code < 300, reply.text
        return reply.json()

    def _done(self, jobs: str, body: dict[str, Any]) -> str:
        job, deadline = self._call("POST", f"/{jobs}", body), time.monotonic() + PATIENCE
        while (job := self._call("GET", f"/{jobs}/{job['id']}"))["state"] != "done":
            assert job["state"] in ("queued", "running"), job
            assert time.monotonic() < deadline, job
            time.sleep(0.1)
        return job["id"]

    def settings(self) -> str:
        """Where the ids go, as schemathesis is told; what would delete them is left out."""
        lines = [
            "[parameters]",
            f'sid = "{self.sid}"',
            f'mid = "{self.measurement}"',
        ]
        for jobs, jid in self.jobs.items():
            lines += [
                "[[operations]]",
                f'include-path-regex = "/{jobs}/"',
                f'parameters = {{ jid = "{jid}" }}',
            ]
        for path in ("", "/measurements/{mid}", *(f"/{jobs}/{{jid}}" for jobs in self.jobs)):
            lines += [
                "[[operations]]",
                f'include-name = "DELETE /api/sessions/{{sid}}{path}"',
                "enabled = false",
            ]
        return "\n".join(lines) + "\n"


def run(seconds: float, seed: int, quick: bool) -> int:
    """Status of schemathesis against a fresh service."""
    with tempfile.TemporaryDirectory() as folder, LiveService(Path(folder) / "data") as service:
        filled = Filled(service)
        (Path(folder) / "schemathesis.toml").write_text(filled.settings())
        how = ["--phases", "examples,fuzzing", "--generation-deterministic", "--max-examples", "1"]
        if not quick:
            how = ["--max-time", f"{seconds:g}", "--max-examples", "100000", "--seed", str(seed)]
        return subprocess.run(
            [
                *(sys.executable, "-m", "schemathesis.cli", "run"),
                f"{service.address}/api/openapi.json",
                *("--header", f"Authorization: Bearer {filled.token}"),
                *("--checks", ",".join(CHECKS)),
                *("--suppress-health-check", "all", "--no-color", "--continue-on-failure"),
                *("--warnings", "off", "--request-timeout", "30"),
                *how,
            ],
            cwd=folder,
        ).returncode


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--quick", action="store_true")
    options = parser.parse_args()
    return run(60 * options.minutes, options.seed, options.quick)


if __name__ == "__main__":
    sys.exit(main())
