"""`ridetune sweep`: a design of cars through the same excitation, one row a car."""

from argparse import Namespace
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from ...engine.errors import RideError, SweepError
from ...engine.measurement import run_to_csv
from ...engine.simulation.excitation import Excitation
from ...engine.sweeps.designs import Design, FullFactorial, LatinHypercube, Sobol
from ...engine.sweeps.figures import reason
from ...engine.sweeps.sweep import Progress, car_of
from ...engine.sweeps.sweep import sweep as sweep_cars
from ...engine.sweeps.sweep_checks import stepped_alike
from ...engine.sweeps.sweep_file import description, form_of, write_blocks
from ...engine.vehicle import Vehicle
from ...engine.vehicle_file import write_vehicle
from .arguments import levels, ranges, whole
from .excitation import doubts, excitation, files_read, mode_of
from .inputs import find_vehicle
from .output import (
    make_folder,
    print_warnings,
    refuse_input,
    refuse_to_overwrite,
    require_place,
    whole_file,
    write_file,
)
from .sweep_summary import Summary
from .watch import left, watch


def sweep(options: Namespace) -> None:
    """Run the sweep, write its rows as they come, print what stands out, write histories."""
    mode, form, inputs = mode_of(options), form_of(options.output), files_read(options)
    require_place(options.output, inputs)
    design = _design(options)
    numbers = _numbers(options.histories, design.cars)
    vehicle = find_vehicle(options.vehicle)
    driven = excitation(options, mode, vehicle)
    summary = Summary()
    with watch(_line) as progress:
        blocks = sweep_cars(vehicle, design, driven, threads=options.threads, progress=progress)
        driven = stepped_alike(vehicle, design, driven)
        files = _history_files(options, numbers, inputs)
        with whole_file(options.output) as stream:
            write_blocks(stream, form, description(vehicle, design, driven), summary.noting(blocks))
    print(f"Wrote {options.output}: {design.cars} cars.")
    summary.print()
    print_warnings(doubts(driven))
    if numbers:
        print_warnings(
            _write_histories(vehicle, design, driven, dict(zip(numbers, files, strict=True)))
        )


def _design(options: Namespace) -> Design:
    """The design that the options describe."""
    if options.levels and options.range:
        raise SweepError("--levels and --range are two designs; leave out one of them.")
    if options.levels:
        for option in ("cars", "design", "seed"):
            if getattr(options, option) is not None:
                raise SweepError(f"--{option} belongs to --range; it means nothing with --levels.")
        return FullFactorial(levels(options.levels))
    if not options.range:
        raise SweepError(
            "Nothing says what is swept; add --levels NAME=LOW:HIGH:COUNT, or --range"
            " NAME=LOW:HIGH and --cars N."
        )
    if options.cars is None:
        raise SweepError("Nothing says how many cars are drawn from --range; add --cars N.")
    make = LatinHypercube if options.design == LatinHypercube.kind else Sobol
    cars = whole(options.cars, f"--cars {options.cars}", "a whole number")
    return make(ranges(options.range), cars, options.seed or 0)


def _numbers(histories: Sequence[str] | None, cars: int) -> list[int]:
    """The cars of which histories are asked for."""
    if histories is None:
        return []
    argument, form = f"--histories {' '.join(histories)}", "DIR N [N ...]"
    numbers = [whole(text, argument, form) for text in histories[1:]]
    if not numbers:
        raise SweepError(f"{argument} names no car; write --histories {form}.")
    if beyond := [number for number in numbers if not 0 <= number < cars]:
        raise SweepError(f"{argument}: there is no car {beyond[0]}; they go from 0 to {cars - 1}.")
    return list(dict.fromkeys(numbers))


def _history_files(
    options: Namespace, numbers: Sequence[int], inputs: Iterable[str | Path | None]
) -> list[Path]:
    """Where the histories go, in a folder that is made for them; their vehicles go beside."""
    if not numbers:
        return []
    folder = make_folder(options.histories[0])
    files = [folder / f"car-{number}.csv" for number in numbers]
    written = [one for path in files for one in (path, path.with_suffix(".json"))]
    for path in written:
        refuse_input(path, inputs)
    if not options.force:
        refuse_to_overwrite(written)
    return files


def _write_histories(
    vehicle: Vehicle, design: Design, driven: Excitation, files: dict[int, Path]
) -> Iterator[str]:
    """Write run and vehicle of some cars; a sentence for each that has none."""
    for number, path in files.items():
        try:
            car = car_of(vehicle, design, number)
            run = driven.simulate(car).run
        except RideError as error:
            yield f"Car {number} has no history: {reason(error)}"
            continue
        write_file(path, run_to_csv(run))
        write_vehicle(car, path.with_suffix(".json"))
        print(f"Wrote {path} and its vehicle.")


def _line(now: Progress) -> str:
    speed = now.cars / now.seconds
    failed = f", {now.failed} failed" if now.failed else ""
    return (
        f"{now.cars} of {now.of} cars{failed}, {speed:.3g} cars/s,"
        f" {left(now.cars, now.of, now.seconds)}"
    )
