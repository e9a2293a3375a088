"""What several threads, or several services on one PostgreSQL database, change at once.

With SQLite one service owns the database, so its threads race; with PostgreSQL two services do.
"""

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Any

import pytest
from ridetune.app.errors import Busy, InvalidRequest, NotFound, StartError
from ridetune.app.limits import Limits
from ridetune.app.storage.data_directory import DataDirectory
from ridetune.app.storage.measurement import NewMeasurement
from ridetune.app.storage.store import Store

from .postgresql_server import PostgresqlServer

CAR = {"name": "a car"}
LIMITS = Limits(session_measurements=8, session_bytes=100, unfinished_jobs=6, session_jobs=2000)


@pytest.fixture
def stores(tmp_path, database) -> Iterator[list[Store]]:
    """The stores of two services, or twice that of the only one."""
    opened = [Store(tmp_path / "data", LIMITS, database) for _ in range(2 if database else 1)]
    yield opened if database else opened * 2
    for store in opened:
        store.close()


@pytest.fixture
def services(tmp_path, on_postgresql) -> Iterator[list[Store]]:
    """Two services."""
    opened = [Store(tmp_path / "data", LIMITS, on_postgresql) for _ in range(2)]
    yield opened
    for store in opened:
        store.close()


def recording(data: bytes) -> NewMeasurement:
    return NewMeasurement("run.csv", data, {}, {})


def queued(store: Store, session: str, key: str | None = None) -> str:
    return store.jobs.add(session, "test", {"runs": [], "asked": "a fit"}, key)[0].id


