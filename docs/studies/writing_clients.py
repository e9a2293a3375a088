"""Clients that write down what the service acknowledged, and what their jobs should give.

Part of `kills.py`.
"""

import hashlib
import json
import math
import random
import threading
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import httpx2
from killed_service import Service
from ridetune.app.bench.service.work import ENDS, head_of
from ridetune.app.package_files import package_folder
from websockets.exceptions import ConnectionClosed, WebSocketException
from websockets.sync.client import connect

TOLERANCE = 1e-6
"""Relative, of numbers of a result: a fit that goes on from kept parts may differ in rounding."""

ANEW = {"id", "seconds", "sha256", "bytes", "date", "ridetune", "files", "name", "made"}
"""Keys of a result that are others each time."""

RECORDING = (package_folder("sample_runs") / "detailed/manoeuvre_1.csv").read_bytes()


@dataclass(frozen=True)
class Kind:
    """A kind of job: where it is posted, and what of it, given a session's recordings and fit."""

    place: str
    body: Mapping[str, Any]
    needs_fit: bool = False


FAULT = 1011
"""What a websocket is closed with where the service failed."""
MOST_UNDER_WAY = 10
"""Jobs of one client at a time: what kills put off must still be done at the end."""

SIMULATION = {"manoeuvre": "bump", "max_samples": 2}
RANGES = {"K_F": [15_000, 40_000], "C_F": [800, 3000]}
KINDS = {
    "identification": Kind("identifications", {"starts": 4, "seed": 1}),
    "sweep": Kind(
        "sweeps",
        {
            "design": {"kind": "sobol", "ranges": RANGES, "cars": 8000, "seed": 2},
            "manoeuvre": "bump",
            "duration": 2,
        },
    ),
    "campaign": Kind("campaigns", {"manoeuvres": ["bump", "1"], "seed": 3}),
    "profile": Kind("profiles", {"parameter": "K_F"}, needs_fit=True),
    "validation": Kind("validations", {}, needs_fit=True),
}


@dataclass
class Session:
    """What was acknowledged of one session; `cars` are the names that its car may have."""

    id: str
    token: str
    uploads: dict[str, bytes] = field(default_factory=dict)
    cars: list[str] = field(default_factory=list)
    jobs: dict[tuple[str, str], None] = field(default_factory=dict)
    samples: list[str] = field(default_factory=list)
    vehicle: dict[str, Any] = field(default_factory=dict)
    fit: str = ""

    def request(self, service: Service, method: str, path: str = "", **options: Any):
        """The reply to a request below the session."""
        return httpx2.request(
            method,
            f"{service.address}/api/sessions/{self.id}{path}",
            headers={"Authorization": f"Bearer {self.token}"},
            timeout=60.0,
            verify=False,  # else it reads all certificates first
            **options,
        )

    def dragged(self, service: Service, *bodies: Mapping[str, Any]) -> dict[str, Any]:
        """The answer to the last of some simulations on their websocket: a head, or a problem."""
        address = service.address.replace("http", "ws")
        with connect(
            f"{address}/api/sessions/{self.id}/simulations",
            additional_headers={"Authorization": f"Bearer {self.token}"},
            max_size=None,
            proxy=None,
        ) as socket:
            for seq, body in enumerate(bodies):
                socket.send(json.dumps({**body, "seq": seq}))
            while True:
                answer = socket.recv(60.0)
                told = json.loads(answer) if isinstance(answer, str) else head_of(answer)
                if told["seq"] == len(bodies) - 1:
                    return told

    def has_ended(self, service: Service, kind: str, job: str) -> bool:
        """Whether a job has come to its end."""
        reply = self.request(service, "GET", f"/{KINDS[kind].place}/{job}")
        return reply.status_code == 200 and reply.json()["state"] in ENDS

    def body(self, kind: str) -> dict[str, Any]:
        """The request of a job of this session."""
        told = dict(KINDS[kind].body)
        if kind == "identification":
            told["runs"] = self.samples
        if KINDS[kind].needs_fit:
            told["identification"] = self.fit
        if not KINDS[kind].needs_fit:
            # Whatever car the session has by then.
            told["vehicle"] = self.vehicle
        return told


