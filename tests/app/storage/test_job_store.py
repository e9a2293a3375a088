"""Who runs a job: claims, leases, hand-overs; and the parts that are kept while it runs."""

import pytest
from ridetune.app.errors import Busy, NotFound
from ridetune.app.limits import Limits
from ridetune.app.storage.job_leases import LEASE
from ridetune.app.storage.measurement import NewMeasurement
from ridetune.app.storage.store import Store

CAR = {"name": "a car"}


@pytest.fixture
def store(tmp_path, database):
    store = Store(tmp_path / "data", Limits(unfinished_jobs=10), database)
    yield store
    store.close()


@pytest.fixture
def session(store) -> str:
    return store.sessions.create(CAR, [])[0]


@pytest.fixture
def later(store, monkeypatch):
    """Set the database's clock on by some seconds, or back."""
    kind = type(store.database)
    true = kind.now.fget

    def set_on(seconds: float) -> None:
        monkeypatch.setattr(kind, "now", property(lambda one: true(one) + seconds))

    return set_on


def queued(store: Store, session: str, priority: int = 0) -> str:
    spec = {"runs": [], "asked": "a fit"}
    return store.jobs.add(session, "test", spec, None, priority=priority)[0].id


def claimed(store: Store, runner: str, most: int = 10) -> list[str]:
    return [job.id for job in store.leases.claim(runner, most)]


def test_a_job_is_claimed_once_by_priority_then_by_age(store, session):
    first, second = queued(store, session), queued(store, session)
    urgent = queued(store, session, priority=1)
    assert claimed(store, "a", 2) == [urgent, first]
    assert claimed(store, "b") == [second]
    assert claimed(store, "a") == []
    kept = store.jobs.get(session, urgent)
    assert (kept.runner, kept.state, kept.priority, kept.restarts) == ("a", "queued", 1, 0)


def test_a_later_job_is_later_although_the_clock_went_back(store, session, later):
    first = queued(store, session)
    later(-3600.0)
    second = queued(store, session)
    assert [job.id for job in store.jobs.of_session(session, "test")] == [first, second]
    assert claimed(store, "a", 1) == [first]


def test_a_job_that_nobody_claims_for_long_is_not_lost(store, session, later):
    job = queued(store, session)
    later(86_400.0)
    assert claimed(store, "a") == [job]


@pytest.mark.parametrize("passed", [LEASE + 1, -LEASE - 1])
def test_a_lost_runner_s_jobs_are_taken_over_once_the_lease_has_run_out(
    store, session, later, passed
):
    """Also where the clock went back. What had not started has not been lost; what had, has."""
    running, waiting = queued(store, session), queued(store, session)
    claimed(store, "lost")
    assert store.leases.start(running, "lost")
    later(passed / 2)
    assert claimed(store, "b") == []
    later(passed)
    assert claimed(store, "b") == [running, waiting]
    kept = [store.jobs.get(session, job) for job in (running, waiting)]
    assert [(job.state, job.started, job.restarts, job.attempts) for job in kept] == [
        ("queued", None, 1, 0),
        ("queued", None, 0, 0),
    ]
    assert store.leases.heartbeat("lost").jobs == frozenset()
    assert not store.leases.start(waiting, "lost")


def test_a_heartbeat_renews_the_lease(store, session, later):
    job = queued(store, session)
    claimed(store, "a")
    for beats in range(1, 5):
        later(beats * LEASE * 0.6)
        assert claimed(store, "b") == []
        assert store.leases.heartbeat("a").jobs == {job}


def test_a_runner_that_slept_keeps_what_nobody_took(store, session, later):
    """It is not given its own jobs a second time."""
    job = queued(store, session)
    claimed(store, "a")
    later(LEASE + 1)
    assert claimed(store, "a") == []
    assert store.leases.heartbeat("a").jobs == {job}
    assert claimed(store, "b") == []


def test_only_its_runner_moves_and_ends_a_job_and_the_first_end_is_the_end(store, session):
    job = queued(store, session)
    claimed(store, "a")
    assert not store.leases.start(job, "b")
    assert not store.leases.requeue(job, "b")
    store.leases.save_progress(job, "b", {"cost": 1.0})
    assert store.jobs.get(session, job).progress == {}
    assert store.leases.start(job, "a")
    store.leases.save_progress(job, "a", {"cost": 1.0})
    assert store.jobs.get(session, job).progress == {"cost": 1.0}
    assert store.leases.requeue(job, "a")
    kept = store.jobs.get(session, job)
    assert (kept.state, kept.runner, kept.attempts, kept.restarts) == ("queued", "a", 1, 0)
    assert not store.finish_job(job, "done", runner="b", result={"cost": 2.0}, file=b"late")
    assert not store.finish_job(job, "cancelled")
    assert store.jobs.get(session, job) == kept
    assert originals(store) == set()
    assert store.finish_job(job, "done", runner="a", result={"cost": 1.0})
    assert not store.finish_job(job, "failed", runner="a", error={"code": "x", "detail": "y"})
    assert store.leases.heartbeat("a").jobs == frozenset()


