"""States of a batch: where each of its cars starts."""

import numpy as np
from numpy.testing import assert_array_equal
from ridetune.engine.channels import INPUT_CHANNELS
from ridetune.engine.demand import Demand, PiecewiseLinear, PostMotion
from ridetune.engine.run import Run
from ridetune.engine.simulation.car_rows import car_rows
from ridetune.engine.simulation.integration import (
    ARM_ACCELERATIONS,
    free_outputs,
    free_states,
    rims_outputs,
    rims_states,
)
from ridetune.engine.simulation.rims import prepare
from ridetune.engine.simulation.stepping import prepare_free

from ...factories import paper_vehicle

CAR = paper_vehicle()
HEIGHTS = np.array([0.03, -0.02, 0.01, 0.02])
STEEP = 0.5
"""m : the front left wheel so high that an arm of 0.3 m does not reach it; one of 1.6 m does."""
TIME = np.linspace(0.0, 0.5, 101)
AT_REST = 1e-9
"""m/s2 and rad/s2, what the engine counts as rest."""


def some_cars(front_arms):
    """Cars whose front springs differ, too."""
    stiffness = np.linspace(15e3, 40e3, len(front_arms))
    names = ("front.pivot.distance", "front.suspension.stiffness")
    return car_rows(CAR, names, np.column_stack([front_arms, stiffness]))


def on_posts(heights):
    still = PiecewiseLinear.zero(TIME[-1])
    posts = PostMotion(TIME, np.tile(heights, (TIME.size, 1)))
    return prepare_free(Demand(TIME[-1], 0.0, still, still, None, posts), 0.0025, 0.005)


def on_rims(heights):
    held = dict(zip(INPUT_CHANNELS, [*heights, 0.0], strict=True))
    channels = {name: np.full(TIME.size, value) for name, value in held.items()}
    return prepare(Run("uneven", TIME, channels), CAR)


def test_each_car_of_a_batch_on_uneven_posts_starts_at_rest():
    """Oracle: no coordinate but x is accelerated; the car alone, to the last bit."""
    cars, inputs = some_cars(np.linspace(0.8, 2.0, 11)), on_posts(HEIGHTS)
    starts = free_states(cars, inputs).values[:, 0]
    for car, start in zip(cars, starts, strict=True):
        out = free_outputs(car, start[np.newaxis], inputs.stage_inputs[:1, 0], inputs.road)[0]
        assert np.abs(out[[1, 2, 3, *ARM_ACCELERATIONS]]).max() < AT_REST
        assert_array_equal(free_states(car[np.newaxis], inputs).values[0, 0], start)
    assert len(np.unique(starts[:, 1])) == len(cars)


def test_each_car_of_a_batch_on_uneven_rims_starts_at_rest():
    """Oracle: as above, of z, pitch and roll."""
    cars, inputs = some_cars(np.linspace(0.8, 2.0, 11)), on_rims(HEIGHTS)
    starts = rims_states(cars, inputs, True).values[:, 0]
    for car, start in zip(cars, starts, strict=True):
        out = rims_outputs(car, start[np.newaxis], inputs.stage_inputs[:1, 0], True)[0]
        assert np.abs(out[1:4]).max() < AT_REST
        assert_array_equal(rims_states(car[np.newaxis], inputs, True).values[0, 0], start)


def test_a_car_without_an_equilibrium_fails_before_its_first_step_and_alone():
    """Oracle: lengths of arms; the sound cars without it."""
    inputs = on_rims([STEEP, 0.0, 0.0, 0.0])
    cars = some_cars([1.6, 0.3, 1.7])
    found = rims_states(cars, inputs, True)
    assert_array_equal(found.failed, [-1, 0, -1])
    assert np.all(np.isnan(found.values[1]))
    assert_array_equal(found.values[[0, 2]], rims_states(cars[[0, 2]], inputs, True).values)
