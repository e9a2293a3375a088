"""How fast each mode converges with the step, and how near the default steps come.

The order on the road, torque jumps included, is in test_histories_oracle.py.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.channels import WHEEL_CHANNELS
from ridetune.engine.demand import Demand, PiecewiseLinear, PostMotion
from ridetune.engine.manoeuvre import reference_manoeuvres
from ridetune.engine.run import Run
from ridetune.engine.simulation.car_rows import car_row
from ridetune.engine.simulation.integration import free_states
from ridetune.engine.simulation.rims import prepare
from ridetune.engine.simulation.rims_settings import RimsSettings
from ridetune.engine.simulation.simulate import (
    FREE_STEP,
    SAMPLE_STEP,
    default_step,
    rims_batch,
    simulate_posts,
    simulate_road,
)
from ridetune.engine.simulation.stepping import prepare_free
from ridetune.engine.vehicle_file import reference_vehicles

from ...factories import DAMPERS, paper_vehicle

NEAR = 1e-4
"""Accepted error at the default steps, relative to the range of each coordinate."""


def waves(time):
    """Heights (n, 4), m, smooth and different at each corner."""
    frequencies, phases = np.array([1.1, 1.7, 2.3, 1.4]), np.array([0.0, 1.0, 2.0, 3.0])
    begun = 1.0 - np.exp(-((time[:, np.newaxis] / 0.3) ** 4))
    return 0.01 * begun * np.sin(2 * np.pi * frequencies * time[:, np.newaxis] + phases)


def orders(histories):
    """Orders seen in the differences of histories whose steps halve."""
    differences = [np.linalg.norm(b - a) for a, b in zip(histories, histories[1:], strict=False)]
    return np.log2(np.divide(differences[:-1], differences[1:]))


def error(history, converged):
    """Greatest error of histories (n, k) relative to each one's range."""
    return np.max(np.abs(history - converged) / np.ptp(converged, axis=0))


def free_motion(vehicle, demand, step):
    """Coordinates (S, 7) but x, on the road or the rig."""
    states = free_states(car_row(vehicle)[np.newaxis], prepare_free(demand, step, SAMPLE_STEP))
    return states.values[0, :, 1:8]


def rig(duration=2.0):
    """A rig that moves smoothly; the spline through its posts is exact at the steps' level."""
    still = PiecewiseLinear.zero(duration)
    time = np.linspace(0.0, duration, 20 * 400 + 1)
    return Demand(duration, 0.0, still, still, None, PostMotion(time, waves(time)))


def test_the_rig_s_integrator_is_of_fourth_order():
    """Oracle: halving the step divides the difference to the next by 16, order 4 +- 0.2."""
    vehicle, demand = paper_vehicle(), rig()
    found = orders([free_motion(vehicle, demand, 0.005 / 2**k) for k in range(4)])
    assert_allclose(found, 4.0, rtol=0, atol=0.2)


def test_the_rims_integrator_is_of_fourth_order():
    """Oracle: as above. The recording's samples are steps apart, so that its spline is smooth
    inside each step."""
    time = np.linspace(0.0, 2.0, 101)
    channels = dict(zip(WHEEL_CHANNELS, waves(time).T, strict=True))
    run = Run("waves", time, channels | {"chassis.a_x": np.sin(3.0 * time)})
    settings = RimsSettings(a_x_cutoff_hz=None, rim_cutoff_hz=None)
    vehicle, histories = paper_vehicle(), []
    for k in range(4):
        inputs = prepare(run, vehicle, replace(settings, step=0.02 / 2**k))
        histories.append(rims_batch(car_row(vehicle)[np.newaxis], inputs, "exact")[0])
    assert_allclose(orders(histories), 4.0, rtol=0, atol=0.2)


@pytest.mark.parametrize("manoeuvre", ["1", "2"])
@pytest.mark.parametrize("car", reference_vehicles())
def test_the_default_step_is_near_the_converged_run(car, manoeuvre):
    """Oracle: a sixteenth of the step, whose error is 16^4 times less by the order above."""
    vehicle = reference_vehicles()[car]
    demand = reference_manoeuvres()[manoeuvre].demand(vehicle)
    converged = free_motion(vehicle, demand, FREE_STEP / 16)
    assert error(free_motion(vehicle, demand, FREE_STEP), converged) < NEAR


@pytest.mark.parametrize("manoeuvre", ["1", "2"])
@pytest.mark.parametrize("car", reference_vehicles())
def test_the_default_step_of_a_bent_car_is_near_the_converged_run(car, manoeuvre):
    """Oracle: a sixteenth of the step, whose error is 16^2 times less: the kinks leave order 2."""
    vehicle = reference_vehicles()[car].with_values(DAMPERS)
    demand, step = reference_manoeuvres()[manoeuvre].demand(vehicle), default_step(vehicle)
    converged = free_motion(vehicle, demand, step / 16)
    assert error(free_motion(vehicle, demand, step), converged) < 1.5 * NEAR


@pytest.mark.parametrize("dampers", [{}, DAMPERS], ids=["linear", "bent"])
def test_the_default_step_is_near_the_converged_run_on_the_rig(dampers):
    """Oracle: as above."""
    vehicle, demand = paper_vehicle().with_values(dampers), rig()
    step = default_step(vehicle)
    converged = free_motion(vehicle, demand, step / 16)
    assert error(free_motion(vehicle, demand, step), converged) < NEAR


@pytest.mark.parametrize("name", DAMPERS)
def test_one_bend_makes_the_default_step_shorter(name):
    """Oracle: the number of steps of a car whose step is told."""
    linear, bent = paper_vehicle(), paper_vehicle().with_values({name: DAMPERS[name]})
    for simulate, key in ((simulate_road, "bump"), (simulate_posts, "heave")):
        manoeuvre = reference_manoeuvres()[key]
        assert simulate(linear, manoeuvre).steps == simulate(bent, manoeuvre, step=0.0025).steps
        assert simulate(bent, manoeuvre).steps == simulate(linear, manoeuvre, step=0.00125).steps


@pytest.mark.parametrize("manoeuvre", ["1", "2"])
def test_the_default_step_is_near_the_converged_run_on_rims(manoeuvre):
    """Oracle: as above."""
    vehicle = paper_vehicle()
    run = simulate_road(vehicle, reference_manoeuvres()[manoeuvre]).run
    settings = RimsSettings()
    fine, row = replace(settings, step=settings.step / 16), car_row(vehicle)[np.newaxis]
    found, converged = (
        rims_batch(row, prepare(run, vehicle, how), "exact")[0] for how in (settings, fine)
    )
    assert error(found, converged) < NEAR


def test_the_kink_costs_the_default_step_on_rims_three_thousandths_at_most():
    """Oracle: as above; a quarter of the step has a 16th of the error."""
    vehicle = paper_vehicle().with_values(DAMPERS)
    run = simulate_road(vehicle, reference_manoeuvres()["2"]).run
    row = car_row(vehicle)[np.newaxis]

    def motion(part):
        settings = RimsSettings(step=RimsSettings().step * part)
        return rims_batch(row, prepare(run, vehicle, settings), "exact")[0]

    converged = motion(1 / 16)
    assert error(motion(1.0), converged) < 30 * NEAR
    assert error(motion(1 / 4), converged) < NEAR
