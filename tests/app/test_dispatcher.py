"""Which job runs when, what is kept of it, and who goes on with it; the cluster is a stand-in."""

import errno
from dataclasses import replace
from threading import Event

import pytest
from ridetune.app import dispatcher, gatherer, jobs_under_way, lease_keeper
from ridetune.app.dispatcher import Dispatcher
from ridetune.app.errors import Unavailable
from ridetune.app.job_kinds import PATIENT, Division, Kind
from ridetune.app.limits import Limits
from ridetune.app.store import Store
from ridetune.app.tables import jobs
from sqlalchemy import update

from .stand_in_cluster import StandIn
from .waiting import until

WIDTH = StandIn().width()
MEANWHILE = 5
"""Units that may end between a job's claim and its first unit: its payload is gathered."""


def of_spec(job):
    return dict(job.spec)


def counted(spec, units, at_once):
    return {"made": sum(one.get("made", 0) for one in units.values()), "of": len(spec["units"])}


CUT = Division(names=lambda spec: spec["units"], unit=lambda *_: None, progress=counted)
KINDS = {
    "fit": Kind(task=lambda *_: None, payload=of_spec),
    "sweep": Kind(task=lambda *_: None, payload=of_spec, division=CUT, priority=PATIENT),
    "campaign": Kind(
        task=lambda *_: None,
        payload=of_spec,
        division=replace(CUT, slow=lambda spec: True, cut_short=True),
        priority=PATIENT,
    ),
}


class Team:
    """Dispatchers on one store, each with a cluster of its own."""

    def __init__(self, path, database):
        self.store = Store(path, Limits(unfinished_jobs=100), database)
        self.ann, self.bob = (self.store.sessions.create({}, [])[0] for _ in range(2))
        self.sessions: dict[str, str] = {}
        self.dispatchers: list[Dispatcher] = []
        self.taking = True
        self.changed: list[str] = []

    def dispatch(self) -> StandIn:
        """The cluster of one more."""
        cluster = StandIn()
        made = Dispatcher(
            self.store, cluster, KINDS, self.changed.append, lambda: True, lambda: self.taking
        )
        self.dispatchers.append(made)
        made.start()
        return cluster

    def submit(self, kind: str, session: str, units: str = "") -> str:
        spec = {"asked": "", "units": list(units)}
        priority = KINDS[kind].priority
        job = self.store.jobs.add(session, kind, spec, None, priority=priority)[0].id
        self.sessions[job] = session
        for one in self.dispatchers:
            one.look()
        return job

    def state(self, job: str) -> str:
        return self.store.jobs.get(self.sessions[job], job).state


@pytest.fixture
def team(tmp_path, database, monkeypatch):
    monkeypatch.setattr(dispatcher, "LOOK_EVERY", 0.02)
    monkeypatch.setattr(dispatcher, "RETRY_AFTER", 0.02)
    monkeypatch.setattr(gatherer, "GATHER_AGAIN_AFTER", 0.02)
    monkeypatch.setattr(jobs_under_way, "RECORD_EVERY", 0.02)
    monkeypatch.setattr(jobs_under_way, "REWRITE_AFTER", 0.02)
    monkeypatch.setattr(lease_keeper, "BEAT_EVERY", 0.02)
    team = Team(tmp_path, database)
    yield team
    for one in team.dispatchers:
        one.close()
    team.store.close()


def make(cluster: StandIn, job: str, unit: str) -> None:
    """A unit's end: its part is its name."""
    name = f"{job}/{unit}"
    until(lambda: name in cluster.tasks)
    ending = {"state": "done", "result": {"made": 1}, "error": None, "progress": {}}
    cluster.tasks.pop(name)[2].task_ended(name, {**ending, "file": unit.encode()})


