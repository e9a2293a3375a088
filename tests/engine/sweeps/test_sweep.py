"""Sweeps: each row is its car alone, the sweep outlives a car that fails, and what is refused."""

import itertools
import os
import tracemalloc
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from ridetune.engine.errors import Cancelled, RideError, SimulationError, SweepError
from ridetune.engine.manoeuvre import reference_manoeuvres
from ridetune.engine.parameters import number_path
from ridetune.engine.run import Run
from ridetune.engine.simulation.excitation import FreeExcitation, RimsExcitation
from ridetune.engine.simulation.metrics import metrics
from ridetune.engine.simulation.recorded_motion import recorded_motion
from ridetune.engine.simulation.rims_settings import RimsSettings
from ridetune.engine.simulation.simulate import simulate_road
from ridetune.engine.simulation.stability import MARGIN, largest_stable_step
from ridetune.engine.sweeps import sweep as module
from ridetune.engine.sweeps.designs import FullFactorial, LatinHypercube, Sobol, Spaced
from ridetune.engine.sweeps.figures import OK, figures
from ridetune.engine.sweeps.side_by_side import side_by_side
from ridetune.engine.sweeps.sweep import car_of, columns, sweep
from ridetune.engine.sweeps.sweep_checks import typical_cars
from ridetune.engine.vehicle import Brakes

from ...factories import paper_vehicle
from ...tallied import assert_figures

CAR = paper_vehicle()
BUMP = reference_manoeuvres()["bump"].lasting(1.5)
BRAKE = reference_manoeuvres()["brake"].lasting(4.0)
ROUGH = FreeExcitation(reference_manoeuvres()["1"].lasting(2.0), sample_step=0.01)
RANGES = {"K_F": (1e4, 4e4), "C_R": (1e3, 3e3), "chassis.mass": (900.0, 1300.0)}
SPRINGS = {"K_F": (1e4, 4e4), "C_R": (1e3, 3e3), "rear.tyre.stiffness": (15e4, 25e4)}
SHARP = 5e-3
"""Of an rms over 5 ms samples of what a bump, or a spline through samples, stirs up to 100 Hz."""
CORES = len(os.sched_getaffinity(0))


def rows(vehicle, design, excitation, **how):
    """The whole sweep as one table."""
    blocks = list(sweep(vehicle, design, excitation, **how))
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}


def excitations():
    """One of every kind, by name."""
    driven = simulate_road(CAR, BUMP).run
    heights = {f"post.{name[5:7]}.z": driven[name] for name in driven.columns if "road." in name}
    return {
        "road": (CAR, FreeExcitation(BUMP, lift_off=True, step=0.001)),
        "brake": (
            replace(CAR, brakes=Brakes(0.65)),
            FreeExcitation(BRAKE),
        ),
        "posts": (CAR, FreeExcitation(reference_manoeuvres()["warp"].lasting(2.0))),
        "rig": (CAR, FreeExcitation(replace(driven, channels=heights))),
        "rims": (CAR, RimsExcitation(recorded_motion(driven, RimsSettings()), "paper")),
    }


@pytest.fixture(scope="module", params=["road", "brake", "posts", "rig", "rims"])
def case(request):
    return excitations()[request.param]


@pytest.mark.parametrize("ranges", [SPRINGS, RANGES], ids=["side by side", "one by one"])
def test_each_row_is_its_car_simulated_alone(case, ranges):
    """Oracle: the simulation of the same car and its metrics; what it lacks is not a number, but
    that side by side it squats and dives when the car in the middle does."""
    vehicle, excitation = case
    design = Sobol(ranges, 5, seed=2)
    table = rows(vehicle, design, excitation)
    assert list(table) == [column.name for column in columns(design)]
    assert_array_equal(table["car"], np.arange(5))
    assert_array_equal(np.column_stack([table[name] for name in design.names]), design.block(0, 5))
    assert set(table["status"]) == {OK}
    for number in range(5):
        car = car_of(vehicle, design, number)
        run = excitation.simulate(car).run
        found = {figure.name: table[figure.name][number] for figure in figures()}
        has = {metric.name for metric in metrics(run)}
        told = {name for name, value in found.items() if not np.isnan(value)}
        assert told - has <= {"chassis.pitch.squat", "chassis.pitch.dive"}
        has_found = {name: value for name, value in found.items() if name in has}
        assert_figures(has_found, run, car, SHARP)


