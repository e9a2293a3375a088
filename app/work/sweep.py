"""A sweep as a background job: what goes to the workers, what they do, what comes back.

Its units are shares of its cars in a row. A worker gets everything by value and gives rows back as
a Parquet file, so it needs neither the database nor the data directory and may be another machine.
"""

import io
import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from ..errors import OverBudget
from ..jobs.kinds import PATIENT, Division, Kind, Progress, digest
from ..jobs.worker import Attempt, WithFile
from ..limits import Limits
from ..recordings.recordings import Recordings, as_stated
from ..schemas import FullFactorialForm, SweepRequest
from ..simulators.simulator import Host
from ..storage.job_row import Job
from ..storage.measurement import Measurement, stated
from ..storage.store import Store
from .excitation_mode import mode_of

KIND = "sweep"

STATUS_BYTES = 100
"""What a car's status takes in the file, at most: a failed car has a sentence, but no figures."""

FRAME_BYTES = 100_000
"""What the file takes besides: what was swept, and Parquet's account of its columns."""

UNIT_STEPS = 2_000_000
"""Steps of all cars of a unit together: about a second of a core."""

MOST_UNITS = 400
"""Of longer sweeps the units are longer, too."""


def sweep(store: Store, recordings: Recordings) -> Kind:
    """The job kind, bound to where its recordings are kept."""

    def payload(job: Job) -> dict[str, Any]:
        runs = [recordings.run(as_stated(store, job.session, run)) for run in job.spec["runs"]]
        return {**job.spec, "run": runs[0] if runs else None}

    shares = Division(names=_shares, unit=sweep_share, progress=_progress)
    return Kind(task=join_shares, payload=payload, division=shares, priority=PATIENT)


def as_asked(request: SweepRequest) -> str:
    """What stands for a request: the same whenever it is sent, however it calls the parameters."""
    form = request.model_dump(mode="json", exclude={"key", "design"})
    return digest({**form, "design": design_of(request.design).to_json()})


def design_of(form: Any) -> Any:
    """The engine's design; raises what a person can mend."""
    from ...engine.sweeps.designs import FullFactorial, LatinHypercube, Sobol, Spaced

    if isinstance(form, FullFactorialForm):
        return FullFactorial(
            {
                name: given
                if isinstance(given, list)
                else Spaced(given.low, given.high, given.count)
                for name, given in form.levels.items()
            }
        )
    make = Sobol if form.kind == Sobol.kind else LatinHypercube
    return make(form.ranges, form.cars, form.seed)


def most_bytes(design: Any) -> int:
    """How large the file can become."""
    from ...engine.sweeps.sweep import columns

    return FRAME_BYTES + design.cars * (8 * len(columns(design)) + STATUS_BYTES)


def check_and_fill(
    host: Host,
    request: SweepRequest,
    vehicle: Mapping[str, Any],
    kept: Measurement | None,
    limits: Limits,
) -> dict[str, Any]:
    """In a simulator: everything that the job needs, checked, with what holds untold filled in."""
    from ...engine.manoeuvre import manoeuvre_to_json
    from ...engine.sweeps.sweep_checks import check_sweep, stepped_alike, threads_of, typical_cars
    from ...engine.sweeps.sweep_file import require_package
    from ...engine.vehicle_file import vehicle_from_json, vehicle_to_json
    from .excitation import excitation_of, extent, manoeuvre_of

    require_package("parquet")
    mode = mode_of(request)
    car, design = vehicle_from_json(vehicle), design_of(request.design)
    steps = extent(request, kept, typical_cars(car, design))[1]
    _check_budget(design.cars, steps, limits)
    run = None if kept is None else host.recordings.run(kept)
    driven = excitation_of(request, run)
    check_sweep(car, design, driven, threads_of(None))
    driven = stepped_alike(car, design, driven)
    spec = request.model_dump(mode="json", exclude={"key"})
    spec |= {"vehicle": vehicle_to_json(car), "design": design.to_json(), "cars": design.cars}
    spec["share"] = _share(design.cars, steps)
    spec["runs"] = [] if kept is None else [stated(kept)]
    spec["most_bytes"] = most_bytes(design)
    if mode != "rims":
        spec |= {name: getattr(driven, name) for name in ("step", "sample_step")}
    if mode == "manoeuvre":
        spec |= {"manoeuvre": manoeuvre_to_json(manoeuvre_of(request)), "road": None}
        spec["duration"] = spec["manoeuvre"]["duration"]
    return spec