def test_units_run_as_many_as_there_are_workers_and_the_result_is_made_of_all(team):
    cluster = team.dispatch()
    job = team.submit("sweep", team.ann, "abcde")
    until(lambda: set(cluster.tasks) == {f"{job}/{unit}" for unit in "abc"})
    assert [cluster.tasks[f"{job}/{unit}"][1]["unit"] for unit in "abc"] == ["a", "b", "c"]
    assert WIDTH == 3
    for unit in "abdce":
        make(cluster, job, unit)
    until(lambda: job in cluster.tasks)
    assert cluster.kept[job] == {unit: unit.encode() for unit in "abcde"}
    assert team.dispatchers[0].progress(job) == {"made": 5, "of": 5}
    cluster.end(job, "done", result={"rows": 5})
    until(lambda: team.state(job) == "done")
    assert team.store.parts(job) == {}


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


def until_sent(team: Team, cluster: StandIn, task: str) -> None:
    """Until a unit is sent as others end; how many they are is for the test to say."""
    job = task.partition("/")[0]
    until(lambda: team.store.jobs.get(team.sessions[job], job).runner is not None)
    for _ in range(MEANWHILE):
        other, unit = next(name for name in cluster.tasks if "/" in name).split("/")
        make(cluster, other, unit)
        until(lambda: len(cluster.tasks) == WIDTH)
        if task in cluster.tasks:
            return
    raise AssertionError(f"{task} is not sent before {MEANWHILE} others")


def test_what_a_person_waits_for_goes_before_what_takes_as_long_as_it_takes(team):
    """A fit waits for no more than what runs, however many sweeps came before."""
    cluster = team.dispatch()
    for _ in range(4 * WIDTH):
        team.submit("sweep", team.ann, "abcdefgh")
    until(lambda: len(cluster.tasks) == WIDTH)
    until_sent(team, cluster, team.submit("fit", team.ann))


def test_sessions_take_turns(team):
    """One that has nothing under way is not kept waiting by another's many units."""
    cluster = team.dispatch()
    team.submit("sweep", team.ann, "abcdefghijklmnopqrstuvwxyz")
    until(lambda: len(cluster.tasks) == WIDTH)
    until_sent(team, cluster, f"{team.submit('sweep', team.bob, 'xyz')}/x")


def test_slow_units_leave_a_worker_to_others(team):
    cluster = team.dispatch()
    slow = team.submit("campaign", team.ann, "abcd")
    until(lambda: len(cluster.tasks) == WIDTH - 1)
    fit = team.submit("fit", team.bob)
    until(lambda: fit in cluster.tasks)
    cluster.end(fit, "done", result={})
    until(lambda: team.state(fit) == "done")
    assert set(cluster.tasks) == {f"{slow}/a", f"{slow}/b"}


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


def test_what_a_task_keeps_on_its_way_comes_with_its_next_attempt(team):
    cluster = team.dispatch()
    fit = team.submit("fit", team.ann)
    until(lambda: fit in cluster.tasks)
    cluster.tasks[fit][2].task_kept(fit, "search-0", b"found")
    cluster.lose(fit, with_worker=True)
    until(lambda: fit in cluster.tasks)
    assert cluster.kept[fit] == {"search-0": b"found"}


def test_a_cancelled_campaign_makes_its_result_of_what_there_is(team):
    cluster = team.dispatch()
    job = team.submit("campaign", team.ann, "abcd")
    make(cluster, job, "a")
    until(lambda: f"{job}/c" in cluster.tasks)
    team.dispatchers[0].cancel(job)
    until(lambda: job in cluster.tasks)
    assert cluster.kept[job] == {"a": b"a"}
    assert set(cluster.cancelled) == {f"{job}/b", f"{job}/c"}
    cluster.end(job, "cancelled", result={"files": 1})
    until(lambda: team.state(job) == "cancelled")
    assert team.store.jobs.get(team.ann, job).result == {"files": 1}


def test_a_cancelled_sweep_ends_once_nothing_of_it_runs(team):
    cluster = team.dispatch()
    job = team.submit("sweep", team.ann, "abcd")
    make(cluster, job, "a")
    team.store.jobs.ask_to_cancel(team.ann, job)  # as another process would
    until(lambda: team.state(job) == "cancelled")
    until(lambda: cluster.tasks == {})