@pytest.mark.parametrize("ranges", [SPRINGS, RANGES], ids=["side by side", "one by one"])
def test_shares_of_a_sweep_are_the_sweep(ranges, monkeypatch):
    """Oracle: all cars at once, bit for bit; shares of other lengths than the blocks."""
    monkeypatch.setattr(module, "BLOCK", 4)
    design, told = Sobol(ranges, 11, seed=2), []
    whole = rows(CAR, design, FreeExcitation(BUMP))
    shares = [
        rows(CAR, design, FreeExcitation(BUMP), cars=cars, progress=told.append)
        for cars in (range(0, 3), range(3, 9), range(9, 11))
    ]
    for name, values in whole.items():
        assert_array_equal(np.concatenate([share[name] for share in shares]), values)
    assert [(one.cars, one.of) for one in told if one.cars == one.of] == [(3, 3), (6, 6), (2, 2)]


@pytest.mark.parametrize("other", [{}, {"chassis.mass": [900.0, 1300.0]}], ids=["alike", "not"])
def test_all_cars_of_a_sweep_take_the_step_that_its_bent_ones_need(other):
    """Oracle: the same sweep with that step told."""
    design = FullFactorial({"rho_R": [1.0, 2.5], **other})
    found, told = (rows(CAR, design, FreeExcitation(BUMP, step=step)) for step in (None, 0.00125))
    for name, values in told.items():
        assert_array_equal(found[name], values)


def test_cars_that_are_driven_alike_go_side_by_side():
    """Oracle: a torque that holds a speed or a deceleration follows from the mass, no other."""
    for name, (vehicle, excitation) in excitations().items():
        for ranges, alike in ((SPRINGS, True), (RANGES, name in ("posts", "rig", "rims"))):
            cars = typical_cars(vehicle, Sobol(ranges, 4))
            assert (side_by_side(excitation, cars) is not None) == alike


def test_columns_are_labelled_with_the_units_of_the_metrics():
    """Oracle: the metrics of a run that has them all."""
    found = {one.name: (one.label, one.unit) for one in columns(Sobol(RANGES, 4))}
    vehicle, excitation = excitations()["brake"]
    for metric in metrics(excitation.simulate(vehicle).run):
        assert found[metric.name] == (metric.label, metric.unit)
    assert found["front.suspension.stiffness"] == ("Front spring stiffness", "N/m")
    assert found["chassis.mass"] == ("chassis.mass", "kg")


def test_a_car_that_cannot_exist_or_leaves_the_models_range_fails_alone():
    pothole = FreeExcitation(reference_manoeuvres()["pothole"].lasting(3.0))
    design = FullFactorial(
        {"phi_F": [np.radians(4.0), 1.48], "front.suspension.mount_height": [0.4, 0.02]}
    )
    table = rows(CAR, design, pothole)
    status = table["status"]
    assert status[0] == OK
    assert "The simulation diverged at t = " in status[1]
    assert "passed the mount of its spring-damper" in status[1]
    assert status[2] == status[3]
    assert status[2].startswith("Front.pivot lies 1.6 m from the wheel along the car")
    for sentence in status[1:]:
        assert sentence.endswith(".")
        assert ";" not in sentence
    for figure in figures():
        assert np.all(np.isnan(table[figure.name][1:]))
    alone = metrics(pothole.simulate(CAR).run)
    expected = next(one.value for one in alone if one.name == "chassis.z.rms")
    assert table["chassis.z.rms"][0] == pytest.approx(expected, rel=1e-9)


def test_a_car_that_the_batch_does_not_take_is_simulated_alone(monkeypatch):
    """Oracle: the simulation of the same car; one that is sound has all its figures."""

    def picky(excitation, cars):
        together = side_by_side(excitation, cars)
        return replace(together, _stable=lambda rows: np.arange(len(rows)) != 1)

    monkeypatch.setattr(module, "side_by_side", picky)
    design, excitation = Sobol(SPRINGS, 3), FreeExcitation(BUMP)
    table = rows(CAR, design, excitation)
    assert set(table["status"]) == {OK}
    alone = metrics(excitation.simulate(car_of(CAR, design, 1)).run)
    for metric in alone:
        assert table[metric.name][1] == metric.value