@dataclass
class Ledger:
    """All that was acknowledged, by whichever client."""

    sessions: list[Session] = field(default_factory=list)
    in_doubt: int = 0
    simulations: int = 0
    failures: list[str] = field(default_factory=list)
    figures: list[dict[str, Any]] = field(default_factory=list)

    def simulated(self, metrics: list[dict[str, Any]]) -> None:
        """Compare a simulation of the untouched car with the first one."""
        self.simulations += 1
        self.figures = self.figures or metrics
        if difference := _difference(self.figures, metrics, "metrics"):
            self.failures.append(f"a simulation: {difference}")

    def counts(self) -> Counter[str]:
        """How much there is of what."""
        return Counter(
            sessions=len(self.sessions),
            uploads=sum(len(one.uploads) for one in self.sessions),
            simulations=self.simulations,
            jobs=sum(len(one.jobs) for one in self.sessions),
        )


class Client(threading.Thread):
    """Does something else all the time until it is told to stop."""

    def __init__(self, service: Service, ledger: Ledger, stop: threading.Event, seed: int):
        super().__init__(daemon=True)
        self._service, self._ledger, self._over = service, ledger, stop
        self._chance = random.Random(seed)
        self._session: Session | None = None
        self._under_way: list[tuple[Session, str, str]] = []
        self._number = 1000 * seed

    def run(self) -> None:
        """Go on, whether the service answers or not."""
        while not self._over.is_set():
            self._number += 1
            try:
                if self._session is None or self._chance.random() < 0.05:
                    self._session = opened(self._service)
                    self._ledger.sessions.append(self._session)
                else:
                    self._something(self._session)
            except (httpx2.HTTPError, WebSocketException, OSError) as error:
                self._ledger.in_doubt += 1
                if isinstance(error, ConnectionClosed) and error.rcvd and error.rcvd.code == FAULT:
                    self._ledger.failures.append(f"a websocket: {error}")
                time.sleep(0.1)
            time.sleep(self._chance.uniform(0.0, 0.1))

    def _something(self, session: Session) -> None:
        what = self._chance.random()
        if what < 0.3:
            data = RECORDING + b"\n" * (self._number % 5000)
            path = f"/measurements?name=run-{self._number}.csv"
            reply = session.request(self._service, "POST", path, content=data)
            if self._took(reply):
                session.uploads[reply.json()["id"]] = data
        elif what < 0.4:
            body = {**SIMULATION, "vehicle": session.vehicle}
            answer = session.dragged(self._service, *[body] * 3)
            if "metrics" in answer:
                self._ledger.simulated(answer["metrics"])
            elif answer["status"] not in (429, 503):
                self._ledger.failures.append(f"{answer['status']}: {answer['detail']}")
        elif what < 0.5:
            body = {**SIMULATION, "vehicle": session.vehicle}
            reply = session.request(self._service, "POST", "/simulations", json=body)
            if self._took(reply):
                self._ledger.simulated(reply.json()["metrics"])
        elif what < 0.7:
            name = f"car {self._number}"
            # It may have been put though nobody says so.
            session.cars.append(name)
            car = {**session.vehicle, "name": name}
            if self._took(session.request(self._service, "PUT", "/vehicle", json=car)):
                session.cars[:] = [name]
        else:
            self._ask_for_a_job(session)

    def _ask_for_a_job(self, session: Session) -> None:
        """Of any kind, unless enough are under way."""
        self._under_way = [
            (whose, kind, job)
            for whose, kind, job in self._under_way
            if not whose.has_ended(self._service, kind, job)
        ]
        if len(self._under_way) >= MOST_UNDER_WAY:
            return
        if not session.fit:
            self._look_for_fit(session)
        kinds = [kind for kind, one in KINDS.items() if session.fit or not one.needs_fit]
        kind = self._chance.choice(kinds)
        key = {"key": str(self._number)}
        path = f"/{KINDS[kind].place}"
        reply = session.request(self._service, "POST", path, json=session.body(kind) | key)
        if self._took(reply):
            job = reply.json()["id"]
            session.jobs[kind, job] = None
            self._under_way.append((session, kind, job))

    def _look_for_fit(self, session: Session) -> None:
        known = session.request(self._service, "GET", "/identifications").json()
        session.fit = next((one["id"] for one in known if one["state"] == "done"), "")

    def _took(self, reply: Any) -> bool:
        if reply.status_code in (429, 503):
            time.sleep(0.2)
        elif reply.status_code >= 300:
            self._ledger.failures.append(f"{reply.status_code}: {reply.text[:200]}")
        return reply.status_code < 300