def test_a_unit_that_fails_fails_its_job_alone(team):
    cluster = team.dispatch()
    bad, good = team.submit("sweep", team.ann, "ab"), team.submit("sweep", team.bob, "a")
    until(lambda: f"{bad}/a" in cluster.tasks)
    error = {"code": "worker-lost", "detail": "It killed its workers."}
    cluster.end(f"{bad}/a", "failed", error=error)
    until(lambda: team.state(bad) == "failed")
    until(lambda: f"{bad}/b" in cluster.cancelled)
    assert team.store.jobs.get(team.ann, bad).error == error
    make(cluster, good, "a")
    until(lambda: good in cluster.tasks)


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


def test_of_progress_told_while_the_database_is_away_only_the_latest_waits(team, monkeypatch):
    """So that the memory it takes is bounded however long that lasts."""
    cluster = team.dispatch()
    ended, fit = team.submit("fit", team.bob), team.submit("fit", team.ann)
    until(lambda: {ended, fit} == set(cluster.tasks))
    finish, asked, back = team.store.finish_job, Event(), Event()

    def away(*told, **found):
        asked.set()
        if not back.is_set():
            raise Unavailable("The database cannot be reached.")
        return finish(*told, **found)

    monkeypatch.setattr(team.store, "finish_job", away)
    cluster.end(ended, "done", result={})
    asked.wait(10)
    for cost in range(1000):
        cluster.report(fit, cost=cost)
    back.set()
    until(lambda: team.dispatchers[0].progress(fit) == {"cost": 999})
    assert team.changed.count(fit) == 1


def test_nothing_that_was_told_is_lost_while_the_database_is_away(team, monkeypatch):
    cluster = team.dispatch()
    fit = team.submit("fit", team.ann)
    until(lambda: fit in cluster.tasks)
    finish, refused = team.store.finish_job, []

    def away(*told, **found):
        refused.append(told)
        if len(refused) < 4:
            raise Unavailable("The database cannot be reached.")
        return finish(*told, **found)

    monkeypatch.setattr(team.store, "finish_job", away)
    cluster.end(fit, "done", result={"cost": 1.0})
    until(lambda: team.state(fit) == "done")
    assert len(refused) == 4
    assert team.store.jobs.get(team.ann, fit).result == {"cost": 1.0}


def test_a_claim_whose_answer_was_lost_is_not_a_job_lost(team, monkeypatch):
    """The database has committed it, but the connection broke before it could tell."""
    claim, broken = team.store.leases.claim, []

    def claimed_unheard(*asked, **more):
        found = claim(*asked, **more)
        if found and not broken:
            broken.append(found)
            raise Unavailable("The database went away.")
        return found

    monkeypatch.setattr(team.store.leases, "claim", claimed_unheard)
    fit = team.submit("fit", team.ann)
    cluster = team.dispatch()
    until(lambda: fit in cluster.tasks)


def test_a_job_waits_for_what_it_is_gathered_from(team, monkeypatch):
    """As while the database, or the disk with its recordings, is away."""
    refusals = [Unavailable("It is away."), Unavailable("It is away.")]

    def payload(job):
        if refusals:
            raise refusals.pop()
        return dict(job.spec)

    monkeypatch.setitem(KINDS, "fit", replace(KINDS["fit"], payload=payload))
    fit = team.submit("fit", team.ann)
    cluster = team.dispatch()
    until(lambda: fit in cluster.tasks)
    assert team.state(fit) == "queued"


def test_a_job_that_cannot_be_divided_fails_alone(team, monkeypatch):
    """As one whose spec is of another version."""

    def names(spec):
        raise ValueError("no such plant")

    division = replace(CUT, names=names)
    monkeypatch.setitem(KINDS, "sweep", replace(KINDS["sweep"], division=division))
    cluster = team.dispatch()
    bad, fit = team.submit("sweep", team.ann, "ab"), team.submit("fit", team.ann)
    until(lambda: team.state(bad) == "failed")
    until(lambda: fit in cluster.tasks)


