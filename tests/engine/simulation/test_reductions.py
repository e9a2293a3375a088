"""Figures tallied in the kernels against those of the same car's history."""

from dataclasses import replace

import numpy as np
import pytest
from ridetune.engine.manoeuvre import reference_manoeuvres
from ridetune.engine.simulation.car_rows import car_row, car_rows
from ridetune.engine.simulation.integration import (
    free_states,
    free_tallies,
    rims_states,
    rims_tallies,
)
from ridetune.engine.simulation.output_channels import DEFAULT_POINTS
from ridetune.engine.simulation.reductions import figures, reduction
from ridetune.engine.simulation.rims import prepare
from ridetune.engine.simulation.simulate import (
    FREE_STEP,
    SAMPLE_STEP,
    simulate_posts,
    simulate_rims,
    simulate_road,
)
from ridetune.engine.simulation.stepping import prepare_free

from ...factories import paper_vehicle, random_vehicle
from ...tallied import assert_figures

[(POINT, POSITION)] = DEFAULT_POINTS.items()


def cars_of(count):
    rng = np.random.default_rng(12)
    return [paper_vehicle(), *(random_vehicle(rng, braked=True) for _ in range(count - 1))]


@pytest.mark.parametrize("manoeuvre", ["2", "brake", "bump", "heave"])
def test_tallied_figures_are_those_of_each_car_s_history(manoeuvre):
    """Oracle: `metrics` of the car simulated alone, the first one's times of squat and dive."""
    driven = reference_manoeuvres()[manoeuvre]
    vehicle = paper_vehicle() if manoeuvre != "brake" else cars_of(2)[1]
    simulate = simulate_road if driven.kind == "road" else simulate_posts
    run = simulate(vehicle, driven).run
    inputs = prepare_free(driven.demand(vehicle), FREE_STEP, SAMPLE_STEP)
    reduced = reduction(run, inputs.steps, POINT, POSITION)
    found = figures(free_tallies(car_row(vehicle)[np.newaxis], inputs, reduced).values, reduced)
    assert_figures({name: values[0] for name, values in found.items()}, run, vehicle)


def test_tallied_figures_on_rims_are_those_of_the_history():
    """Oracle: as above, where nodes and samples coincide."""
    vehicle = paper_vehicle()
    recording = simulate_road(vehicle, replace(reference_manoeuvres()["2"], duration=8.0)).run
    other = vehicle.with_values({"front.suspension.damping": 900.0})
    inputs = prepare(recording, other)
    run = simulate_rims(other, recording).run
    reduced = reduction(run, np.diff(inputs.node_time), POINT, POSITION)
    tallies = rims_tallies(car_row(other)[np.newaxis], inputs, True, reduced)
    found = figures(tallies.values, reduced)
    assert_figures({name: values[0] for name, values in found.items()}, run, other)


@pytest.fixture(scope="module")
def short():
    return replace(reference_manoeuvres()["bump"], duration=2.0)


def random_rows(count):
    """Cars of one kind whose numbers differ."""
    rng, vehicle = np.random.default_rng(5), paper_vehicle()
    names = ("front.suspension.stiffness", "rear.suspension.damping", "rear.pivot.distance")
    values = rng.uniform([15e3, 800.0, 0.6], [40e3, 3000.0, 2.0], (count, 3))
    return car_rows(vehicle, names, values)


@pytest.mark.parametrize("count", [1, 7, 8, 9, 64, 1000])
def test_each_car_of_a_batch_is_that_car_alone(short, count):
    """Oracle: the same car in a batch of one to the last bit, whatever its lane and thread, and
    simulated as a single car to 11 digits of the coordinates' range: there, products are fused
    with other sums."""
    vehicle, rows = paper_vehicle(), random_rows(count)
    inputs = prepare_free(short.demand(vehicle), FREE_STEP, SAMPLE_STEP)
    run = simulate_road(vehicle, short).run
    reduced = reduction(run, inputs.steps, POINT, POSITION)
    together = free_tallies(rows, inputs, reduced)
    one_thread = free_tallies(rows, inputs, reduced, threads=1)
    assert np.array_equal(together.values, one_thread.values)
    states = free_states(rows, inputs).values
    assert np.array_equal(states, free_states(rows, inputs, threads=1).values)
    for k in {0, count // 2, count - 1}:
        alone = free_tallies(rows[k : k + 1], inputs, reduced)
        assert np.array_equal(alone.values[0], together.values[k])
        single = free_states(rows[k : k + 1], inputs).values[0]
        scale = np.ptp(single, axis=0)
        assert np.all(np.abs(states[k] - single) <= 1e-11 * scale + 1e-14)


@pytest.mark.parametrize("count", [1, 7, 8, 9, 64, 1000])
def test_each_car_of_a_batch_on_rims_is_that_car_alone(short, count):
    """Oracle: as above."""
    vehicle, rows = paper_vehicle(), random_rows(count)
    inputs = prepare(simulate_road(vehicle, short).run, vehicle)
    states = rims_states(rows, inputs, True).values
    assert np.array_equal(states, rims_states(rows, inputs, True, threads=1).values)
    for k in {0, count // 2, count - 1}:
        single = rims_states(rows[k : k + 1], inputs, True).values[0]
        scale = np.ptp(single, axis=0)
        assert np.all(np.abs(states[k] - single) <= 1e-11 * scale + 1e-14)


def test_a_failed_car_spoils_neither_its_batch_nor_the_next(short):
    """Oracle: the sound cars alone. The lanes of a car that diverged are used again."""
    vehicle, rows = paper_vehicle(), random_rows(24)
    inputs = prepare_free(short.demand(vehicle), FREE_STEP, SAMPLE_STEP)
    reduced = reduction(simulate_road(vehicle, short).run, inputs.steps, POINT, POSITION)
    sound = free_tallies(rows, inputs, reduced, threads=1)
    broken = car_row(vehicle.with_values({"front.suspension.damping": 1e5}))
    mixed = np.insert(rows, 3, broken, axis=0)
    found = free_tallies(mixed, inputs, reduced, threads=1)
    assert found.failed[3] >= 0
    assert np.array_equal(np.delete(found.values, 3, axis=0), sound.values)