@pytest.mark.skipif(CORES < 2, reason="one core")
def test_threads_change_nothing():
    design = Sobol(RANGES, 6)
    one, two = (rows(CAR, design, ROUGH, threads=threads) for threads in (1, 2))
    for name in one:
        assert_array_equal(one[name], two[name])


def test_a_cancelled_sweep_ends_between_two_cars_and_progress_says_how_far_it_is():
    seen = []
    found = sweep(
        CAR, Sobol(RANGES, 64), ROUGH, threads=1, progress=seen.append, cancelled=lambda: bool(seen)
    )
    with pytest.raises(Cancelled, match=r"cancelled after 8 of 64 cars"):
        next(found)
    assert [(one.cars, one.of, one.failed) for one in seen] == [(8, 64, 0)]


def ready_made(cars, _, *, threads):
    """Figures without a simulation: the car's own stiffness."""
    found = {
        figure.name: np.array([car.front.suspension.stiffness for car in cars])
        for figure in figures()
    }
    return found | {"status": np.full(len(cars), OK, dtype=object)}


def test_blocks_join_and_the_last_progress_is_the_whole(monkeypatch):
    monkeypatch.setattr(module, "side_by_side", lambda *_: None)
    monkeypatch.setattr(module, "figures_of", ready_made)
    monkeypatch.setattr(module, "BLOCK", 100)
    seen = []
    design = LatinHypercube(RANGES, 250)
    blocks = list(sweep(CAR, design, ROUGH, progress=seen.append))
    assert [len(block["car"]) for block in blocks] == [100, 100, 50]
    table = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    assert_array_equal(table["car"], np.arange(250))
    assert_array_equal(table["chassis.z.rms"], design.block(0, 250)[:, 0])
    assert_array_equal(table["front.suspension.stiffness"], design.block(0, 250)[:, 0])
    assert (seen[-1].cars, seen[-1].of) == (250, 250)


def test_a_block_that_ends_early_makes_the_next_look_no_later(monkeypatch):
    """Oracle: a clock on which every car takes 10 ms; a look each half second is due."""
    clock = [0.0]

    def slowly(cars, excitation, *, threads):
        clock[0] += 0.01 * len(cars)
        return ready_made(cars, excitation, threads=threads)

    monkeypatch.setattr(module, "side_by_side", lambda *_: None)
    monkeypatch.setattr(module, "figures_of", slowly)
    monkeypatch.setattr(module, "time", SimpleNamespace(perf_counter=lambda: clock[0]))
    monkeypatch.setattr(module, "BLOCK", 59)
    seen = []
    for _ in sweep(CAR, Sobol(RANGES, 256), ROUGH, threads=1, progress=seen.append):
        pass
    looks = np.diff([0.0, *(one.seconds for one in seen)])
    assert np.all(looks <= module.LOOK_EVERY + 1e-9)


def test_memory_does_not_grow_with_the_number_of_cars(monkeypatch):
    monkeypatch.setattr(module, "side_by_side", lambda *_: None)
    monkeypatch.setattr(module, "figures_of", ready_made)
    monkeypatch.setattr(module, "BLOCK", 100)

    def peak(cars):
        tracemalloc.start()
        for _ in sweep(CAR, Sobol(RANGES, cars), ROUGH):
            pass
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    peak(100)
    assert peak(3000) < 1.2 * peak(300)


STIFF = {"front.suspension.damping": (1e3, 2e5), "K_F": (1e4, 4e4)}


def refused_step(vehicle, design, excitation, coarser):
    """The step, s, that a sweep with a coarser one is told to take."""
    with pytest.raises(SimulationError, match="take a step of at most") as refused:
        sweep(vehicle, design, coarser(excitation))
    return 1e-3 * float(str(refused.value).split("at most ")[1].split()[0]), str(refused.value)


