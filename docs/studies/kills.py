"""Is everything that was acknowledged still there after kill -9, and every job done?

    python docs/studies/kills.py [--kills N] [--seconds S] [--seed N] [--database URL] [--cluster]

Clients create sessions, upload, change cars, simulate and submit jobs of every kind, and write down
what the service acknowledged. Meanwhile something dies every now and then, in turn: the service
with all its processes, one worker, the serving process alone, one of the processes that simulate;
with --cluster, where scheduler and workers are processes of their own, the scheduler too. What was
killed is started again. At the end all that was acknowledged is compared with what is there:
uploads byte for byte, cars as they were last put, jobs done with the result that the same request
has from a service which nobody disturbed; and every simulation with the first one. Needs the
packages of the tests. Status 1 if anything is missing, wrong, stuck or left behind.
"""

import argparse
import random
import sys
import tempfile
import threading
import time
from collections import Counter
from pathlib import Path
from statistics import median

import psutil

sys.path.insert(0, str(Path(__file__).parent))

from killed_service import Cluster, Service
from writing_clients import KINDS, Client, Ledger, Reference, outcome

CLIENTS = 3
STILL_SECONDS = 120.0
"""Time in which no job may change for those that have not ended to count as stuck, s."""
STRAY_SECONDS = 10.0


def main() -> int:
    """Kill, start again, compare; 1 if anything was found."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=8.0, help="between kills, at most")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--database", default="", metavar="URL")
    parser.add_argument("--cluster", action="store_true")
    options = parser.parse_args()
    chance = random.Random(options.seed)
    with tempfile.TemporaryDirectory(prefix="ridetune-kills-") as folder:
        place = Path(folder)
        print("Computing every result once, undisturbed.", flush=True)
        undisturbed = Service(place / "undisturbed")
        try:
            reference = Reference(undisturbed)
        finally:
            undisturbed.stop()
        cluster = Cluster(place) if options.cluster else None
        service = Service(place / "data", database=options.database, cluster=cluster)
        try:
            return _tried(options, chance, service, cluster, reference)
        finally:
            service.kill_group()
            if cluster is not None:
                cluster.close()


def _tried(
    options: argparse.Namespace,
    chance: random.Random,
    service: Service,
    cluster: Cluster | None,
    reference: Reference,
) -> int:
    ledger, stop = Ledger(), threading.Event()
    clients = [Client(service, ledger, stop, options.seed + 1 + k) for k in range(CLIENTS)]
    for client in clients:
        client.start()
    targets = ["service group", "worker", "service process", "simulator"]
    targets += ["scheduler"] * options.cluster
    killed: Counter[str] = Counter()
    ready: list[float] = []
    strays: list[str] = []
    turn = 0
    while killed.total() < options.kills:
        time.sleep(chance.uniform(0.2, options.seconds))
        target = targets[turn % len(targets)]
        turn += 1
        before = service.tree() + (cluster.tree() if cluster else [])
        if target == "service group":
            service.kill_group()
        elif target == "service process":
            service.kill()
        elif target == "scheduler" and cluster is not None:
            cluster.kill_scheduler()
        elif some := [one for one in before if _is(service, one, target)]:
            chance.choice(some).kill()
        else:
            continue
        killed[target] += 1
        if target.startswith("service"):
            if cluster is None:
                gone, alive = psutil.wait_procs(before, timeout=STRAY_SECONDS)
                strays += [f"{target}: {one.pid} {one.name()}" for one in alive]
            ready.append(service.start())
    stop.set()
    for client in clients:
        client.join()
    began = time.monotonic()
    _settle(service, ledger)
    settled = time.monotonic() - began
    missing, wrong, stuck, states = _compared(service, ledger, reference)
    left = service.left_behind()
    before = service.tree()
    service.stop()
    _, alive = psutil.wait_procs(before, timeout=STRAY_SECONDS)
    strays += [f"after the end: {one.pid} {one.name()}" for one in alive]
    rows = [
        ("killed", ", ".join(f"{n} {what}" for what, n in killed.items())),
        ("ready again, s", f"{median(ready):.2f}, at most {max(ready):.2f}" if ready else "-"),
        ("acknowledged", ", ".join(f"{n} {what}" for what, n in ledger.counts().items())),
        ("in doubt when killed", str(ledger.in_doubt)),
        ("jobs", ", ".join(f"{n} {state}" for state, n in states.items())),
        ("until all had ended, s", f"{settled:.0f}"),
        *((name, str(len(found))) for name, found in (
            ("missing", missing), ("wrong", wrong), ("stuck", stuck),
            ("refused with 500", ledger.failures), ("stray processes", strays),
            ("stray files", left))),
    ]  # fmt: skip
    for name, value in rows:
        print(f"{name:24} {value}")
    findings = [*missing, *wrong, *stuck, *ledger.failures, *strays, *left]
    for finding in findings:
        print("FINDING", finding)
    return int(bool(findings))


def _is(service: Service, process: psutil.Process, target: str) -> bool:
    return service.is_worker(process) if target == "worker" else service.is_simulator(process)


def _settle(service: Service, ledger: Ledger) -> None:
    """Wait until every job has ended, or nothing has changed for long."""
    seen, changed = "", time.monotonic()
    while time.monotonic() - changed < STILL_SECONDS:
        now = [
            (job["id"], job["state"], job["progress"])
            for session in ledger.sessions
            for kind in {kind for kind, _ in session.jobs}
            for job in session.request(service, "GET", f"/{KINDS[kind].place}").json()
        ]
        if not any(state in ("queued", "running") for _, state, _ in now):
            return
        if str(now) != seen:
            seen, changed = str(now), time.monotonic()
        time.sleep(1.0)


def _compared(
    service: Service, ledger: Ledger, reference: Reference
) -> tuple[list[str], list[str], list[str], Counter[str]]:
    """What is missing, wrong and stuck of what was acknowledged, and the states of jobs."""
    missing: list[str] = []
    wrong: list[str] = []
    stuck: list[str] = []
    states: Counter[str] = Counter()
    for session in ledger.sessions:
        if session.request(service, "GET").status_code != 200:
            missing.append(f"session {session.id}")
            continue
        for upload, data in session.uploads.items():
            reply = session.request(service, "GET", f"/measurements/{upload}/original")
            if reply.status_code != 200:
                missing.append(f"upload {upload}: {reply.status_code}")
            elif reply.content != data:
                wrong.append(f"upload {upload}")
        name = session.request(service, "GET", "/vehicle").json()["name"]
        if name not in session.cars:
            wrong.append(f"car of {session.id}: {name}, not {session.cars}")
        for (kind, job), _ in session.jobs.items():
            path = f"/{KINDS[kind].place}/{job}"
            reply = session.request(service, "GET", path)
            if reply.status_code != 200:
                missing.append(f"{kind} {job}: {reply.status_code}")
                continue
            found = reply.json()
            states[found["state"]] += 1
            if found["state"] == "done":
                wrong += reference.differences(kind, job, outcome(service, session, kind, found))
            elif found["state"] in ("queued", "running"):
                stuck.append(f"{kind} {job}: {found['state']}")
            else:
                wrong.append(f"{kind} {job}: {found['state']}, {found['error']}")
    return missing, wrong, stuck, states


if __name__ == "__main__":
    sys.exit(main())