def test_a_job_of_which_nobody_knows_how_slow_it_is_fails_alone(team, monkeypatch):
    def slow(spec):
        raise ValueError("no such plant")

    division = replace(CUT, slow=slow)
    monkeypatch.setitem(KINDS, "campaign", replace(KINDS["campaign"], division=division))
    cluster = team.dispatch()
    bad, good = team.submit("campaign", team.ann, "ab"), team.submit("sweep", team.ann, "ab")
    until(lambda: team.state(bad) == "failed")
    until(lambda: f"{good}/a" in cluster.tasks)


@pytest.mark.parametrize("place", ["gathered", "submit", "parts"])
def test_a_job_that_cannot_be_sent_fails_alone(team, monkeypatch, caplog, place):
    """By a fault of ours, which the log tells; those that come after it are sent."""
    team.taking = False
    cluster = team.dispatch()
    bad, good = team.submit("sweep", team.ann, "a"), team.submit("sweep", team.ann, "a")

    def spoil(holder, name):
        usual = getattr(holder, name)

        def spoilt(job, *more):
            if job.startswith(bad):
                raise ValueError("secret detail")
            return usual(job, *more)

        monkeypatch.setattr(holder, name, spoilt)

    match place:
        case "gathered":
            spoil(team.store, "parts")
        case "submit":
            spoil(cluster, "meanwhile")
        case "parts":
            spoil(team.store, "part")
    team.taking = True
    if place == "parts":
        make(cluster, bad, "a")
    until(lambda: team.state(bad) == "failed")
    make(cluster, good, "a")
    until(lambda: good in cluster.tasks)
    cluster.end(good, "done", result={})
    until(lambda: team.state(good) == "done")
    error = team.store.jobs.get(team.ann, bad).error
    assert error["code"] == "internal"
    assert "(ValueError)" in error["detail"]
    assert "secret" not in error["detail"]
    assert "ValueError: secret detail" in caplog.text


@pytest.mark.parametrize("number", [errno.EMFILE, errno.ENOMEM, errno.ENOSPC, errno.EIO])
def test_a_job_is_sent_once_the_service_has_what_it_takes(team, number):
    """It is not the job's fault."""
    refusals = [OSError(number, "injected"), Unavailable("It is away.")]

    def refuse(name):
        if refusals:
            raise refusals.pop()

    cluster = team.dispatch()
    cluster.meanwhile = refuse
    fit = team.submit("fit", team.ann)
    until(lambda: fit in cluster.tasks)
    assert not refusals
    assert team.state(fit) == "queued"


@pytest.mark.parametrize("number", [errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.ENOSPC])
def test_a_part_waits_for_what_there_is_too_little_of(team, monkeypatch, number):
    """Files, memory, or room on the disk; the part is kept once there is enough again."""
    cluster = team.dispatch()
    job = team.submit("sweep", team.ann, "a")
    keep, refused = team.store.directory.keep, []

    def short(*told):
        refused.append(told)
        if len(refused) < 3:
            raise OSError(number, "injected")
        keep(*told)

    monkeypatch.setattr(team.store.directory, "keep", short)
    make(cluster, job, "a")
    until(lambda: job in cluster.tasks or team.store.jobs.get(team.ann, job).ended)
    assert cluster.kept.get(job) == {"a": b"a"}


def test_a_part_that_the_disk_lost_is_made_again(team):
    cluster = team.dispatch()
    job = team.submit("sweep", team.ann, "ab")
    make(cluster, job, "a")
    until(lambda: len(team.store.parts(job)) == 1)
    for name in list(team.store.directory.names()):
        team.store.directory.drop(name)
    make(cluster, job, "b")
    make(cluster, job, "a")
    until(lambda: job in cluster.tasks)
    assert cluster.kept[job] == {"a": b"a", "b": b"b"}


