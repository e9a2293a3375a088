"""Links, browsers, keys and owners as they are kept: what lets in, how long, and by whose word."""

import pytest
from ridetune.app.errors import Busy, Conflict, InvalidRequest, NotFound
from ridetune.app.limits import Limits
from ridetune.app.storage import browser_store, key_store, session_store
from ridetune.app.storage.browser_store import BROWSER_SECONDS, LINK_SECONDS
from ridetune.app.storage.secret import hashed
from ridetune.app.storage.store import Store, database_beside

CAR = {"name": "a car"}


@pytest.fixture
def store(tmp_path, database):
    store = Store(tmp_path, Limits(), database)
    yield store
    store.close()


@pytest.fixture
def clock(monkeypatch):
    """The time of the stores, to be set forward."""

    class Clock:
        now = 1e9

        def time(self):
            return self.now

    clock = Clock()
    monkeypatch.setattr(browser_store, "time", clock)
    monkeypatch.setattr(key_store, "time", clock)
    return clock


def test_a_link_is_good_once(store):
    link = store.browsers.make_link()
    assert [store.browsers.use_link(link) for _ in range(2)] == [True, False]
    assert not store.browsers.use_link("guessed")


def test_a_link_is_good_for_a_day(store, clock):
    early, late = store.browsers.make_link(), store.browsers.make_link()
    clock.now += LINK_SECONDS - 1
    assert store.browsers.use_link(early)
    clock.now += 2
    assert not store.browsers.use_link(late)


def test_a_browser_that_comes_back_stays_let_in(store, clock):
    """Each time for as long again, over restarts; one that stays away has to be let in anew."""
    browser = store.browsers.let_in()
    for _ in range(3):
        clock.now += BROWSER_SECONDS - 1
        assert store.browsers.knows(browser)
    clock.now += BROWSER_SECONDS + 1
    assert not store.browsers.knows(browser)
    assert not store.browsers.knows("guessed")


def test_browsers_are_listed_and_ended_by_their_ids(store, clock):
    one = store.browsers.let_in()
    clock.now += 60
    other = store.browsers.let_in("sesame")
    clock.now += 7200
    assert store.browsers.knows(other, "sesame")
    [first, second] = store.browsers.list()
    assert (first.by_token, first.created, first.came) == (False, 1e9, 1e9)
    assert (second.by_token, second.created, second.came) == (True, 1e9 + 60, clock.now)
    assert first.id not in one
    store.browsers.remove([first.id])
    assert not store.browsers.knows(one)
    assert store.browsers.list() == [second]
    clock.now += BROWSER_SECONDS + 1
    assert store.browsers.list() == []


@pytest.mark.parametrize("wrong", ["", "%", "0" * 12, "_" * 12])
def test_no_browser_is_ended_by_what_is_no_id(store, wrong):
    """Nor are others that are named beside it."""
    secret = store.browsers.let_in()
    [known] = store.browsers.list()
    with pytest.raises(NotFound, match="browsers list"):
        store.browsers.remove([known.id, wrong])
    assert store.browsers.knows(secret)


def test_a_browser_let_in_by_the_token_is_in_as_long_as_that_is_the_token(store):
    """And one let in by a link whatever the token is."""
    by_link, by_token = store.browsers.let_in(), store.browsers.let_in("sesame")
    for token, knows in (("sesame", True), ("another", False), ("", False)):
        assert store.browsers.knows(by_token, token) is knows
        assert store.browsers.knows(by_link, token)
    store.browsers.remove_others("sesame")
    assert len(store.browsers.list()) == 2
    store.browsers.remove_others("")
    assert [browser.by_token for browser in store.browsers.list()] == [False]


def test_a_key_tells_its_name_until_it_is_removed(store, clock):
    key = store.keys.add("rig 3")
    assert key.startswith("rt_")
    assert store.keys.name_of(key) == "rig 3"
    assert store.keys.name_of(key + "x") is None
    [known] = store.keys.list()
    assert key.startswith(known.begins)
    assert len(known.begins) < len(key) / 4
    assert (known.name, known.created, known.used) == ("rig 3", clock.now, clock.now)
    store.keys.remove("rig 3")
    assert store.keys.name_of(key) is None
    assert not store.keys.any()


