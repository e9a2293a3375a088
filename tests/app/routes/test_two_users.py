"""Two users of one service: whatever address of the other's is tried, there is nothing there.

Every route of the service's own description is walked, so a new one is tried, too.
"""

from dataclasses import dataclass

import pytest
from fastapi.testclient import TestClient
from ridetune.app.addresses import networks
from ridetune.app.settings import Settings
from ridetune.engine.vehicle_file import reference_vehicles, vehicle_to_json
from starlette.websockets import WebSocketDisconnect

from ..conftest import ADDRESS, SAMPLES, Visitor, open_client
from .session_routes import Route, routes

PROXY = "10.0.0.1"
PAPER = vehicle_to_json(reference_vehicles()["paper"])
KINDS = ("identifications", "sweeps", "profiles", "validations", "campaigns")


@pytest.fixture(scope="module")
def client(tmp_path_factory, workers):
    """The proxy's side of a service that takes its word for who it is."""
    settings = Settings(
        data=tmp_path_factory.mktemp("two"),
        cluster=workers,
        proxy_user_header="X-User",
        proxy_addresses=networks(PROXY),
    )
    with open_client(settings, login=True) as inside:
        yield TestClient(inside.app, base_url=ADDRESS, client=(PROXY, 50_000))


class User(Visitor):
    """A session that belongs to a user whom the proxy names, by that word alone."""

    def __init__(self, client, name):
        self.client, self.headers = client, {"X-User": name}
        self.id = client.post("/api/sessions", headers=self.headers).json()["id"]

    def request(self, method, path, **options):
        address = f"/api/sessions/{self.id}{path}"
        return self.client.request(method, address, headers=self.headers, **options)


@dataclass
class World:
    """All that one user has, and the ids of it."""

    owner: User
    values: dict[str, dict[str, str]]

    def of(self, route: Route) -> dict[str, str]:
        """Values of a route's parameters."""
        kind = route.path.split("/")[4] if route.path.count("/") > 3 else ""
        return {"sid": self.owner.id, **self.values.get(kind, {})}

    def ask(self, route: Route, **options):
        """The answer to the owner."""
        headers = self.owner.headers
        return self.owner.client.request(
            route.method, route.filled(self.of(route)), headers=headers, **options
        )

    def seen(self):
        """All that the owner can read."""
        reading = [one for one in routes(self.owner.client.app) if one.method == "GET"]
        answers = [(one.path, self.ask(one, **one.request())) for one in reading]
        return {path: (answer.status_code, answer.content) for path, answer in answers}


@pytest.fixture(scope="module")
def world(client) -> World:
    """Anna's session, with a job of every kind that is done."""
    anna = User(client, "anna")
    file = SAMPLES / "twin/manoeuvre_1.csv"
    run = anna.upload(file.read_bytes(), file.name).json()["id"]
    mapping = anna.get(f"/measurements/{run}/columns").json()["proposed"]
    assert anna.put(f"/measurements/{run}/mapping", json=mapping).status_code == 200
    assert anna.post("/mappings", json={"name": "car 7", "mapping": mapping}).status_code == 201

    def done(kind, **asked):
        job = anna.submit(kind, asked)["id"]
        ended = anna.wait_for(kind, job)
        assert ended["state"] == "done", ended["error"]
        return job

    fit = done("identifications", runs=[run], vehicle=PAPER, free=["K_F", "K_R"])
    design = {"kind": "sobol", "ranges": {"K_F": [15e3, 40e3]}, "cars": 2}
    jobs = {
        "identifications": fit,
        "profiles": done("profiles", identification=fit, parameter="K_F"),
        "sweeps": done("sweeps", manoeuvre="bump", design=design),
        "validations": done("validations", identification=fit),
        "campaigns": done("campaigns", vehicle=PAPER, manoeuvres=["bump"]),
    }
    values = {kind: {"jid": job} for kind, job in jobs.items()}
    values["sweeps"]["form"] = "csv"
    [file, *_] = anna.get(f"/campaigns/{jobs['campaigns']}/files").json()
    values["campaigns"]["name"] = file["name"]
    values |= {"measurements": {"mid": run}, "mappings": {"name": "car%207"}}
    return World(anna, values)


@pytest.fixture
def mine(client):
    """Bert's own session."""
    return User(client, "bert")