def test_what_is_handed_over_counts_as_no_crash(store, session):
    job = queued(store, session)
    claimed(store, "a")
    store.leases.start(job, "a")
    store.leases.release("a")
    kept = store.jobs.get(session, job)
    assert (kept.state, kept.runner, kept.started) == ("queued", None, None)
    assert claimed(store, "b") == [job]
    kept = store.jobs.get(session, job)
    assert (kept.restarts, kept.attempts) == (0, 0)


def test_after_a_crash_everything_is_claimable_at_once_with_sqlite(tmp_path):
    """The lock of the data directory tells that its owner is gone, before the lease has run out."""
    store = Store(tmp_path, Limits())
    session, _ = store.sessions.create(CAR, [])
    running, waiting = queued(store, session), queued(store, session)
    claimed(store, "a")
    store.leases.start(running, "a")
    store.close()
    store = Store(tmp_path, Limits())
    assert store.jobs.get(session, running).state == "queued"
    assert claimed(store, "b") == [running, waiting]
    assert [store.jobs.get(session, job).restarts for job in (running, waiting)] == [1, 0]
    store.close()


@pytest.mark.parametrize("state", ["without a runner", "not started"])
def test_a_job_that_does_not_run_is_cancelled_at_once(store, session, state):
    job = queued(store, session)
    if state == "not started":
        claimed(store, "a")
    assert store.jobs.ask_to_cancel(session, job).state == "cancelled"
    assert claimed(store, "a") == []
    assert store.jobs.ask_to_cancel(session, job).state == "cancelled"
    other, _ = store.sessions.create(CAR, [])
    with pytest.raises(NotFound):
        store.jobs.ask_to_cancel(other, job)


def test_a_job_with_parts_is_left_to_a_runner_to_be_cancelled(store, session):
    """Which may make a result of them; before what is to be run."""
    waiting, job = queued(store, session), queued(store, session)
    store.keep_part(job, "a", b"part")
    assert not store.jobs.ask_to_cancel(session, job).ended
    assert claimed(store, "a") == [job, waiting]


def test_a_runner_hears_with_its_heartbeat_what_is_to_stop(store, session):
    stopping, going_on = queued(store, session), queued(store, session)
    claimed(store, "a")
    store.leases.start(stopping, "a")
    assert store.jobs.ask_to_cancel(session, stopping).state == "running"
    beat = store.leases.heartbeat("a")
    assert (beat.jobs, beat.cancel_asked) == ({stopping, going_on}, {stopping})


@pytest.mark.parametrize("end", ["released", "lost"])
def test_what_was_asked_to_stop_is_not_run_again(store, session, later, end):
    job = queued(store, session)
    claimed(store, "a")
    store.leases.start(job, "a")
    store.jobs.ask_to_cancel(session, job)
    if end == "released":
        store.leases.release("a")
    later(LEASE + 1)
    assert claimed(store, "b") == []
    kept = store.jobs.get(session, job)
    assert (kept.state, kept.cancel_asked) == ("cancelled", True)
    assert kept.finished is not None


def originals(store: Store) -> set[bytes]:
    return {file.read_bytes() for file in store.directory.originals.glob("*/*")}


def test_parts_are_kept_until_the_job_ends(tmp_path, database):
    """The first one under a name stays; what comes after the end is not kept."""
    store = Store(tmp_path, Limits(), database)
    session, _ = store.sessions.create(CAR, [])
    job = queued(store, session)
    assert store.parts(job) == {}
    assert all(store.keep_part(job, name, name.encode()) for name in "ba")
    assert store.keep_part(job, "a", b"again")
    store.close()
    store = Store(tmp_path, Limits(), database)
    assert list(store.parts(job)) == ["a", "b"]
    assert store.part(job, "a") == b"a"
    assert originals(store) == {b"a", b"b"}
    assert store.finish_job(job, "done", file=b"b")
    assert store.parts(job) == {}
    assert originals(store) == {b"b"}
    assert not store.keep_part(job, "c", b"late")
    assert not store.keep_part("nobody's", "c", b"late")
    assert originals(store) == {b"b"}
    with pytest.raises(NotFound):
        store.part(job, "a")
    store.close()


@pytest.mark.parametrize("end", ["deleted", "cancelled", "session deleted"])
def test_parts_go_with_their_job_however_it_goes(store, session, end):
    job = queued(store, session)
    store.keep_part(job, "a", b"part")
    if end == "deleted":
        store.delete_job(session, job)
    elif end == "cancelled":
        store.finish_job(job, "cancelled")
        assert store.parts(job) == {}
    else:
        store.sessions.delete(session)
    assert originals(store) == set()


def test_parts_count_in_the_session_s_bytes(tmp_path, database):
    store = Store(tmp_path, Limits(session_bytes=10), database)
    session, _ = store.sessions.create(CAR, [])
    job = queued(store, session)
    for name in "ab":
        assert store.keep_part(job, name, b"1234")
    with pytest.raises(Busy, match="delete one first"):
        store.measurements.add(session, NewMeasurement("run.csv", b"123", {}, {}))
    store.finish_job(job, "done")
    store.measurements.add(session, NewMeasurement("run.csv", b"123", {}, {}))
    store.close()
