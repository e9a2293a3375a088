"""What the service is asked to do: simulations as a slider asks for them, and jobs."""

import asyncio
import json
import struct
import time
from collections.abc import Mapping
from contextlib import asynccontextmanager
from typing import Any

from .connection import FRAMES, Connection, Unexpected
from .subject import PATIENCE, Subject, Visitor

MANOEUVRE = "2"
"""What the cars of the sliders drive: 20 s over a random road with braking."""

CORNERS = ("fl", "fr", "rl", "rr")
POSES = ("chassis.x", "chassis.z", "chassis.pitch", "chassis.roll")
PARTS = ("arm.{}.angle", "wheel.{}.z", "road.{}.z", "post.{}.z")
CHANNELS = [*POSES, *(part.format(corner) for corner in CORNERS for part in PARTS)]
"""What the page asks for while its first charts are shown: the channels of a pose."""

SAMPLES = 2001
RANGES = {
    "front.suspension.stiffness": [15e3, 40e3],
    "front.suspension.damping": [800.0, 3000.0],
    "rear.pivot.distance": [0.8, 2.0],
}
SWEPT_SECONDS = 2.0
ENDS = ("done", "failed", "cancelled")
LOOK_EVERY = 0.1


async def vehicle_of(subject: Subject, visitor: Visitor) -> dict[str, Any]:
    """The session's car, which the page sends with every simulation."""
    return (await asked_once(subject, visitor.request("GET", "/vehicle"))).json


def move(visitor: Visitor, vehicle: Mapping[str, Any], number: int, **more: Any) -> bytes:
    """The request of one slider move, each with a value of its own."""
    return visitor.request("POST", "/simulations", moved(vehicle, number, **more), FRAMES)


def moved(vehicle: Mapping[str, Any], number: int, **more: Any) -> dict[str, Any]:
    """The body of one slider move."""
    return {
        "vehicle": vehicle,
        "values": {"front.suspension.stiffness": 20_000.0 + number % 1000},
        "manoeuvre": MANOEUVRE,
        "lift_off": False,
        "max_samples": SAMPLES,
        "decimate": "stride",
        "seq": number,
        "channels": CHANNELS,
        **more,
    }


def head_of(reply: str | bytes) -> dict[str, Any]:
    """What a simulation's reply tells before its histories; `Unexpected` where it is a problem."""
    if isinstance(reply, str):
        raise Unexpected(f"The service answered a move with {reply[:300]}.")
    (length,) = struct.unpack_from("<I", reply)
    return json.loads(reply[4 : 4 + length])


async def identification(subject: Subject, visitor: Visitor) -> dict[str, Any]:
    """The request of the paper's twelve parameters from both sample recordings."""
    known = (await asked_once(subject, visitor.request("GET", "/measurements"))).json
    return {"runs": [one["id"] for one in known]}


def sweep(cars: int, seed: int = 0) -> dict[str, Any]:
    """The request of a sweep of cars over a bump."""
    design = {"kind": "sobol", "ranges": RANGES, "cars": cars, "seed": seed}
    return {"design": design, "manoeuvre": "bump", "duration": SWEPT_SECONDS}


async def asked_once(subject: Subject, request: bytes, *statuses: int):
    """The answer to a request on a connection of its own."""
    connection = Connection(subject.port)
    try:
        return await connection.wanted(request, *statuses)
    finally:
        connection.close()


async def ended(
    subject: Subject, visitor: Visitor, jobs: str, asked: Mapping[str, Any]
) -> dict[str, Any]:
    """A job of a kind, such as "sweeps", once it is done."""
    connection, began = Connection(subject.port), time.perf_counter()
    try:
        taken = await connection.wanted(visitor.request("POST", f"/{jobs}", asked), 202)
        look = visitor.request("GET", f"/{jobs}/{taken.json['id']}")
        while (job := (await connection.wanted(look)).json)["state"] not in ENDS:
            if time.perf_counter() - began > PATIENCE:
                raise Unexpected(f"A job of the {jobs} does not end.")
            await asyncio.sleep(LOOK_EVERY)
        if job["state"] != "done":
            raise Unexpected(f"A job of the {jobs} {job['state']}: {job['error']}")
        await connection.wanted(visitor.request("DELETE", f"/{jobs}/{job['id']}"), 204)
        return job
    finally:
        connection.close()


@asynccontextmanager
async def under_way(subject: Subject, *works: tuple[Visitor, str, Mapping[str, Any]]):
    """A block during which jobs run, each started again as it ends; gives how many have ended."""
    counts: dict[str, int] = {jobs: 0 for _, jobs, _ in works}

    async def repeated(visitor: Visitor, jobs: str, asked: Mapping[str, Any]) -> None:
        while True:
            await ended(subject, visitor, jobs, asked)
            counts[jobs] += 1

    tasks = [asyncio.create_task(repeated(*work)) for work in works]
    try:
        while not all(counts.values()):
            # The workers have started, and every kind has been through once.
            await asyncio.wait(tasks, timeout=LOOK_EVERY, return_when=asyncio.FIRST_COMPLETED)
            _raise_failed(tasks)
        for jobs in counts:
            counts[jobs] = 0
        yield counts
        _raise_failed(tasks)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


def _raise_failed(tasks: list[asyncio.Task[None]]) -> None:
    for task in tasks:
        if task.done():
            task.result()