def strangers(client, world):
    """Ways to come as somebody else, each a client and what it sends along."""
    store = client.app.state.services.store
    outside = TestClient(client.app, base_url=ADDRESS)
    key = store.keys.add(f"key {len(store.keys.list())}")
    shared, token = store.sessions.create(PAPER, [])
    browser = TestClient(client.app, base_url=ADDRESS)
    browser.cookies.set("ridetune-access-8000", store.browsers.let_in())
    browser.cookies.set(f"ridetune_{shared}", token)
    browser.cookies.set(f"ridetune_{world.owner.id}", token)
    return {
        "nobody": (outside, {}),
        "another user": (client, {"X-User": "bert"}),
        "a user of nearly that name": (client, {"X-User": "Anna"}),
        "a key": (outside, {"Authorization": f"Bearer {key}"}),
        "another session's token": (outside, {"Authorization": f"Bearer {token}"}),
        "another browser": (browser, {}),
    }


def test_the_owner_finds_everything(world):
    """Oracle of all that follows: to the owner no address is that of nothing."""
    lost = [path for path, (status, _) in world.seen().items() if status != 200]
    assert lost == []
    with_jobs = {
        one.path.split("/")[4] for one in routes(world.owner.client.app) if "jid" in one.names
    }
    assert with_jobs == set(KINDS)


def test_every_route_of_anothers_session_is_that_of_nothing(client, world):
    """To whoever comes and with whatever; the same answer as for a session that never was."""
    before, wrong = world.seen(), []
    never = {"sid": "0123456789abcdef"}
    for who, (visitor, headers) in strangers(client, world).items():
        for route in routes(client.app):
            options = {"headers": headers, **route.request()}
            values = world.of(route)
            told, nothing = (
                visitor.request(route.method, route.filled(values | other), **options)
                for other in ({}, never)
            )
            if told.status_code != 404 or told.content != nothing.content:
                wrong.append((who, route.method, route.path, told.status_code))
    assert wrong == []
    assert world.seen() == before


def test_ids_of_anothers_are_those_of_nothing_in_ones_own_session(client, world, mine):
    """Of measurements, jobs, files and mappings."""
    before, kept, wrong = world.seen(), mine.get().json(), []
    for route in routes(client.app):
        if len(route.names) > 1:
            address = route.filled(world.of(route) | {"sid": mine.id})
            told = client.request(route.method, address, headers=mine.headers, **route.request())
            if told.status_code != 404:
                wrong.append((route.method, route.path, told.status_code, told.text))
    assert wrong == []
    assert world.seen() == before
    assert mine.get().json() == kept


def test_nothing_is_made_of_what_is_anothers(world, mine):
    """A request that names a measurement or a fit of somebody else's."""
    run, fit = world.values["measurements"]["mid"], world.values["identifications"]["jid"]
    design = {"kind": "sobol", "ranges": {"K_F": [15e3, 40e3]}, "cars": 2}
    for path, asked in (
        ("/simulations", {"rims": {"measurement": run}}),
        ("/simulations", {"posts": {"measurement": run}}),
        ("/simulations", {"bands": {"identification": fit, "method": "linear"}}),
        ("/identifications", {"runs": [run]}),
        ("/sweeps", {"manoeuvre": None, "rims": {"measurement": run}, "design": design}),
        ("/profiles", {"identification": fit, "parameter": "K_F"}),
        ("/validations", {"identification": fit}),
        ("/advice", {"identification": fit}),
    ):
        reply = mine.post(path, json=asked)
        assert (path, reply.status_code) == (path, 404), reply.text
    for kind in KINDS:
        assert mine.get(f"/{kind}").json() == []


def test_pages_and_websockets_of_anothers_are_not_there(client, world):
    for who, (visitor, headers) in strangers(client, world).items():
        for path in ("/", "/viewer/"):
            page = visitor.get(f"/s/{world.owner.id}{path}", headers=headers)
            assert (who, page.status_code) == (who, 404)
            assert PAPER["name"] not in page.text
        for path in (f"/s/{world.owner.id}/viewer", f"/api/sessions/{world.owner.id}/simulations"):
            with (
                pytest.raises(WebSocketDisconnect) as refused,
                visitor.websocket_connect(path, headers={"Origin": ADDRESS, **headers}),
            ):
                pass
            assert refused.value.code == 1008
    assert world.owner.id not in client.app.state.services.viewers._viewers
