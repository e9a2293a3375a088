"""What the service counts, read by Prometheus' own parser, and who may read it."""

import re
import time
from dataclasses import replace
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from prometheus_client.parser import text_string_to_metric_families
from ridetune.app.errors import Unavailable
from ridetune.app.main import create_app
from ridetune.app.settings import Settings
from ridetune.app.storage.tables import jobs
from ridetune.app.web.observed import METHODS
from sqlalchemy import text, update
from sqlalchemy.exc import OperationalError

from ..conftest import ADDRESS, Visitor, short_recording
from ..simulators import simulator_work
from ..viewer.test_viewer import open_socket

HERE = ("127.0.0.1", 50000)
ELSEWHERE = ("192.0.2.7", 50000)
TABLE = Path(__file__).parents[3] / "docs" / "operations.md"


def opened(settings: Settings, peer=HERE) -> TestClient:
    settings = replace(settings, login=bool(settings.token))
    app = create_app(settings, warm_up=lambda *_: None)
    return TestClient(app, base_url=ADDRESS, client=peer)


@pytest.fixture
def client(settings):
    with opened(settings) as client:
        yield client


def samples(client) -> dict[tuple[str, frozenset], float]:
    """Every sample by its name and labels."""
    reply = client.get("/metrics")
    assert reply.status_code == 200
    families = text_string_to_metric_families(reply.text)
    return {
        (sample.name, frozenset(sample.labels.items())): sample.value
        for family in families
        for sample in family.samples
    }


def value(found, name, **labels):
    return found.get((f"ridetune_{name}", frozenset(labels.items())))


def test_requests_are_counted_by_template_and_status(client):
    visitor = Visitor(client)
    for _ in range(3):
        visitor.get("/vehicle")
    client.get("/api/sessions/0123456789abcdef/vehicle")
    found = samples(client)
    route = "/api/sessions/{sid}/vehicle"
    counted = "http_request_seconds_count"
    assert value(found, counted, method="GET", route=route, status="200") == 3
    assert value(found, counted, method="GET", route=route, status="404") == 1
    assert value(found, "sessions") == 1


def test_whatever_callers_ask_for_makes_no_more_labels(client):
    """Routes are the application's, methods are HTTP's."""
    for number in range(20):
        client.get(f"/nothing/{number}")
        client.get(f"/api/sessions/{number}/vehicle?x={number}")
        client.get(f"/static/{number}.js")
        client.request(f"METHOD{number}", "/healthz")
    templates = {getattr(route, "path", None) for route in client.app.routes}
    templates |= {path for path in client.app.openapi()["paths"]} | {"unknown", "/static"}
    labels = [dict(labels) for name, labels in samples(client) if "http_request" in name]
    assert {told["route"] for told in labels} <= templates
    assert {told["method"] for told in labels} <= METHODS | {"other"}


def test_uploads_are_bytes_received(client):
    visitor = Visitor(client)
    data = short_recording()
    assert visitor.upload(data).status_code == 201
    received = value(
        samples(client),
        "http_received_bytes_total",
        route="/api/sessions/{sid}/measurements",
    )
    assert len(data) < received < len(data) + 1000


def test_jobs_are_counted_by_kind_and_state_with_what_they_lost(client):
    visitor = Visitor(client)
    kept = client.app.state.services.store
    ids = [kept.jobs.add(visitor.id, "sweep", {"asked": ""}, None)[0].id for _ in range(3)]
    with kept.database.writing() as connection:
        begun = update(jobs).where(jobs.c.id == ids[0])
        connection.execute(begun.values(state="running", attempts=2))
        ended = update(jobs).where(jobs.c.id != ids[0])
        connection.execute(ended.values(state="done"))
    found = samples(client)
    assert value(found, "jobs", kind="sweep", state="running") == 1
    assert value(found, "jobs", kind="sweep", state="done") == 2
    assert value(found, "lost_attempts", kind="sweep") == 2


def test_work_of_the_pools_is_timed(client):
    Visitor(client).upload(short_recording())
    found = samples(client)
    assert value(found, "work_seconds_count", pool="readers") >= 1
    assert value(found, "work_running", pool="readers") == 0
    assert value(found, "work_waiting", pool="interactive") == 0


def test_websockets_are_counted_while_they_are_open(client):
    visitor = Visitor(client)
    before = value(samples(client), "websockets")
    with open_socket(client, visitor):
        during = value(samples(client), "websockets")
    assert (before, during) == (0, 1)
    deadline = time.monotonic() + 30
    while value(found := samples(client), "websockets"):
        assert time.monotonic() < deadline
    assert value(found, "viewers") == 1


def test_statements_that_fail_are_counted_and_what_is_lacking_is_left_out(client, caplog):
    database = client.app.state.services.store.database
    with pytest.raises(OperationalError), database.reading() as connection:
        connection.execute(text("select nothing from nowhere"))
    found = samples(client)
    assert value(found, "database_errors_total") == 1
    with database.writing() as connection:
        connection.execute(text("alter table sessions rename to gone"))
    found = samples(client)
    assert value(found, "sessions") is None
    assert value(found, "workers") == 0
    assert "could not be looked up" in caplog.text


def test_simulators_are_counted_and_those_that_were_lost(client):
    """Work that ends its process is tried twice, hence loses two."""
    lost = value(samples(client), "simulators_lost_total")
    simulators = client.app.state.services.simulators
    with pytest.raises(Unavailable):
        simulators.run("a", simulator_work.killed)
    simulators.run("a", simulator_work.process)
    found = samples(client)
    assert value(found, "simulators_lost_total") == lost + 2
    assert value(found, "simulators") == simulators.count() > 0


def test_two_applications_count_apart(tmp_path):
    with opened(Settings(data=tmp_path / "a")) as one, opened(Settings(data=tmp_path / "b")) as two:
        Visitor(one)
        assert value(samples(one), "sessions") == 1
        assert value(samples(two), "sessions") == 0


@pytest.mark.parametrize(
    ("peer", "headers", "status"),
    [
        (HERE, {}, 200),
        (("::1", 1), {}, 200),
        (HERE, {"X-Forwarded-For": "192.0.2.7"}, 403),
        (HERE, {"Forwarded": "for=127.0.0.1"}, 403),
        (ELSEWHERE, {}, 403),
        (ELSEWHERE, {"Authorization": "Bearer wrong"}, 403),
        (ELSEWHERE, {"Authorization": "Bearer secret"}, 200),
    ],
)
def test_they_are_for_this_machine_or_with_the_token(tmp_path, peer, headers, status):
    with opened(Settings(data=tmp_path / "data", token="secret"), peer) as client:
        assert client.get("/metrics", headers=headers).status_code == status


def test_without_a_token_nobody_else_gets_them(settings):
    with opened(settings, ELSEWHERE) as client:
        assert client.get("/metrics").status_code == 403


def test_the_table_has_every_metric_of_ours(client):
    """By the names of the samples, a histogram's without the suffixes of its parts."""
    Visitor(client).upload(short_recording())
    rows = re.findall(r"^\| (`.+?`) \| (?:gauge|counter|histogram)", TABLE.read_text(), re.M)
    told = {name for row in rows for name in re.findall(r"`(\w+)`", row)}
    families = text_string_to_metric_families(client.get("/metrics").text)
    ours = {
        family.name.removeprefix("ridetune_") + ("_total" if family.type == "counter" else "")
        for family in families
        if family.name.startswith("ridetune_")
    }
    ours = {"build_info" if name == "build" else name for name in ours}
    assert {name for name in ours if not name.endswith("_created")} == told