def test_a_task_that_stops_although_nobody_asked_is_sent_again(team):
    cluster = team.dispatch()
    fit = team.submit("fit", team.ann)
    until(lambda: fit in cluster.tasks)
    cluster.end(fit, "cancelled")
    until(lambda: fit in cluster.tasks)
    assert team.state(fit) == "queued"


def test_a_campaign_cancelled_before_it_is_gathered_has_the_drives_that_are_kept(team, monkeypatch):
    """Kept by a service that ended; the next has claimed it, and reads files yet."""
    first = team.dispatch()
    job = team.submit("campaign", team.ann, "abcd")
    make(first, job, "a")
    until(lambda: len(team.store.parts(job)) == 1)
    team.dispatchers.pop().close()
    gathering = Event()

    def payload(job):
        gathering.wait(10)
        return dict(job.spec)

    monkeypatch.setitem(KINDS, "campaign", replace(KINDS["campaign"], payload=payload))
    second = team.dispatch()
    until(lambda: team.store.jobs.get(team.ann, job).runner is not None)
    team.dispatchers[0].cancel(job)
    gathering.set()
    until(lambda: job in second.tasks)
    assert second.kept[job] == {"a": b"a"}


def test_a_campaign_cancelled_while_its_result_is_made_keeps_it(team):
    cluster = team.dispatch()
    job = team.submit("campaign", team.ann, "a")
    make(cluster, job, "a")
    until(lambda: job in cluster.tasks)
    fit = team.submit("fit", team.bob)
    until(lambda: fit in cluster.tasks)
    for one in (job, fit):
        team.dispatchers[0].cancel(one)
    until(lambda: fit in cluster.cancelled)
    assert cluster.cancelled == [fit]
    cluster.end(job, "done", result={"files": 1})
    until(lambda: team.state(job) == "done")


def test_a_session_is_not_kept_waiting_by_the_many_jobs_of_another(team):
    cluster = team.dispatch()
    for _ in range(4 * WIDTH):
        team.submit("sweep", team.ann, "abcdefgh")
    until(lambda: len(cluster.tasks) == WIDTH)
    until_sent(team, cluster, f"{team.submit('sweep', team.bob, 'x')}/x")


def test_a_job_of_a_kind_unknown_here_is_left_to_who_knows_it(team):
    """As of another version that shares the database."""
    later = team.store.jobs.add(team.ann, "later", {"asked": ""}, None, priority=9)[0].id
    cluster = team.dispatch()
    fit = team.submit("fit", team.ann)
    until(lambda: fit in cluster.tasks)
    assert team.store.jobs.get(team.ann, later).runner is None


@pytest.mark.parametrize("asked", ["before", "after"])
def test_a_campaign_cancelled_as_its_service_ends_has_the_drives_that_are_kept(team, asked):
    first = team.dispatch()
    job = team.submit("campaign", team.ann, "abcd")
    make(first, job, "a")
    until(lambda: len(team.store.parts(job)) == 1)
    if asked == "before":
        team.taking = False
        team.store.jobs.ask_to_cancel(team.ann, job)
    team.dispatchers.pop().close()
    if asked == "after":
        team.store.jobs.ask_to_cancel(team.ann, job)
    team.taking = True
    second = team.dispatch()
    until(lambda: job in second.tasks)
    assert second.kept[job] == {"a": b"a"}


def test_a_sweep_cancelled_without_a_service_ends_with_the_next(team):
    first = team.dispatch()
    job = team.submit("sweep", team.ann, "abcd")
    make(first, job, "a")
    until(lambda: len(team.store.parts(job)) == 1)
    team.dispatchers.pop().close()
    team.store.jobs.ask_to_cancel(team.ann, job)
    team.dispatch()
    until(lambda: team.state(job) == "cancelled")
    assert team.store.parts(job) == {}


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