def _check_budget(cars: int, steps: float, limits: Limits) -> None:
    """Refuse more cars, longer ones, or more steps of all together than a sweep over REST takes."""
    if cars > limits.swept_cars:
        raise OverBudget(
            f"{cars:.6g} cars are asked for, a sweep over REST takes at most {limits.swept_cars};"
            " take fewer, or use the command ridetune sweep."
        )
    if steps > limits.simulated_steps:
        raise OverBudget(
            f"{math.ceil(steps)} steps a car are asked for, over REST one takes at most"
            f" {limits.simulated_steps}; take a shorter manoeuvre or a longer step."
        )
    if cars * steps > limits.swept_steps:
        raise OverBudget(
            f"{cars} cars of {steps:.0f} steps are asked for, a sweep over REST takes at most"
            f" {limits.swept_steps:.3g} steps together; take fewer cars, a shorter manoeuvre or a"
            " longer step, or use the command ridetune sweep."
        )


def _share(cars: int, steps: float) -> int:
    """How many cars a unit has, of so many that take so many steps each."""
    return max(1, round(UNIT_STEPS / steps), math.ceil(cars / MOST_UNITS))


def _shares(spec: Mapping[str, Any]) -> list[str]:
    """First and last car of each unit; of a job kept from before there were any, one has all."""
    if "share" not in spec:
        form = {name: spec[name] for name in SweepRequest.model_fields if name in spec}
        return [f"0-{design_of(SweepRequest.model_validate(form).design).cars - 1}"]
    starts = range(0, spec["cars"], spec["share"])
    return [f"{first}-{min(first + spec['share'], spec['cars']) - 1}" for first in starts]


def _progress(spec: Mapping[str, Any], shares: Mapping[str, Progress], at_once: int) -> Progress:
    """Cars of all units; `seconds` are those of the workers together."""
    known = [share for share in shares.values() if share]
    counted = {name: sum(share[name] for share in known) for name in ("cars", "failed", "seconds")}
    return {**counted, "of": spec.get("cars", max((one["of"] for one in known), default=0))}


def _swept(payload: Any) -> tuple[Any, Any, Any]:
    """The engine's vehicle, design and excitation."""
    from ...engine.vehicle_file import vehicle_from_json
    from .excitation import excitation_of

    request = SweepRequest.model_validate(
        {name: payload[name] for name in SweepRequest.model_fields if name in payload}
    )
    driven = excitation_of(request, payload["run"])
    return vehicle_from_json(payload["vehicle"]), design_of(request.design), driven


def sweep_share(payload: Any, attempt: Attempt) -> WithFile:
    """On a worker: sweep some cars, reporting how many are done; their rows as Parquet."""
    from ...engine.sweeps.sweep import sweep as sweep_through
    from ...engine.sweeps.sweep_file import description, write_blocks

    vehicle, design, driven = _swept(payload)
    first, last = map(int, payload["unit"].split("-"))
    reached: dict[str, Any] = {}

    def progress(now: Any) -> None:
        reached.update(asdict(now))
        attempt.report(reached)

    blocks = sweep_through(
        vehicle,
        design,
        driven,
        cars=range(first, last + 1),
        threads=1,  # there are as many workers as cores
        progress=progress,
        cancelled=attempt.cancelled,
    )
    stream = io.BytesIO()
    write_blocks(stream, "parquet", description(vehicle, design, driven), blocks)
    return WithFile(reached, stream.getvalue())


def join_shares(payload: Any, attempt: Attempt) -> WithFile:
    """On a worker: the rows of all units as one Parquet file."""
    from itertools import chain

    from ...engine.sweeps.figures import OK
    from ...engine.sweeps.sweep_file import description, read_blocks, write_blocks

    shares = [attempt.kept[name] for name in _shares(payload)]
    cars = failed = 0

    def rows(share: bytes) -> Any:
        nonlocal cars, failed
        for block in read_blocks(io.BytesIO(share))[1]:
            cars += len(block["status"])
            failed += int((block["status"] != OK).sum())
            yield block

    described, stream = description(*_swept(payload)), io.BytesIO()
    write_blocks(stream, "parquet", described, chain.from_iterable(map(rows, shares)))
    result = {"cars": cars, "failed": failed, "columns": described["columns"]}
    return WithFile(result, stream.getvalue())