def of_all_corners(vehicle, design, excitation):
    """The longest accepted step, s, of the car in every corner of a design's box: the least."""
    ends = zip(design.low.tolist(), design.high.tolist(), strict=True)
    cars = (
        vehicle.with_values(dict(zip(design.names, corner, strict=True)))
        for corner in itertools.product(*ends)
    )
    return MARGIN * min(largest_stable_step(excitation.eigenvalues(car)) for car in cars)


@pytest.mark.parametrize("case", ["road", "rims"])
def test_a_step_too_long_for_a_corner_of_the_box_is_refused_with_one_that_it_takes(case):
    """Oracle: the limits of all corners; the stated step is taken."""
    vehicle, excitation = excitations()[case]

    def stepping(step):
        if case == "road":
            return lambda excitation: replace(excitation, step=step)
        motion = recorded_motion(excitation.motion.run, RimsSettings(step=step))
        return lambda excitation: replace(excitation, motion=motion)

    design = Sobol(STIFF, 4)
    stated, told = refused_step(vehicle, design, excitation, stepping(0.01))
    assert "the sweep's car with front.suspension.damping = 200000, front.suspension.sti" in told
    longest = of_all_corners(vehicle, design, excitation)
    assert 0.9 * longest < stated <= longest
    sweep(vehicle, design, stepping(stated)(excitation))


def test_of_many_parameters_the_fastest_corner_is_found_all_the_same():
    """Oracle: the limits of all 512 corners."""
    shares = {
        **dict.fromkeys(("K_F", "K_R", "Ktor_F", "Ktor_R"), (0.5, 2.0)),
        **dict.fromkeys(("C_F", "C_R"), (0.5, 30.0)),
        **dict.fromkeys(("d_F", "d_R"), (0.5, 2.0)),
        "front.wheel.mass": (0.5, 2.0),
    }
    ranges = {
        name: tuple(share * CAR.value(number_path(name)) for share in limits)
        for name, limits in shares.items()
    }
    design = Sobol(ranges, 4)
    excitation = FreeExcitation(BUMP, step=0.02, sample_step=0.02)
    stated, _ = refused_step(CAR, design, excitation, lambda same: same)
    longest = of_all_corners(CAR, design, excitation)
    assert 0.9 * longest < stated <= longest


def lasting(seconds):
    return FreeExcitation(replace(BUMP, duration=seconds))


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: sweep(CAR, Sobol({"brakes.front_share": (0, 1)}, 4), ROUGH), "has no brakes"),
        (lambda: sweep(CAR, Sobol(RANGES, 4), lasting(0.0)), "duration is 0.0 s"),
        (lambda: sweep(CAR, Sobol(RANGES, 4), ROUGH, threads=CORES + 1), "threads are asked for"),
        (lambda: sweep(CAR, Sobol(RANGES, 4), ROUGH, threads=0), "0 threads are asked for"),
        (lambda: sweep(CAR, Sobol(RANGES, 4), replace(ROUGH, step=0.0)), "step is 0.0 s; give one"),
        (lambda: BUMP.lasting(0.0), "A duration of 0 s is asked for, but it must lie between 0.1"),
        (lambda: BUMP.lasting(float("nan")), "A duration of nan s"),
        (
            lambda: sweep(
                CAR,
                Sobol(RANGES, 4),
                RimsExcitation(recorded_motion(Run("bare", [0.0, 1.0], {}), RimsSettings())),
            ),
            "Run bare lacks wheel.fl.z",
        ),
    ],
)
def test_what_no_car_could_do_is_refused_at_once_in_one_sentence(make, told):
    with pytest.raises(RideError) as refused:
        make()
    assert told in str(refused.value)


def test_too_many_cars_are_refused_with_the_time_they_would_take():
    million = Spaced(1e4, 3e4, 10**6)
    with pytest.raises(SweepError) as refused:
        sweep(CAR, FullFactorial({"K_F": million, "K_R": million}), ROUGH)
    said = (
        r"1e\+12 cars are asked for, a sweep takes at most 1e\+08; at \S+ s a car they would take"
    )
    assert refused.match(said + r" \d+(\.\d+)? years; take fewer\.")
