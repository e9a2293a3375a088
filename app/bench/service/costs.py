"""Rows on what sessions, moves, jobs and uploads take of the machine."""

import asyncio
import json
import time
from collections.abc import Sequence
from contextlib import closing
from importlib.metadata import version

from websockets.asyncio.client import ClientConnection

from ...package_files import package_folder
from .connection import FRAMES, Connection
from .figure import Figure, Measured
from .pace import Pace
from .subject import Subject, Visitor
from .work import asked_once, ended, head_of, identification, move, moved, sweep, vehicle_of

IDLE_SESSIONS, IDLE_TARGET = 200, 1e9
UNWATCHED_SECONDS = 2.0
STREAMS = 100
LINEAR = 1.15
"""Cost per car of the larger sweep over that of the smaller one, up to which it is taken for
proportional."""


async def idle(pace: Pace) -> Measured:
    """Sessions that opened their page and do nothing: tabs still there, then half of them gone."""
    with closing(Subject({"unwatched_seconds": UNWATCHED_SECONDS})) as subject:
        await subject.ready()
        fresh = subject.memory
        first, *others = await subject.visitors(pace.sessions)
        tabs = [await _opened(subject, first)]
        one = subject.memory
        tabs += [await _opened(subject, visitor) for visitor in others]
        there = subject.memory
        gone = tabs[: len(tabs) // 2]
        await _closed(gone)
        await asyncio.sleep(3 * UNWATCHED_SECONDS)
        half = subject.memory
        await _closed(tabs[len(gone) :])
        await asyncio.sleep(3 * UNWATCHED_SECONDS)
        none = subject.memory
    most = IDLE_TARGET if pace.sessions >= IDLE_SESSIONS else None
    return Measured(
        f"{pace.sessions} sessions that opened their page and its 3D view",
        (
            Figure("fresh service", fresh, "B"),
            Figure("one tab", one, "B"),
            Figure("all tabs", there, "B", most),
            Figure("half of the tabs", half, "B", most),
            Figure("no tab", none, "B"),
            Figure("a further session with its tab", (there - one) / len(others), "B"),
        ),
    )


Tab = tuple[ClientConnection, ...]
"""The websockets of an open page."""


async def _closed(tabs: Sequence[Tab]) -> None:
    for tab in tabs:
        for socket in tab:
            await socket.close()


async def _opened(subject: Subject, visitor: Visitor) -> Tab:
    """What a browser asks for when a page opens, its websockets last."""
    connection = Connection(subject.port)
    vehicle = await vehicle_of(subject, visitor)
    try:
        session = (await connection.wanted(visitor.request("GET"))).json
        for one in session["measurements"]:
            path = f"/measurements/{one['id']}/frames?max_samples=4001"
            await connection.wanted(visitor.request("GET", path, accept=FRAMES))
        await connection.wanted(move(visitor, vehicle, 0, scene=True))
    finally:
        connection.close()
    moves = await subject.socket(f"/api/sessions/{visitor.id}/simulations", visitor)
    await moves.send(json.dumps(moved(vehicle, 0)))
    head_of(await moves.recv())
    scene = await subject.socket(f"/s/{visitor.id}/viewer", visitor, f"viser-v{version('viser')}")
    await scene.recv()
    return moves, scene


async def session(pace: Pace) -> Measured:
    """Sessions that a program opened."""
    with closing(Subject()) as subject:
        await subject.ready()
        await subject.visitors(5)
        memory, disk, time_taken = subject.memory, subject.disk, subject.processor
        await subject.visitors(pace.sessions)
        share = 1 / pace.sessions
        figures = (
            Figure("memory", (subject.memory - memory) * share, "B"),
            Figure("disk", (subject.disk - disk) * share, "B"),
            Figure("processor", (subject.processor - time_taken) * share, "s"),
        )
    return Measured(f"one of {pace.sessions} sessions with the sample project", figures)


async def slider_move(pace: Pace) -> Measured:
    """One request of a slider after the other."""
    with closing(Subject()) as subject:
        await subject.ready()
        visitor = await subject.visitor()
        vehicle, connection = await vehicle_of(subject, visitor), Connection(subject.port)
        for number in range(20):
            await connection.wanted(move(visitor, vehicle, number))
        count, began = 0, time.perf_counter()
        spent, own = subject.processor, subject.own_processor
        until, size = began + pace.seconds / 3, 0
        while time.perf_counter() < until:
            size = len((await connection.wanted(move(visitor, vehicle, count))).body)
            count += 1
        took, spent, own = (
            time.perf_counter() - began,
            subject.processor - spent,
            subject.own_processor - own,
        )
        connection.close()
    figures = (
        Figure("processor", spent / count, "s"),
        Figure("of which the serving process", own / count, "s"),
        Figure("request to reply", took / count, "s"),
        Figure("reply", size, "B"),
    )
    return Measured("one slider move, nobody else about", figures)


async def identify(pace: Pace) -> Measured:
    """The paper's identification, workers already there."""
    with closing(Subject()) as subject:
        await subject.ready()
        visitor = await subject.visitor()
        asked = await identification(subject, visitor)
        simulators = subject.memory - subject.own_memory
        await ended(subject, visitor, "identifications", asked)
        workers = subject.memory - subject.own_memory - simulators
        began, spent = time.perf_counter(), subject.processor
        for _ in range(pace.repetitions):
            await ended(subject, visitor, "identifications", asked)
        took, spent = time.perf_counter() - began, subject.processor - spent
    figures = (
        Figure("processor", spent / pace.repetitions, "s"),
        Figure("asked to done", took / pace.repetitions, "s"),
        Figure("memory of the workers", workers, "B"),
    )
    return Measured("one identification of 12 parameters from both sample runs", figures)


async def swept(pace: Pace) -> Measured:
    """Sweeps of two sizes, which tell whether the cost is proportional."""
    small, large = pace.cars // 10, pace.cars
    with closing(Subject()) as subject:
        await subject.ready()
        visitor = await subject.visitor()
        await ended(subject, visitor, "sweeps", sweep(small, seed=1))
        spent: list[float] = []
        took: list[float] = []
        for cars in (small, large):
            disk, began, before = subject.disk, time.perf_counter(), subject.processor
            await ended(subject, visitor, "sweeps", sweep(cars))
            took.append(time.perf_counter() - began)
            spent.append(subject.processor - before)
            disk = subject.disk - disk
    growth = (spent[1] / large) / (spent[0] / small)
    million = [Figure("processor of 1e6 cars", 1e6 * spent[1] / large, "s")] * (growth < LINEAR)
    figures = (
        Figure(f"processor of {large} cars", spent[1], "s"),
        Figure(f"asked to done of {large} cars", took[1], "s"),
        Figure(f"cost per car over that of {small}", growth, "", most=LINEAR),
        *million,
    )
    return Measured("a sweep over a bump of 2 s, every figure of every car", figures)


async def stream(_: Pace) -> Measured:
    """Event streams of a job that waits."""
    with closing(Subject()) as subject:
        await subject.ready()
        visitor = await subject.visitor()
        ids: list[str] = []
        for seed in range(4):
            asked = visitor.request("POST", "/sweeps", sweep(100_000, seed))
            ids.append((await asked_once(subject, asked, 202)).json["id"])
        path = f"/sweeps/{ids[-1]}/events"
        streams = [Connection(subject.port) for _ in range(STREAMS + 1)]
        await streams[-1].begin(visitor.request("GET", path, accept="text/event-stream"))
        before = subject.own_memory
        for one in streams[:-1]:
            await one.begin(visitor.request("GET", path, accept="text/event-stream"))
        after = subject.own_memory
        for one in streams:
            one.close()
    what = f"one of {STREAMS} event streams of a job"
    return Measured(what, (Figure("memory", (after - before) / STREAMS, "B"),))


async def upload(pace: Pace) -> Measured:
    """Uploads of a sample recording, each with other bytes."""
    recording = (package_folder("sample_runs") / "detailed/manoeuvre_1.csv").read_bytes()
    count = min(40, 8 * pace.repetitions)
    with closing(Subject()) as subject:
        await subject.ready()
        visitor, connection = await subject.visitor(), Connection(subject.port)
        await _upload(connection, visitor, recording, range(1))
        memory, disk = subject.own_memory, subject.disk
        began, spent = time.perf_counter(), subject.processor
        await _upload(connection, visitor, recording, range(1, 1 + count))
        took, spent = time.perf_counter() - began, subject.processor - spent
        connection.close()
        figures = (
            Figure("processor", spent / count, "s"),
            Figure("request to reply", took / count, "s"),
            Figure("memory", (subject.own_memory - memory) / count, "B"),
            Figure("disk", (subject.disk - disk) / count, "B"),
        )
    return Measured(f"one of {count} uploads of {len(recording) / 1e6:.2g} MB of CSV", figures)


async def _upload(
    connection: Connection, visitor: Visitor, recording: bytes, numbers: Sequence[int]
) -> None:
    for number in numbers:
        data = recording + b"\n" * number
        path = f"/measurements?name=run-{number}.csv"
        await connection.wanted(visitor.request("POST", path, data), 201)
