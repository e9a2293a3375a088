"""What sessions are called: the names of their visitors, and those they get by themselves."""

import pytest
from fastapi.testclient import TestClient
from ridetune.app.errors import Busy
from ridetune.app.limits import Limits
from ridetune.app.session_name import free_name, on_one_line
from ridetune.app.settings import Settings
from ridetune.app.storage import session_store
from ridetune.app.storage.store import Store

from ..conftest import ADDRESS, Visitor, open_client

CAR = {"name": "a car"}
NAMES = ["Car 7", "Wagen 7 – Winterreifen", "م\u200cم", "👩\u200d🔧", "x" * 80, "a\u00a0b"]
NO_NAMES = ["", " \t\n", "x" * 81, "a\nb", "a\0b", "\x1b[2J", "a\u2028b", "a\u202eb", "\u200b"]


@pytest.fixture
def named(client):
    """A session with a name of its visitor's choice, and the browser that holds its token."""
    made = client.post("/api/sessions", json={"name": " Car 7\t"})
    assert made.status_code == 201
    assert made.json()["name"] == "Car 7"
    return made.json()["id"]


@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_kept_as_it_is_written_less_the_space_around_it(visitor, name):
    told = visitor.patch("", json={"name": f"\u00a0 {name} \n"}).json()
    assert list(told) == ["id", "name", "created", "seen", "measurement_count"]
    assert (told["id"], told["name"], told["measurement_count"]) == (visitor.id, name, 2)
    mine = {"Authorization": f"Bearer {visitor.token}"}
    assert visitor.client.get("/api/sessions", headers=mine).json() == [told]
    assert visitor.get().json()["name"] == name


@pytest.mark.parametrize("body", [*({"name": name} for name in NO_NAMES), {"name": 7}, {}])
def test_what_is_no_name_is_refused_and_the_former_stays(visitor, body):
    reply = visitor.patch("", json=body)
    assert (reply.status_code, reply.json()["field"]) == (422, "name")
    if isinstance(body.get("name"), str):
        assert reply.json()["detail"] == (
            "The field name is refused: give 1 to 80 characters without control characters."
        )
    assert visitor.get().json()["name"] == "Project"
    if body:
        refused = visitor.client.post("/api/sessions", json=body)
        assert refused.json()["detail"] == reply.json()["detail"]


@pytest.mark.parametrize(
    ("body", "status"), [(b"{", 400), (b"[]", 422), (b'{"nmae": "x"}', 422), (b" ", 400)]
)
def test_a_fresh_session_is_made_of_no_body_or_a_whole_one(client, body, status):
    sent = {"Content-Type": "application/json"}
    before = len(client.get("/api/sessions").json())
    reply = client.post("/api/sessions", content=body, headers=sent)
    assert reply.status_code == status
    assert reply.json()["detail"].endswith(".")
    assert client.post("/api/sessions", content=b"", headers=sent).status_code == 201
    assert client.post("/api/sessions", content=b'{"name": "x"}').status_code == 415
    assert client.post("/api/sessions").status_code == 201
    assert len(client.get("/api/sessions").json()) == before + 2


def test_without_a_name_a_session_gets_one_that_the_visitors_others_do_not_have(client, named):
    """As the start page does for who has none."""
    made = [client.post("/api/sessions", json=body).json() for body in (None, {}, {"name": None})]
    assert [one["name"] for one in made] == ["Project", "Project 2", "Project 3"]
    client.delete(f"/api/sessions/{made[1]['id']}")
    assert client.post("/api/sessions").json()["name"] == "Project 2"
    client.cookies.clear()
    client.get("/")
    assert [one["name"] for one in client.get("/api/sessions").json()] == ["Project"]


def test_names_that_are_taken_are_passed_over():
    assert free_name([]) == free_name(["Project 2", "project"]) == "Project"
    assert free_name(["Project", "Project 2", "Project 4"]) == "Project 3"
    assert on_one_line("x" * 80 + " ") == "x" * 80


def test_nobody_names_anothers_session(client, named):
    stranger = Visitor(client)
    reply = stranger.client.patch(
        f"/api/sessions/{named}",
        json={"name": "mine"},
        headers={"Authorization": f"Bearer {stranger.token}"},
    )
    assert (reply.status_code, reply.json()["code"]) == (404, "not-found")
    assert client.app.state.services.store.sessions.get(named).name == "Car 7"


def test_the_session_that_was_opened_last_stands_first_and_is_led_to(client):
    """However little later than another; HEAD opens nothing."""
    made = [client.post("/api/sessions").json()["id"] for _ in "abc"]
    listed = lambda: [one["id"] for one in client.get("/api/sessions").json()]  # noqa: E731
    assert listed() == made[::-1]
    client.get(f"/s/{made[1]}/")
    client.head(f"/s/{made[0]}/")
    assert listed() == [made[1], made[2], made[0]]
    assert client.get("/", follow_redirects=False).headers["location"] == f"/s/{made[1]}/"


def test_a_session_that_was_named_is_not_let_go_of_to_make_room(tmp_path, database, monkeypatch):
    store = Store(tmp_path, Limits(user_sessions=3), database)
    monkeypatch.setattr(session_store, "UNUSED_AFTER", -1.0)
    make = lambda **told: store.sessions.create(CAR, [], "user:anna", **told)[0]  # noqa: E731
    kept = [make(name="Car 7", used=True), make()]
    store.sessions.rename(kept[1], "Car 8")
    for _ in "ab":
        kept[2:] = [make()]
    names = {one.id: one.name for one in store.owners.sessions(user="user:anna", tokens=[])}
    assert names == dict(zip(kept, ("Car 7", "Car 8", "Project"), strict=True))
    store.sessions.rename(kept[2], "Car 9")
    with pytest.raises(Busy, match="3 sessions"):
        make()
    store.close()


def test_a_browser_begins_no_more_sessions_than_it_can_hold_tokens_of(tmp_path):
    """It would forget some; oracle: there is room again for one that was deleted."""
    settings = Settings(data=tmp_path, limits=Limits(browser_sessions=2))
    with open_client(settings) as client:
        first, _ = (client.post("/api/sessions").json()["id"] for _ in "ab")
        reply = client.post("/api/sessions")
        assert reply.status_code == 429
        assert "2 projects" in reply.json()["detail"]
        assert TestClient(client.app, base_url=ADDRESS).post("/api/sessions").status_code == 201
        client.delete(f"/api/sessions/{first}")
        assert client.post("/api/sessions").status_code == 201
