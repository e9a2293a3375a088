"""The engine's own rows."""

import time
from collections.abc import Callable, Mapping
from dataclasses import replace

from ...engine.identification.identify import Problem, identify
from ...engine.manoeuvre import reference_manoeuvres
from ...engine.measurement import read_run
from ...engine.simulation.excitation import FreeExcitation
from ...engine.simulation.integration import cores
from ...engine.simulation.simulate import FREE_STEP, simulate_road
from ...engine.sweeps.designs import Sobol
from ...engine.sweeps.sweep import sweep
from ...engine.vehicle_file import read_vehicle
from ..package_files import package_folder
from .modes import STAGES, Mode, road_mode, some_cars, the_car, the_demand
from .row import Row
from .timing import Timing, one_core, ratio
from .workbench import BATCH_SIZE, Workbench

Case = Callable[[Workbench], Row]

JACOBIAN_CARS = 24
"""Two cars for each of the twelve parameters."""

LANES_JUDGED = 8
"""Cars of a batch whose error is looked at."""

FEW, MANY = 1_000, 10_000
"""Batches between which the time per car should not grow."""

SWEPT, SWEEP_SECONDS = 100_000, 2.0
"""Cars of the sweep, and how long each drives, s."""

START = {"front.suspension.stiffness": 30000.0, "rear.pivot.angle": 0.3}
"""Where the identification begins, as in sample_runs/README.md."""


def one_car(mode: Callable[[Workbench], Mode]) -> Case:
    """A single car in a mode."""

    @one_core()
    def measure(bench: Workbench) -> Row:
        case, car = mode(bench), bench.one
        return _row(bench, case, f"one car, {case.what}", 1, lambda: case.states(car))

    return measure


def batch(mode: Callable[[Workbench], Mode]) -> Case:
    """A batch of cars in a mode."""

    @one_core()
    def measure(bench: Workbench) -> Row:
        case, cars = mode(bench), bench.many
        what = f"{BATCH_SIZE} cars, {case.what}"
        return _row(bench, case, what, BATCH_SIZE, lambda: case.states(cars))

    return measure


def _row(bench: Workbench, mode: Mode, what: str, cars: int, work: Callable[[], object]) -> Row:
    judged = bench.one if cars == 1 else bench.many[:LANES_JUDGED]
    return Row(
        what,
        bench.pace.measure(work),
        cars,
        mode.seconds,
        mode.evaluations,
        bench.operations[mode.name],
        mode.error(judged),
    )


@one_core()
def every_channel(bench: Workbench) -> Row:
    """A single car as `simulate_road` gives it: every channel, every 5 ms."""
    manoeuvre = reference_manoeuvres()["2"]
    timing = bench.pace.measure(lambda: simulate_road(the_car(), manoeuvre))
    return Row("the same, every channel at 5 ms", timing, seconds=manoeuvre.duration)


@one_core()
def jacobian(bench: Workbench) -> Row:
    """The cars of one Jacobian of a 12-parameter fit, beside one of them."""
    cars, mode = some_cars(JACOBIAN_CARS), bench.rims
    together, alone = bench.pace.alternate(
        lambda: mode.states(cars), lambda: mode.states(bench.one)
    )
    what = (
        f"{JACOBIAN_CARS} cars of a Jacobian: as long as {ratio(together, alone):.1f} single runs"
    )
    operations = bench.operations[mode.name]
    return Row(what, together, JACOBIAN_CARS, mode.seconds, mode.evaluations, operations)


def all_cores(bench: Workbench) -> Row:
    """A batch on every core beside the same on one, by the clock."""
    mode, cars = bench.road, bench.many

    @one_core()
    def alone():
        mode.states(cars)

    together, single = bench.pace.alternate(
        lambda: mode.states(cars), alone, clock=time.perf_counter
    )
    what = (
        f"{BATCH_SIZE} cars on {cores()} cores: {ratio(single, together):.2f} times as fast as one"
    )
    return Row(what, together, BATCH_SIZE, mode.seconds, mode.evaluations)


@one_core()
def growth(bench: Workbench) -> Row:
    """Ten times the cars, half a second of rolling each, and what a car then takes."""
    rolling = replace(the_demand(), duration=0.5, initial_speed=15.0)
    mode = road_mode(rolling, sample_step=0.1)
    cars = some_cars(MANY)
    many, few = bench.pace.alternate(lambda: mode.states(cars), lambda: mode.states(cars[:FEW]))
    per_car = ratio(many, few) * FEW / MANY
    what = f"{MANY} cars: {per_car:.2f} times the time per car of {FEW}"
    return Row(what, many, MANY, mode.seconds, mode.evaluations)


def identification(bench: Workbench) -> Row:
    """Twelve parameters from both runs of the paper twin, by the clock."""
    folder = package_folder("sample_runs")
    car = read_vehicle(folder / "twin/vehicle.json")
    runs = [read_run(folder / f"twin/manoeuvre_{number}.csv") for number in (1, 2)]
    problem = Problem.build(car, runs, start=START)
    timing = bench.pace.measure(lambda: identify(problem), clock=time.perf_counter)
    fit = identify(problem)
    off = max(abs(one.value - car.value(one.name)) / one.std_error for one in fit.parameters)
    what = f"12 parameters from both sample runs, to {off:.1f} standard errors, all cores"
    return Row(what, timing)


def sweep_of_cars(bench: Workbench) -> Row:
    """A sweep as the command runs it but for its file, by the clock: every figure of every car."""
    bump = reference_manoeuvres()["bump"].lasting(SWEEP_SECONDS)
    ranges = {
        "front.suspension.stiffness": (15e3, 40e3),
        "front.suspension.damping": (800.0, 3000.0),
        "rear.pivot.distance": (0.8, 2.0),
    }
    cars = SWEPT if bench.pace.fewest > 1 else SWEPT // 10
    began = time.perf_counter()
    for _ in sweep(the_car(), Sobol(ranges, cars), FreeExcitation(bump)):
        pass
    timing = Timing((time.perf_counter() - began,))
    what = f"a sweep of {cars} cars over a bump, figures of all, on all cores (once)"
    evaluations = STAGES * round(SWEEP_SECONDS / FREE_STEP)
    return Row(what, timing, cars, SWEEP_SECONDS, evaluations)


CASES: Mapping[str, Case] = {
    "road-one": one_car(lambda bench: bench.road),
    "road-channels": every_channel,
    "road-batch": batch(lambda bench: bench.road),
    "road-cores": all_cores,
    "road-growth": growth,
    "posts-one": one_car(lambda bench: bench.posts),
    "posts-batch": batch(lambda bench: bench.posts),
    "rims-one": one_car(lambda bench: bench.rims),
    "rims-batch": batch(lambda bench: bench.rims),
    "rims-jacobian": jacobian,
    "identification": identification,
    "sweep": sweep_of_cars,
}
"""Rows by name, in the order of the table."""
