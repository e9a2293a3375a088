"""Rows on what people wait for while others keep the service busy."""

import asyncio
import time
from contextlib import closing
from itertools import count

from .connection import Connection, request
from .figure import Figure, Measured, percentiles
from .hand import Hand
from .pace import Pace
from .subject import Subject, Visitor
from .work import MANOEUVRE, identification, move, sweep, under_way, vehicle_of

SLIDERS, MOVES_A_SECOND = 10, 20.0
SLIDER_TARGET = 0.1
SWEPT = 20_000

SIMULATING, ASKING = 32, 8
HELLO_TARGET, HELLOS_TARGET = 0.02, 2000.0

RESTARTED_SESSIONS, RESTARTED_JOBS = 200, 500
RESTART_TARGET = 2.0


async def slider(pace: Pace) -> Measured:
    """People who drag sliders while others identify and sweep."""
    with closing(Subject()) as subject:
        await subject.ready()
        one, other, *people = await subject.visitors(2 + SLIDERS)
        fit = await identification(subject, one)
        work = [
            (one, "identifications", fit),
            (one, "identifications", fit),
            (other, "sweeps", sweep(SWEPT)),
        ]
        hands = [Hand(subject, person, await vehicle_of(subject, person)) for person in people]
        async with under_way(subject, *work) as counts:
            await asyncio.gather(
                *(
                    one.drag(MOVES_A_SECOND, k / SLIDERS, pace.seconds)
                    for k, one in enumerate(hands)
                )
            )
            done = ", ".join(f"{number} {jobs}" for jobs, number in counts.items())
    replies = [wait for one in hands for wait in one.answered]
    moves = [wait for one in hands for wait in one.known]
    what = (
        f"{SLIDERS} people move a slider {MOVES_A_SECOND:g} times a second (manoeuvre {MANOEUVRE},"
        f" 20 s) for {pace.seconds:g} s; {done} meanwhile"
    )
    return Measured(
        what,
        (
            *percentiles("value to its reply", replies, p95=SLIDER_TARGET),
            *percentiles("move to a reply that knows it", moves),
            Figure("replies", len(replies) / pace.seconds, "1/s"),
        ),
    )


async def hello(pace: Pace) -> Measured:
    """Small requests while every core simulates."""
    with closing(Subject()) as subject:
        await subject.ready()
        visitor, *busy = await subject.visitors(1 + SIMULATING)
        tasks = [asyncio.create_task(_simulating(subject, one)) for one in busy]
        asked = {
            "/healthz": request("GET", "/healthz"),
            "the car": visitor.request("GET", "/vehicle"),
        }
        figures: list[Figure] = []
        try:
            await asyncio.sleep(1.0)
            for name, small in asked.items():
                until = time.perf_counter() + pace.seconds / 2
                replies = await asyncio.gather(
                    *(_repeated(subject, small, until) for _ in range(ASKING))
                )
                waits = [wait for one in replies for wait in one]
                rate = len(waits) / (pace.seconds / 2)
                figures.append(Figure(name, rate, "1/s", least=HELLOS_TARGET))
                figures += percentiles(name, waits, p99=HELLO_TARGET)
        finally:
            for task in tasks:
                task.cancel()
            ended = await asyncio.gather(*tasks, return_exceptions=True)
        for one in ended:
            if isinstance(one, Exception):
                raise one
    what = f"{ASKING} connections ask for something small while {SIMULATING} clients simulate"
    return Measured(what, tuple(figures))


async def _simulating(subject: Subject, visitor: Visitor) -> None:
    """One who simulates without a pause."""
    connection, vehicle = Connection(subject.port), await vehicle_of(subject, visitor)
    try:
        for number in count():
            await connection.wanted(move(visitor, vehicle, number))
    finally:
        connection.close()


async def _repeated(subject: Subject, request: bytes, until: float) -> list[float]:
    """Seconds of each of a row of requests."""
    connection, waits = Connection(subject.port), []
    try:
        while (now := time.perf_counter()) < until:
            await connection.wanted(request)
            waits.append(time.perf_counter() - now)
    finally:
        connection.close()
    return waits


async def restart(pace: Pace) -> Measured:
    """A killed service until it simulates again, with much kept and jobs under way."""
    sessions, jobs = RESTARTED_SESSIONS, RESTARTED_JOBS
    with closing(Subject()) as subject:
        await subject.ready()
        visitors = await subject.visitors(sessions)
        await asyncio.gather(
            *(_small_jobs(subject, visitors[k::20], jobs // 20) for k in range(20))
        )
        fit = await identification(subject, visitors[0])
        connection = Connection(subject.port)
        for _ in range(2):
            taken = visitors[0].request("POST", "/identifications", {**fit, "starts": 64})
            await connection.wanted(taken, 202)
        connection.close()
        seconds = []
        for _ in range(pace.repetitions):
            subject.kill()
            subject.start()
            seconds.append(await subject.ready())
    what = f"after kill -9, until /readyz: {sessions} sessions, {jobs} jobs, 2 of them under way"
    return Measured(
        what,
        (
            Figure("median", sorted(seconds)[len(seconds) // 2], "s", most=RESTART_TARGET),
            Figure("longest", max(seconds), "s"),
        ),
    )


async def _small_jobs(subject: Subject, visitors: list[Visitor], jobs: int) -> None:
    """Sweeps of one car, kept: so many by a few sessions, one after the other."""
    connection = Connection(subject.port)
    try:
        for number in range(jobs):
            visitor = visitors[number % len(visitors)]
            taken = await connection.wanted(visitor.request("POST", "/sweeps", sweep(1)), 202)
            look = visitor.request("GET", f"/sweeps/{taken.json['id']}")
            while (await connection.wanted(look)).json["state"] != "done":
                await asyncio.sleep(0.05)
    finally:
        connection.close()
