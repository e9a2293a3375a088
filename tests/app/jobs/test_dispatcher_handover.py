"""Who goes on with a job: another service or the next attempt, with what was kept of it."""

from ridetune.app.errors import Unavailable
from ridetune.app.jobs import jobs_under_way
from ridetune.app.limits import Limits
from ridetune.app.storage.file_store import FileStore
from ridetune.app.storage.kept_sessions import KeptSessions
from ridetune.app.storage.originals import Originals
from ridetune.app.storage.store import database_beside
from ridetune.app.storage.tables import jobs
from sqlalchemy import update

from ..waiting import until
from .dispatcher_team import WIDTH, make


def test_a_service_that_is_about_to_end_begins_nothing_more(team):
    """What runs goes on; units that wait, and a job that comes, are for who takes them up next."""
    cluster = team.dispatch()
    job = team.submit("sweep", team.ann, "abcde")
    until(lambda: len(cluster.tasks) == WIDTH)
    team.taking = False
    late = team.submit("fit", team.bob)
    for unit in "abc":
        make(cluster, job, unit)
    until(lambda: team.dispatchers[0].progress(job) == {"made": 3, "of": 5})
    assert cluster.tasks == {}
    assert team.state(late) == "queued"
    team.dispatchers.pop().close()
    team.taking = True
    other = team.dispatch()
    until(lambda: {f"{job}/d", f"{job}/e", late} == set(other.tasks))


def test_another_process_goes_on_where_one_stopped(team):
    """Handed over at a graceful end: only the units that are missing are made again, and how far
    the others came is known."""
    first = team.dispatch()
    job = team.submit("sweep", team.ann, "abcd")
    for unit in "ab":
        make(first, job, unit)
    until(lambda: len(team.store.parts(job)) == 2)
    team.dispatchers.pop().close()
    second = team.dispatch()
    until(lambda: set(second.tasks) == {f"{job}/c", f"{job}/d"})
    make(second, job, "c")
    until(lambda: team.dispatchers[0].progress(job) == {"made": 3, "of": 4})
    make(second, job, "d")
    until(lambda: job in second.tasks)
    assert second.kept[job] == {unit: unit.encode() for unit in "abcd"}
    assert team.store.jobs.get(team.ann, job).restarts == 0


def test_parts_of_another_version_are_made_again(team, monkeypatch):
    job = team.submit("sweep", team.ann, "ab")
    team.store.keep_part(job, "0.0.1/a", b"old")
    cluster = team.dispatch()
    until(lambda: set(cluster.tasks) == {f"{job}/a", f"{job}/b"})


def test_a_job_whose_lease_another_took_is_let_go(team):
    """As after a pause longer than the lease."""
    cluster = team.dispatch()
    fit = team.submit("fit", team.ann)
    until(lambda: fit in cluster.tasks)
    with team.store.database.writing() as connection:
        connection.execute(update(jobs).values(runner="another"))
    until(lambda: fit in cluster.cancelled)
    assert team.state(fit) == "queued"


def test_the_end_of_a_job_that_another_took_is_not_its_end(team, monkeypatch):
    """However late it is noticed: the leases' thread is away."""

    def away(runner):
        raise Unavailable("The database cannot be reached.")

    monkeypatch.setattr(team.store.leases, "heartbeat", away)
    cluster = team.dispatch()
    fits = {state: team.submit("fit", team.ann) for state in ("done", "failed")}
    until(lambda: set(fits.values()) == set(cluster.tasks))
    with team.store.database.writing() as connection:
        connection.execute(update(jobs).values(runner="another"))
    cluster.end(fits["done"], "done", result={"cost": 1.0})
    cluster.end(fits["failed"], "failed", error={"code": "x", "detail": "y"})
    until(lambda: set(fits.values()) <= set(team.changed))
    for fit in fits.values():
        assert team.state(fit) == "queued"
        assert team.store.finish_job(fit, "done", runner="another")


def test_what_an_earlier_attempt_of_a_unit_tells_is_not_of_the_next(team):
    """As where a lease was lost and taken again: the old task is still being stopped."""
    cluster = team.dispatch()
    fit = team.submit("fit", team.ann)
    until(lambda: fit in cluster.tasks)
    earlier = cluster.tasks[fit][2]
    cluster.lose(fit, with_worker=False)
    until(lambda: fit in cluster.tasks)
    error = {"code": "worker-lost", "detail": "It is gone."}
    ending = {"state": "failed", "result": None, "error": error, "progress": {}}
    earlier.task_ended(fit, ending)
    cluster.end(fit, "done", result={"cost": 1.0})
    until(lambda: team.store.jobs.get(team.ann, fit).ended)
    assert team.state(fit) == "done"


def test_what_a_task_keeps_on_its_way_comes_with_its_next_attempt(team):
    cluster = team.dispatch()
    fit = team.submit("fit", team.ann)
    until(lambda: fit in cluster.tasks)
    cluster.tasks[fit][2].task_kept(fit, "search-0", b"found")
    cluster.lose(fit, with_worker=True)
    until(lambda: fit in cluster.tasks)
    assert cluster.kept[fit] == {"search-0": b"found"}


def test_a_task_that_stops_although_nobody_asked_is_sent_again(team):
    cluster = team.dispatch()
    fit = team.submit("fit", team.ann)
    until(lambda: fit in cluster.tasks)
    cluster.end(fit, "cancelled")
    until(lambda: fit in cluster.tasks)
    assert team.state(fit) == "queued"


def test_units_that_are_lost_now_and_then_do_not_fail_their_job(team):
    """A long job outlives many workers; it is a unit lost each time that may be the reason."""
    cluster = team.dispatch()
    job = team.submit("sweep", team.ann, "abcd")
    for unit in "abc":
        until(lambda: f"{job}/{unit}" in cluster.tasks)
        cluster.lose(f"{job}/{unit}", with_worker=True)
        make(cluster, job, unit)
    for _ in range(jobs_under_way.MOST_ATTEMPTS):
        assert team.state(job) != "failed"
        until(lambda: f"{job}/d" in cluster.tasks)
        cluster.lose(f"{job}/d", with_worker=True)
    until(lambda: team.state(job) == "failed")


def test_jobs_of_sessions_that_another_process_deletes_are_stopped(team, tmp_path, database):
    """By `ridetune sessions remove` beside the service; nothing of them is left, others go on."""
    cluster = team.dispatch()
    fit, cut = team.submit("fit", team.ann), team.submit("sweep", team.ann, "ab")
    until(lambda: {fit, f"{cut}/a", f"{cut}/b"} == set(cluster.tasks))
    make(cluster, cut, "a")
    until(lambda: len(team.store.parts(cut)) == 1)
    other = team.submit("fit", team.bob)
    until(lambda: other in cluster.tasks)
    beside = database_beside(tmp_path, database)
    KeptSessions(beside, FileStore(beside, Originals(tmp_path), Limits())).remove([team.ann])
    beside.close()
    until(lambda: set(cluster.tasks) == {other})
    assert list(team.store.directory.names()) == []