def test_a_key_that_was_not_used_says_so(store):
    store.keys.add("rig 3")
    assert [known.used for known in store.keys.list()] == [None]


@pytest.mark.parametrize("name", ["", " ", "x" * 101, "a\nb", "a\0b", "ab\u202ecd", "\ud800"])
def test_a_name_that_cannot_be_shown_is_none(store, name):
    with pytest.raises(InvalidRequest, match="printable"):
        store.keys.add(name)


def test_a_name_is_of_one_key(store):
    store.keys.add("rig 3")
    with pytest.raises(Conflict, match="rig 3"):
        store.keys.add("rig 3")
    with pytest.raises(NotFound, match="rig 4"):
        store.keys.remove("rig 4")


def test_keys_are_made_beside_a_running_service(store, tmp_path, database):
    """The owner's lock is the store's; a second opening of the database needs none."""
    beside = database_beside(tmp_path, database)
    key = key_store.KeyStore(beside).add("rig 3")
    assert store.keys.name_of(key) == "rig 3"
    key_store.KeyStore(beside).remove("rig 3")
    assert store.keys.name_of(key) is None
    beside.close()


def test_what_is_kept_lets_nobody_in(tmp_path):
    store = Store(tmp_path, Limits())
    secrets = [
        store.browsers.make_link(),
        store.browsers.let_in("sesame"),
        store.keys.add("rig 3"),
        store.sessions.create(CAR, [])[1],
    ]
    kept = b"".join(file.read_bytes() for file in tmp_path.glob("ridetune.sqlite*"))
    assert b"rig 3" in kept
    assert not [secret for secret in secrets if secret.encode() in kept]
    assert b"sesame" not in kept
    assert hashed("sesame").encode() not in kept
    store.close()


def test_a_token_opens_its_own_session_only(store):
    (first, first_token), (second, second_token) = (store.sessions.create(CAR, []) for _ in "ab")
    opens = store.owners.opens
    assert opens(first, user=None, token=first_token)
    assert opens(first, user="user:anna", token=first_token)
    assert not opens(first, user=None, token=second_token)
    assert not opens(second, user=None, token="")
    assert not opens("nobody", user=None, token=first_token)


def test_a_users_session_opens_for_that_user_only(store):
    """Its token opens nothing, whoever brings it."""
    session, token = store.sessions.create(CAR, [], "user:anna")
    opens = store.owners.opens
    assert opens(session, user="user:anna", token="")
    assert not opens(session, user=None, token=token)
    assert not opens(session, user="user:bert", token=token)
    assert not opens(session, user="key:anna", token=token)


def test_everybody_lists_their_own(store):
    [anna, later] = (store.sessions.create(CAR, [], "user:anna")[0] for _ in "ab")
    mine, token = store.sessions.create(CAR, [])
    ids = lambda **who: [one.id for one in store.owners.sessions(**who)]  # noqa: E731
    assert ids(user="user:anna", tokens=[]) == [later, anna]
    assert ids(user="user:anna", tokens=[token]) == [mine, later, anna]
    assert ids(user=None, tokens=[token, "guessed"]) == [mine]
    assert ids(user="user:bert", tokens=[]) == ids(user=None, tokens=[]) == []


def test_a_users_unused_sessions_make_room_for_their_own_alone(tmp_path, database, monkeypatch):
    """After an hour; one that holds something stays, and so does another user's."""
    store = Store(tmp_path, Limits(user_sessions=2), database)
    make = lambda who: store.sessions.create(CAR, [], who)[0]  # noqa: E731
    unused, used, others = make("user:anna"), make("user:anna"), make("user:bert")
    store.sessions.set_vehicle(used, CAR)
    with pytest.raises(Busy, match="2 sessions"):
        make("user:anna")
    monkeypatch.setattr(session_store, "UNUSED_AFTER", -1.0)
    third = make("user:anna")
    of = lambda who: {one.id for one in store.owners.sessions(user=who, tokens=[])}  # noqa: E731
    assert of("user:anna") == {used, third}
    assert of("user:bert") == {others}
    assert unused not in of("user:anna")
    store.close()
