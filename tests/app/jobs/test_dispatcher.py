"""Which job runs when: who shares the workers, and who goes first; the cluster is a stand-in."""

from ..waiting import until
from .dispatcher_team import WIDTH, Team, make
from .stand_in_cluster import StandIn

MEANWHILE = 5
"""Units that may end between a job's claim and its first unit: its payload is gathered."""


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


def test_a_session_is_not_kept_waiting_by_the_many_jobs_of_another(team):
    cluster = team.dispatch()
    for _ in range(4 * WIDTH):
        team.submit("sweep", team.ann, "abcdefgh")
    until(lambda: len(cluster.tasks) == WIDTH)
    until_sent(team, cluster, f"{team.submit('sweep', team.bob, 'x')}/x")


def test_slow_units_leave_a_worker_to_others(team):
    cluster = team.dispatch()
    slow = team.submit("campaign", team.ann, "abcd")
    until(lambda: len(cluster.tasks) == WIDTH - 1)
    fit = team.submit("fit", team.bob)
    until(lambda: fit in cluster.tasks)
    cluster.end(fit, "done", result={})
    until(lambda: team.state(fit) == "done")
    assert set(cluster.tasks) == {f"{slow}/a", f"{slow}/b"}


def test_a_job_of_a_kind_unknown_here_is_left_to_who_knows_it(team):
    """As of another version that shares the database."""
    later = team.store.jobs.add(team.ann, "later", {"asked": ""}, None, priority=9)[0].id
    cluster = team.dispatch()
    fit = team.submit("fit", team.ann)
    until(lambda: fit in cluster.tasks)
    assert team.store.jobs.get(team.ann, later).runner is None
