"""What the service says of its health: part by part, at once whatever hangs, and not too often."""

import asyncio
import socket
import threading
from contextlib import contextmanager

import pytest
from ridetune.app.settings import Settings
from ridetune.app.web import readiness
from ridetune.app.web.draining import Draining
from ridetune.app.web.readiness import Readiness
from ridetune.app.work.warmup import WarmUp

from ..conftest import open_client
from ..loop import in_a_loop


class Base:
    """A database that counts how often it is asked, and answers once it may."""

    def __init__(self, may=True):
        self.asked, self.may = 0, threading.Event()
        if may:
            self.may.set()

    @contextmanager
    def reading(self):
        self.asked += 1
        assert self.may.wait(30)
        yield self

    def execute(self, _):
        return self

    def all(self):
        return []


@pytest.fixture
def warm() -> WarmUp:
    warmup = WarmUp(lambda warmup: None)
    warmup.start()
    assert warmup.wait()
    return warmup


def states(parts):
    return {name: part.state for name, part in parts.items()}


def test_the_service_runs_and_every_part_is_ready(client):
    assert client.get("/healthz").json() == {"state": "running"}
    reply = client.get("/readyz")
    assert reply.status_code == 200
    told = reply.json()
    assert told["state"] == "ready"
    assert list(told["parts"]) == ["service", "kernels", "database", "data_directory"]
    assert {part["state"] for part in told["parts"].values()} == {"ready"}


def test_what_is_not_ready_is_told_by_its_name_and_not_where_it_is(tmp_path):
    """Nothing listens at port 9 (RFC 863's, not in use); the answer names neither it nor a path."""
    settings = Settings(data=tmp_path / "data", cluster="tls://127.0.0.1:9")
    with open_client(settings) as client:
        settings.data.rename(tmp_path / "gone")
        reply = client.get("/readyz")
        (tmp_path / "gone").rename(settings.data)
    assert reply.status_code == 503
    parts = reply.json()["parts"]
    told = {name: part["state"] for name, part in parts.items() if part["state"] != "ready"}
    assert told == {"data_directory": "failed", "cluster": "degraded"}
    assert reply.json()["message"] == parts["data_directory"]["message"]
    assert "127.0.0.1" not in reply.text
    assert str(tmp_path) not in reply.text


def test_workers_out_of_reach_keep_no_request_away(tmp_path):
    """Only jobs wait for them; a balancer that took every service out would stop the rest, too."""
    settings = Settings(data=tmp_path / "data", cluster="tls://127.0.0.1:9")
    with open_client(settings) as client:
        reply = client.get("/readyz")
    told = reply.json()
    assert (reply.status_code, told["state"]) == (200, "degraded")
    assert told["message"] == told["parts"]["cluster"]["message"]


def test_a_service_that_is_about_to_end_is_not_ready(client):
    client.app.state.draining.begin()
    reply = client.get("/readyz")
    assert (reply.status_code, reply.json()["state"]) == (503, "draining")
    assert client.get("/healthz").status_code == 200


@pytest.mark.parametrize("form", ["tcp://127.0.0.1:{}", "tls://localhost:{}", "127.0.0.1:{}"])
def test_a_scheduler_that_listens_is_reached(tmp_path, warm, form):
    with socket.create_server(("127.0.0.1", 0)) as scheduler:
        address = form.format(scheduler.getsockname()[1])
        ready = Readiness(Draining(), warm, Base(), tmp_path, address)
        assert states(in_a_loop(ready.parts))["cluster"] == "ready"


def test_a_scheduler_that_refuses_the_service_is_not_ready(tmp_path, warm):
    with socket.create_server(("127.0.0.1", 0)) as scheduler:
        address = f"tls://127.0.0.1:{scheduler.getsockname()[1]}"
        ready = Readiness(Draining(), warm, Base(), tmp_path, address, lambda: True)
        assert states(in_a_loop(ready.parts))["cluster"] == "degraded"


def test_it_is_looked_at_once_a_second(tmp_path, warm):
    now, base = [0.0], Base()
    ready = Readiness(Draining(), warm, base, tmp_path, "", clock=lambda: now[0])

    async def asked():
        counts = []
        for now[0] in (0.0, 0.5, 0.99, 1.0, 1.5):
            await asyncio.gather(*(ready.parts() for _ in range(5)))
            counts.append(base.asked)
        return counts

    assert in_a_loop(asked) == [1, 1, 1, 2, 2]


def test_a_database_that_hangs_is_told_and_not_asked_again_meanwhile(tmp_path, warm, monkeypatch):
    monkeypatch.setattr(readiness, "PATIENCE", 0.02)
    monkeypatch.setattr(readiness, "KEPT_FOR", 0.0)
    base = Base(may=False)
    ready = Readiness(Draining(), warm, base, tmp_path, "")

    async def twice():
        first, second = await ready.parts(), await ready.parts()
        asked = base.asked
        base.may.set()
        while not (last := await ready.parts())["database"].ready:
            await asyncio.sleep(0)
        return states(first), states(second), asked, states(last)

    first, second, asked, last = in_a_loop(twice)
    assert first["database"] == second["database"] == "failed"
    assert (first["data_directory"], asked, last["database"]) == ("ready", 1, "ready")