def at_once(works: Sequence[Callable[[], Any]]) -> list[Any]:
    """What each gives, or its exception, all having begun together."""
    given: list[Any] = [None] * len(works)
    together = threading.Barrier(len(works))

    def run(order: int) -> None:
        together.wait()
        try:
            given[order] = works[order]()
        except Exception as error:
            given[order] = error

    threads = [threading.Thread(target=run, args=[order]) for order in range(len(works))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return given


def test_every_job_is_claimed_exactly_once(stores):
    """Four runners take what they get, three at a time, while more jobs come."""
    session, _ = stores[0].sessions.create(CAR, [])
    ended = threading.Event()

    def submit() -> list[str]:
        made = []
        while len(made) < 60:
            with suppress(Busy):
                made.append(queued(stores[0], session))
        while stores[0].jobs.unfinished():
            time.sleep(0.01)
        ended.set()
        return made

    def run(runner: str, store: Store) -> list[str]:
        done = []
        while not ended.is_set():
            for job in store.leases.claim(runner, 3):
                assert store.leases.start(job.id, runner)
                assert job.id in store.leases.heartbeat(runner).jobs
                assert store.finish_job(job.id, "done", runner=runner, result={})
                done.append(job.id)
        return done

    runs = [lambda order=order: run(str(order), stores[order % 2]) for order in range(4)]
    made, *done = at_once([submit, *runs])
    assert sorted(job for some in done for job in some) == sorted(made)


def test_a_session_s_bytes_hold_whoever_adds(stores):
    """Six times 40 bytes into 100: two fit, in whatever form they come."""
    session, _ = stores[0].sessions.create(CAR, [])
    mapping = {"a": "x" * 31}
    works = [
        lambda store=stores[order % 2], order=order: (
            store.measurements.add(session, recording(bytes([order]) * 40))
            if order < 4
            else store.mappings.keep(session, str(order), mapping)
        )
        for order in range(6)
    ]
    given = at_once(works)
    assert sum(isinstance(one, Busy) for one in given) == 4, given
    assert sum(isinstance(one, Exception) for one in given) == 4, given
    stores[0].files.require_room(session, 20)


def test_a_session_s_numbers_hold_whoever_adds(stores):
    """Measurements and jobs under way."""
    session, _ = stores[0].sessions.create(CAR, [])
    given = at_once(
        [lambda store=store: store.measurements.add(session, recording(b"1")) for store in stores]
        * 6
    )
    assert sum(isinstance(one, Busy) for one in given) == 4, given
    given = at_once([lambda store=store: queued(store, session) for store in stores] * 5)
    assert sum(isinstance(one, Busy) for one in given) == 4, given
    assert len(stores[1].jobs.unfinished(session)) == 6


def test_a_key_sent_twice_at_once_is_one_job(stores):
    session, _ = stores[0].sessions.create(CAR, [])
    for key in "abcd":
        one, *others = at_once(
            [lambda store=store: queued(store, session, key) for store in stores] * 2
        )
        assert others == [one] * 3
    assert len(stores[0].jobs.of_session(session, "test")) == 4


def test_a_row_never_lacks_its_file(stores):
    """The same bytes come and go as measurements, as what jobs made and as their parts."""
    sessions = [store.sessions.create(CAR, [])[0] for store in stores]
    data = b"the same"

    def measure(store: Store, session: str) -> None:
        for _ in range(12):
            kept = store.measurements.add(session, recording(data))
            assert store.measurements.original(kept).read_bytes() == data
            store.measurements.delete(session, kept.id)

    def work(store: Store, session: str) -> None:
        for _ in range(8):
            job = queued(store, session)
            assert store.keep_part(job, "part", data)
            assert store.part(job, "part") == data
            assert store.finish_job(job, "done", file=data)
            file = store.jobs.get(session, job).file
            assert file is not None
            assert store.directory.original(file).read_bytes() == data
            store.delete_job(session, job)

    pairs = list(zip(stores, sessions, strict=True))
    works = [lambda do=do, pair=pair: do(*pair) for do in (measure, work) for pair in pairs]
    assert at_once(works) == [None] * 4
    assert list(stores[0].directory.names()) == []


def test_a_session_may_go_while_it_is_added_to(stores):
    """Whoever comes too late is told that it is deleted; nothing is left of it."""
    for turn in range(5):
        session, _ = stores[0].sessions.create(CAR, [recording(b"sample")])
        job, _ = queued(stores[0], session), stores[1].leases.claim("me", 1)

        def add(store: Store, session=session) -> None:
            store.measurements.add(session, recording(b"more"))
            queued(store, session)

        works = [
            lambda: add(stores[0]),
            lambda: add(stores[1]),
            lambda job=job: stores[1].finish_job(job, "done", runner="me", file=b"made"),
            lambda: stores[0].leases.heartbeat("me"),
            lambda session=session: stores[1].sessions.delete(session),
        ]
        given = at_once(works)
        unforeseen = [
            one for one in given if isinstance(one, Exception) and not isinstance(one, NotFound)
        ]
        assert unforeseen == [], turn
    assert stores[0].jobs.unfinished() == []
    stores[0].files.drop_unreferenced()
    assert list(stores[0].directory.names()) == []


def test_a_service_that_starts_leaves_what_another_writes(services, tmp_path, on_postgresql):
    """Its sweep meets files whose rows are not committed yet, and rows whose files are going."""
    store = services[0]
    session, _ = store.sessions.create(CAR, [])
    ended = threading.Event()

    def measure(data: bytes) -> None:
        try:
            for _ in range(25):
                kept = store.measurements.add(session, recording(data))
                assert store.measurements.original(kept).read_bytes() == data
                store.measurements.delete(session, kept.id)
        finally:
            ended.set()

    def start() -> None:
        while not ended.is_set():
            Store(tmp_path / "data", LIMITS, on_postgresql).close()

    assert at_once([lambda: measure(b"one"), lambda: measure(b"two"), start]) == [None] * 3


def test_services_that_start_at_once_make_one_schema(tmp_path, on_postgresql):
    def start() -> str:
        store = Store(tmp_path / "data", LIMITS, on_postgresql)
        store.close()
        return store.database.id

    given = at_once([start] * 4)
    assert len(set(given)) == 1, given


def test_what_one_service_keeps_the_other_finds(services):
    """Sessions, tokens, originals, cancelling and what is deleted."""
    one, other = services
    session, token = one.sessions.create(CAR, [])
    kept = one.measurements.add(session, recording(b"0 1 2"))
    assert other.owners.opens(session, user=None, token=token)
    assert other.measurements.original(kept).read_bytes() == b"0 1 2"
    job = queued(one, session)
    assert [found.id for found in one.leases.claim("one", 1)] == [job]
    assert other.leases.claim("other", 1) == []
    assert one.leases.start(job, "one")
    assert other.jobs.ask_to_cancel(session, job).state == "running"
    assert one.leases.heartbeat("one").cancel_asked == {job}
    other.delete_job(session, job)
    assert one.leases.heartbeat("one").jobs == frozenset()
    other.sessions.delete(session)
    assert not one.owners.opens(session, user=None, token=token)


def test_a_data_directory_belongs_to_one_database(tmp_path, on_postgresql, postgresql):
    """Else the files of each would be swept as leftovers of the other."""
    shared, own = tmp_path / "shared", tmp_path / "own"
    Store(shared, LIMITS, on_postgresql).close()
    with pytest.raises(StartError, match="name it in RIDETUNE_DATABASE"):
        Store(shared, LIMITS)
    with postgresql.database() as another, pytest.raises(StartError, match="belongs to another"):
        Store(shared, LIMITS, another)
    Store(own, LIMITS).close()
    with pytest.raises(StartError, match="ridetune backup and restore"):
        Store(own, LIMITS, on_postgresql)
    Store(shared, LIMITS, on_postgresql).close()
    DataDirectory(own).close()


def test_commits_wait_for_the_disk(services):
    """Whatever the server's default is; a reader sees one state and changes nothing."""
    asked = ("synchronous_commit", "transaction_isolation", "transaction_read_only")
    for transaction, answers in (
        (services[0].database.writing, ["on", "read committed", "off"]),
        (services[0].database.reading, ["on", "repeatable read", "on"]),
    ):
        with transaction() as connection:
            given = [connection.exec_driver_sql(f"SHOW {name}").scalar() for name in asked]
        assert given == answers


SECRET = "open-sesame"
REFUSED = {
    "no address": ("nonsense " + SECRET, "write it like postgresql://"),
    "no name": (f"postgresql://u:{SECRET}@nowhere", "write it like postgresql://"),
    "another database": (f"mysql://u:{SECRET}@nowhere/x", "write it like postgresql://"),
    "nobody there": (f"postgresql://u:{SECRET}@127.0.0.1:1/x", "cannot be reached"),
    "no such database": (None, "cannot be reached, or refuses it"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_database_that_cannot_be_had_is_told_without_its_address(
    tmp_path, postgresql: PostgresqlServer, case, caplog
):
    url, said = REFUSED[case]
    with pytest.raises(StartError, match=said) as refused:
        Store(tmp_path, LIMITS, url or postgresql.url("nowhere"))
    for told in (str(refused.value), caplog.text):
        assert SECRET not in told
        assert "nowhere" not in told
        assert "127.0.0.1" not in told


def test_a_missing_driver_is_named_with_its_remedy(tmp_path, monkeypatch):
    monkeypatch.setattr("ridetune.app.storage.postgresql.find_spec", lambda name: None)
    with pytest.raises(StartError, match=r"needs psycopg; run .*\[postgresql\]"):
        Store(tmp_path, LIMITS, "postgresql://u@h/n")


def test_nothing_is_found_by_a_text_with_a_nul(stores):
    """PostgreSQL keeps none: it is the request's fault, never a failure of the service."""
    session, _ = stores[0].sessions.create(CAR, [])
    with pytest.raises(NotFound):
        stores[0].sessions.get("a\0b")
    if stores[0].database.shared:
        with pytest.raises(InvalidRequest, match="NUL"):
            stores[0].mappings.keep(session, "a\0b", {})