def opened(service: Service) -> Session:
    """A fresh session."""
    made = httpx2.post(f"{service.address}/api/sessions", timeout=60.0)
    made.raise_for_status()
    session = Session(made.json()["id"], made.json()["token"])
    session.samples = [one["id"] for one in session.request(service, "GET", "/measurements").json()]
    session.vehicle = session.request(service, "GET", "/vehicle").json()
    session.cars = [session.vehicle["name"]]
    return session


class Reference:
    """What every job gives where nobody disturbs it."""

    def __init__(self, service: Service):
        session = opened(service)
        self._expected: dict[str, Any] = {}
        for kind in KINDS:
            job = session.request(
                service, "POST", f"/{KINDS[kind].place}", json=session.body(kind)
            ).json()
            while job["state"] in ("queued", "running"):
                time.sleep(0.05)
                path = f"/{KINDS[kind].place}/{job['id']}"
                job = session.request(service, "GET", path).json()
            if job["state"] != "done":
                raise SystemExit(f"The {kind} {job['state']}: {job['error']}")
            if kind == "identification":
                session.fit = job["id"]
            self._expected[kind] = outcome(service, session, kind, job)

    def differences(self, kind: str, job: str, found: Any) -> list[str]:
        """The first difference of a result from what is expected, or nothing."""
        place = _difference(self._expected[kind], found, "result")
        return [f"{kind} {job}: {place}"] if place else []


def outcome(service: Service, session: Session, kind: str, job: Mapping[str, Any]) -> Any:
    """What a job that is done gave: its result, and digests of files that are always the same."""
    told = {"result": job["result"]}
    if kind == "sweep":
        rows = session.request(service, "GET", f"/sweeps/{job['id']}/cars.csv").content
        told["rows"] = hashlib.sha256(rows).hexdigest()
    if kind == "campaign":
        files = session.request(service, "GET", f"/campaigns/{job['id']}/files").json()
        told["digests"] = {
            one["name"]: one["sha256"] for one in files if one["name"].endswith(".csv")
        }
    return json.loads(json.dumps(told))


def _difference(expected: Any, found: Any, place: str) -> str:
    """Where two results differ, "" where they do not."""
    if isinstance(expected, dict) and isinstance(found, dict):
        if expected.keys() != found.keys():
            return f"{place}: {sorted(expected.keys() ^ found.keys())}"
        pairs = [(key, expected[key], found[key]) for key in expected if key not in ANEW]
        told = place == "result.digests"
        pairs += [(key, expected[key], found[key]) for key in expected if key in ANEW and told]
        parts = (_difference(one, other, f"{place}.{key}") for key, one, other in pairs)
        return next((part for part in parts if part), "")
    if isinstance(expected, list) and isinstance(found, list):
        if len(expected) != len(found):
            return f"{place}: {len(found)} in place of {len(expected)}"
        parts = (
            _difference(one, other, f"{place}[{k}]")
            for k, (one, other) in enumerate(zip(expected, found, strict=True))
        )
        return next((part for part in parts if part), "")
    if isinstance(expected, float) and isinstance(found, int | float):
        close = math.isclose(expected, found, rel_tol=TOLERANCE, abs_tol=1e-12)
        return "" if close else f"{place}: {found} in place of {expected}"
    return "" if expected == found else f"{place}: {found!r} in place of {expected!r}"
