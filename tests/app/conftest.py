"""A service in a temporary data directory, reached through its HTTP interface."""

import csv
import io
import json
import logging
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from dask import config
from distributed import LocalCluster
from fastapi.testclient import TestClient
from ridetune.app.cli import main
from ridetune.app.jobs.dask_connection import CONFIGURATION
from ridetune.app.limits import Limits
from ridetune.app.main import create_app
from ridetune.app.settings import Settings
from ridetune.app.simulators.simulators import Simulators

from .command_line import SHORT
from .jobs.dask_processes import dask_processes
from .jobs.dispatcher_team import team
from .jobs.stand_in_cluster import clusters
from .storage.postgresql_server import on_postgresql, postgresql

__all__ = ["clusters", "dask_processes", "on_postgresql", "postgresql", "team"]

ADDRESS = "http://127.0.0.1:8000"
SAMPLES = Path(__file__).parents[2] / "sample_runs"
PATIENCE = 120.0
"""How long a job may take, s."""


SIMULATORS = Simulators(2)
"""Of all services in this process: each of its own would import the engine anew."""


def open_client(settings: Settings, *, login: bool = False, **options) -> TestClient:
    """A client of a fresh service that takes the kernels as compiled, and lets everybody in unless
    there is to be a `login`; enter it to start.
    """
    settings = replace(settings, login=login)
    app = create_app(settings, simulators=SIMULATORS, warm_up=lambda *_: None)
    return TestClient(app, base_url=ADDRESS, **options)


class Visitor:
    """One session, by its bearer token; paths are relative to the session's."""

    def __init__(self, client: TestClient):
        self.client = client
        made = client.post("/api/sessions")
        assert made.status_code == 201
        client.cookies.clear()
        self.id, self.token = made.json()["id"], made.json()["token"]

    def request(self, method: str, path: str, **options):
        headers = {"Authorization": f"Bearer {self.token}"} | options.pop("headers", {})
        return self.client.request(
            method, f"/api/sessions/{self.id}{path}", headers=headers, **options
        )

    def get(self, path: str = "", **options):
        return self.request("GET", path, **options)

    def post(self, path: str, **options):
        return self.request("POST", path, **options)

    def put(self, path: str, **options):
        return self.request("PUT", path, **options)

    def patch(self, path: str, **options):
        return self.request("PATCH", path, **options)

    def delete(self, path: str = "", **options):
        return self.request("DELETE", path, **options)

    def upload(self, data: bytes, name: str = "run.csv"):
        return self.post("/measurements", files={"file": (name, data)})

    def submit(self, jobs: str, asked: Mapping[str, Any]) -> dict[str, Any]:
        """A job of a kind, such as "sweeps", that the service has taken."""
        reply = self.post(f"/{jobs}", json=asked)
        assert reply.status_code == 202, reply.text
        return reply.json()

    def wait_for(self, jobs: str, job: str, *states: str) -> dict[str, Any]:
        """A job in one of these states, or at its end."""
        deadline = time.monotonic() + PATIENCE
        while True:
            kept = self.get(f"/{jobs}/{job}").json()
            if kept["state"] in (*states, "done", "failed", "cancelled"):
                return kept
            assert time.monotonic() < deadline, kept
            time.sleep(0.05)


class Clock:
    """Seconds since the start of a test."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture(scope="session")
def workers() -> Iterator[str]:
    """Address of the job workers that many services share: to start some takes ten seconds."""
    config.set(CONFIGURATION)
    logging.getLogger("distributed").setLevel(logging.ERROR)
    with LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        dashboard_address=None,
        scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
        silence_logs=False,  # it would silence pytest's handlers, too
    ) as cluster:
        yield cluster.scheduler_address


@pytest.fixture(params=["sqlite", "postgresql"])
def database(request) -> str:
    """What `Store` and `Settings` are told of the database: each that there is, empty."""
    return "" if request.param == "sqlite" else request.getfixturevalue("on_postgresql")


@pytest.fixture
def settings(tmp_path) -> Settings:
    return Settings(data=tmp_path / "data")


@pytest.fixture
def client(settings) -> Iterator[TestClient]:
    with open_client(settings) as client:
        yield client


@pytest.fixture
def visitor(client) -> Visitor:
    return Visitor(client)


@pytest.fixture
def service(settings, clusters) -> Iterator[TestClient]:
    """A client of a service whose cluster is a stand-in."""
    with open_client(settings) as client:
        yield client


@pytest.fixture
def owner(service) -> Visitor:
    return Visitor(service)


@pytest.fixture
def small_limits(tmp_path) -> Settings:
    """A service that refuses early."""
    limits = Limits(
        upload_bytes=20_000,
        body_bytes=10_000,
        sessions=2,
        session_measurements=3,
        session_bytes=5_000_000,
        unfinished_jobs=1,
        simulated_seconds=30.0,
        simulated_steps=20_000,
        identified_samples=20_000,
    )
    return Settings(data=tmp_path / "small", limits=limits)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="session")
def driven(tmp_path_factory):
    """The path of a short noise-free run of the paper's car, with every channel."""
    folder = tmp_path_factory.mktemp("driven")
    (folder / "short.json").write_text(json.dumps(SHORT))
    path = folder / "driven.csv"
    command = ["simulate", "--vehicle", "paper", "--manoeuvre", str(folder / "short.json")]
    assert main([*command, "-o", str(path)]) == 0
    return path


def short_recording(samples: int = 101) -> bytes:
    """A measurement file with all that an identification needs."""
    names = ["time [s]", "chassis.z [mm]", "chassis.a_x [m/s^2]"]
    names += [f"wheel.{corner}.z [mm]" for corner in ("fl", "fr", "rl", "rr")]
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(names)
    for k in range(samples):
        wave = [(k * (3 + column) % 17 - 8) * 0.5 for column in range(len(names) - 1)]
        table.writerow([f"{0.01 * k:.2f}", *wave])
    return text.getvalue().encode()
