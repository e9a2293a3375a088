"""Who was let in a moment ago is not looked up anew; others are, and what is taken away ends."""

from itertools import count

import pytest
from ridetune.app.errors import NotFound
from ridetune.app.limits import Limits
from ridetune.app.settings import Settings
from ridetune.app.storage.key_store import KeyStore
from ridetune.app.storage.recent_answers import SECONDS, RecentAnswers
from ridetune.app.storage.store import Store, database_beside

from ..conftest import Visitor, open_client


def test_an_answer_is_remembered_for_a_moment(clock):
    answers = RecentAnswers(clock=clock)
    assert answers.recall("a") is None
    assert answers.ask("a", lambda: "anna") == "anna"
    clock.now = SECONDS - 0.001
    assert (answers.recall("a"), answers.recall("b")) == ("anna", None)
    clock.now = SECONDS
    assert answers.recall("a") is None


def test_it_is_as_old_as_its_question(clock):
    """What another process takes away while it is looked up ends within the moment."""

    def look():
        clock.now += SECONDS
        return "anna"

    answers = RecentAnswers(clock=clock)
    answers.ask("a", look)
    assert answers.recall("a") is None


def test_a_refusal_is_not_remembered(clock):
    answers = RecentAnswers(clock=clock)

    def refuse():
        raise NotFound("No.")

    with pytest.raises(NotFound):
        answers.ask("a", refuse)
    assert answers.recall("a") is None


def test_what_is_taken_away_while_it_is_looked_up_is_not_remembered(clock):
    answers = RecentAnswers(clock=clock)

    def look():
        answers.forget()
        return "anna"

    assert answers.ask("a", look) == "anna"
    assert answers.recall("a") is None


def test_only_so_many_are_remembered_and_none_longer_than_need_be(clock):
    answers = RecentAnswers(most=2, clock=clock)
    for question in "abc":
        answers.ask(question, lambda: "")
    assert [answers.recall(question) for question in "abc"] == [None, "", ""]
    clock.now = SECONDS
    answers.ask("d", lambda: "")
    assert len(answers._kept) == 1


@pytest.fixture
def looked(monkeypatch):
    """What the database was asked of sessions."""
    asked, usual = [], Store.__init__

    def counted(store, *arguments):
        usual(store, *arguments)
        opens = store.owners.opens

        def noted(session, **who):
            asked.append(session)
            return opens(session, **who)

        monkeypatch.setattr(store.owners, "opens", noted)

    monkeypatch.setattr(Store, "__init__", counted)
    return asked


def test_a_request_with_a_body_looks_its_session_up_once(looked, client, visitor):
    """Its reader and its handler ask, and more than a moment may lie between them."""
    client.app.state.services.store.answers._clock = count(step=SECONDS).__next__
    for _ in range(2):
        assert visitor.patch("/setup", json={"starts": 2}).status_code == 200
    assert looked == [visitor.id] * 2


def test_many_requests_in_a_moment_look_it_up_once(looked, client, visitor, clock):
    client.app.state.services.store.answers._clock = clock
    for now in (0.0, 0.0, SECONDS / 2, SECONDS, SECONDS):
        clock.now = now
        assert visitor.get("/vehicle").status_code == 200
    assert looked == [visitor.id] * 2


def test_who_brings_something_else_is_looked_up(client, visitor, clock):
    """Nobody gets in behind one who may."""
    client.app.state.services.store.answers._clock = clock
    other = Visitor(client)
    assert visitor.get("/vehicle").status_code == 200
    for token in (other.token, visitor.token + "x", ""):
        brought = {"Authorization": f"Bearer {token}"}
        assert visitor.get("/vehicle", headers=brought).status_code == 404
    assert client.get(f"/api/sessions/{other.id}/vehicle").status_code == 404


def test_a_deleted_session_opens_no_more(client, visitor, clock):
    """Though the clock stands still; nor can it be changed by one who was let in before."""
    client.app.state.services.store.answers._clock = clock
    car = visitor.get("/vehicle").json()
    assert visitor.delete().status_code == 204
    assert visitor.get("/vehicle").status_code == 404
    assert visitor.put("/vehicle", json=car).status_code == 404


def test_a_key_that_another_process_removes_is_worth_nothing_in_a_moment(tmp_path, clock):
    """Oracle: the documents, which say a second."""
    with open_client(Settings(data=tmp_path), login=True) as client:
        store = client.app.state.services.store
        store.answers._clock = clock
        rig = {"Authorization": f"Bearer {store.keys.add('rig')}"}
        sid = client.post("/api/sessions", headers=rig).json()["id"]
        paths = ("/api/parameters", f"/api/sessions/{sid}/vehicle")
        assert [client.get(path, headers=rig).status_code for path in paths] == [200, 200]
        beside = database_beside(tmp_path, "")
        KeyStore(beside).remove("rig")
        beside.close()
        clock.now = 1.0
        assert [client.get(path, headers=rig).status_code for path in paths] == [401, 401]


def test_a_car_is_not_kept_of_a_session_that_is_gone(tmp_path):
    """Who was let in when it was deleted is told so."""
    store = Store(tmp_path, Limits())
    session, _ = store.sessions.create({"name": "a car"}, [])
    store.sessions.delete(session)
    with pytest.raises(NotFound, match="deleted"):
        store.sessions.set_vehicle(session, {"name": "another"})
    store.close()
