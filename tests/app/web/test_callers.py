"""How much one caller may ask for in a time, by a clock that the tests move."""

import pytest
from fastapi.testclient import TestClient
from ridetune.app.errors import Busy
from ridetune.app.limits import Limits
from ridetune.app.settings import Settings
from ridetune.app.web.buckets import Buckets
from ridetune.app.web.callers import Callers, caller_of
from starlette.requests import Request

from ..conftest import ADDRESS, Visitor, open_client

SIMULATION = {"manoeuvre": "bump", "duration": 2.0}


def test_a_bucket_gives_its_burst_and_then_its_rate(clock):
    buckets = Buckets(2.0, 3.0, clock=clock)
    assert [buckets.take("a") for _ in range(4)] == [0, 0, 0, 0.5]
    clock.now = 0.5
    assert [buckets.take("a"), buckets.take("a")] == [0, 0.5]
    clock.now = 1000.0
    assert [buckets.take("a") for _ in range(4)] == [0, 0, 0, 0.5]


def test_who_is_refused_loses_nothing(clock):
    buckets = Buckets(1.0, 10.0, clock=clock)
    assert buckets.take("a", 8) == 0
    assert [buckets.take("a", 5), buckets.take("a", 2)] == [3, 0]


def test_more_than_a_bucket_takes_a_whole_one(clock):
    buckets = Buckets(1.0, 10.0, clock=clock)
    assert buckets.take("a", 50) == 0
    assert buckets.take("a", 50) == 10


def test_only_so_many_buckets_are_kept(clock):
    """The one longest unused is forgotten, hence full again."""
    buckets = Buckets(1.0, 1.0, kept=2, clock=clock)
    for key in ("a", "b", "a", "c"):
        buckets.take(key)
    assert len(buckets._levels) == 2
    assert [buckets.take("a"), buckets.take("b")] == [1, 0]


def test_sessions_are_opened_so_many_a_minute(clock):
    callers = Callers(Limits(new_sessions=2), clock)
    callers.open_session("a")
    callers.open_session("a")
    with pytest.raises(Busy, match="30 s") as refused:
        callers.open_session("a")
    assert refused.value.headers == {"Retry-After": "30"}
    callers.open_session("b")
    clock.now = 30.0
    callers.open_session("a")


@pytest.mark.parametrize(
    ("host", "caller"),
    [
        ("192.0.2.7", "192.0.2.7"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("2001:db8:1:2:ffff::1", "2001:db8:1:2::/64"),
    ],
)
def test_a_caller_is_an_address_or_an_ipv6_site(host, caller):
    assert caller_of(Request({"type": "http", "client": (host, 1), "headers": []})) == caller


def test_an_address_that_floods_is_refused_and_others_are_not(tmp_path):
    settings = Settings(data=tmp_path / "data", limits=Limits(new_sessions=2))
    with open_client(settings) as client:
        for _ in range(2):
            Visitor(client)
        for reply in (client.post("/api/sessions"), client.get("/", follow_redirects=False)):
            assert (reply.status_code, reply.json()["code"]) == (429, "busy")
            assert 0 < int(reply.headers["retry-after"]) <= 30
        other = TestClient(client.app, base_url=ADDRESS, client=("192.0.2.7", 1))
        assert other.post("/api/sessions").status_code == 201


def test_a_session_has_its_simulated_seconds(tmp_path):
    """Of 5 s a simulation of 2 s takes what it lasts, and one at an eighth of the usual step as
    much as eight.
    """
    limits = Limits(session_simulated_seconds=5)
    with open_client(Settings(data=tmp_path / "data", limits=limits)) as client:
        visitor, other = Visitor(client), Visitor(client)
        replies = [visitor.post("/simulations", json=SIMULATION) for _ in range(3)]
        assert [reply.status_code for reply in replies] == [200, 200, 429]
        assert "simulated seconds" in replies[2].json()["detail"]
        assert 600 < int(replies[2].headers["retry-after"]) <= 720
        fine = SIMULATION | {"duration": 0.7, "step": 0.0003125}
        replies = [other.post("/simulations", json=fine) for _ in range(2)]
        assert [reply.status_code for reply in replies] == [200, 429]


def test_simulated_seconds_come_back_within_the_hour(clock):
    callers = Callers(Limits(session_simulated_seconds=3600), clock)
    callers.simulating("a", None)(3600)
    with pytest.raises(Busy, match="10 minutes"):
        callers.simulating("a", None)(600)
    clock.now = 600.0
    callers.simulating("a", None)(600)


def test_a_user_has_simulated_seconds_in_all_sessions_together(clock):
    """Another user, and who is not known by name, has as many as ever."""
    callers = Callers(Limits(user_simulated_seconds=3600), clock)
    callers.simulating("a", "key:rig")(1800)
    callers.simulating("b", "key:rig")(1800)
    with pytest.raises(Busy, match="all your sessions .* in 30 minutes") as refused:
        callers.simulating("c", "key:rig")(1800)
    assert refused.value.headers == {"Retry-After": "1800"}
    callers.simulating("c", "key:bench")(1800)
    callers.simulating("c", None)(1800)
    clock.now = 1800.0
    callers.simulating("a", "key:rig")(1800)


def test_who_is_refused_as_a_user_loses_nothing_of_the_session(clock):
    callers = Callers(Limits(session_simulated_seconds=100, user_simulated_seconds=60), clock)
    callers.simulating("a", "key:rig")(60)
    with pytest.raises(Busy, match="all your sessions"):
        callers.simulating("b", "key:rig")(60)
    callers.simulating("b", None)(100)


def test_work_that_is_done_again_is_taken_once(clock):
    callers = Callers(Limits(session_simulated_seconds=100), clock)
    take = callers.simulating("a", None)
    take(60)
    take(60)
    callers.simulating("a", None)(40)
    with pytest.raises(Busy):
        callers.simulating("a", None)(1)


def test_the_sessions_of_a_key_share_its_simulated_seconds(tmp_path):
    """Also where it is remembered who calls."""
    limits = Limits(user_simulated_seconds=5)
    with open_client(Settings(data=tmp_path / "data", limits=limits), login=True) as client:
        keys = client.app.state.services.store.keys
        rig, bench = ({"Authorization": f"Bearer {keys.add(name)}"} for name in ("rig", "bench"))

        def simulate(headers):
            sid = client.post("/api/sessions", headers=headers).json()["id"]
            address = f"/api/sessions/{sid}/simulations"
            return [client.post(address, json=SIMULATION, headers=headers) for _ in range(2)]

        replies = [*simulate(rig), *simulate(rig), *simulate(bench)]
        assert [reply.status_code for reply in replies] == [200, 200, 429, 429, 200, 200]
        assert 600 < int(replies[2].headers["retry-after"]) <= 720


def test_a_user_keeps_so_many_sessions(tmp_path):
    limits = Limits(user_sessions=2)
    with open_client(Settings(data=tmp_path / "data", limits=limits), login=True) as client:
        keys = client.app.state.services.store.keys
        rig, bench = ({"Authorization": f"Bearer {keys.add(name)}"} for name in ("rig", "bench"))
        replies = [client.post("/api/sessions", headers=rig) for _ in range(3)]
        assert [reply.status_code for reply in replies] == [201, 201, 429]
        assert "already keep 2 sessions; delete one" in replies[2].json()["detail"]
        assert client.post("/api/sessions", headers=bench).status_code == 201
        gone = f"/api/sessions/{replies[0].json()['id']}"
        assert client.delete(gone, headers=rig).status_code == 204
        assert client.post("/api/sessions", headers=rig).status_code == 201
