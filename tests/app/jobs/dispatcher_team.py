"""Dispatchers on one store, each with a stand-in cluster, and kinds of jobs to give them."""

from dataclasses import replace

import pytest
from ridetune.app.jobs import dispatcher, gatherer, jobs_under_way, lease_keeper
from ridetune.app.jobs.dispatcher import Dispatcher
from ridetune.app.jobs.kinds import PATIENT, Division, Kind
from ridetune.app.limits import Limits
from ridetune.app.storage.store import Store

from ..waiting import until
from .stand_in_cluster import StandIn

WIDTH = StandIn().width()


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
