"""Other integrators get the engine's right-hand side, with tolerances that do what is asked."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.app.bench.modes import relative_error, the_car
from ridetune.app.bench.right_hand_side import rate_of
from ridetune.app.bench.solve_ivp_peer import ABSOLUTE, RELATIVE, cheapest
from ridetune.engine.demand import Demand, PiecewiseLinear
from ridetune.engine.roads.road import Road
from ridetune.engine.simulation.car_rows import car_row
from ridetune.engine.simulation.integration import free_states
from ridetune.engine.simulation.stepping import prepare_free

from ...factories import random_road_state, random_vehicle
from ...oracles.mujoco_car import MujocoCar

X = np.arange(-40.0, 40.0, 0.02)
ROAD = Road(-40.0, 0.02, 0.02 * np.cos(1.3 * X + 0.4), 0.02 * np.cos(0.9 * X - 0.7))


def test_right_hand_side_is_that_of_the_multibody_program():
    """Oracle: MuJoCo's tree with forces by hand, the road by its own formula, torques midway."""
    rng = np.random.default_rng(13)
    for _ in range(20):
        vehicle = random_vehicle(rng)
        state = random_road_state(rng, vehicle)
        q, qd, torques = state.q, state.qd, state.inputs
        ramps = (
            PiecewiseLinear(np.array([0.0, 2.0]), np.outer([0.0, 2.0], torques[name]))
            for name in ("drive", "brake")
        )
        demand = Demand(2.0, 0.0, *ramps, ROAD)
        rate = rate_of(car_row(vehicle), demand)(1.0, np.concatenate([q, qd]))

        car = MujocoCar(vehicle)
        car.place(q, qd)
        X = [car.wheel_centre(q, i)[0] for i in range(4)]
        X_rate = [car.at_wheel(q, i, np.array([1.0, 0.0, 0.0])) @ qd for i in range(4)]
        expected = car.accelerations(
            q,
            qd,
            road_height=[ROAD.height(i % 2, X[i]) for i in range(4)],
            road_rate=np.array([ROAD.slope(i % 2, X[i]) * X_rate[i] for i in range(4)]),
            drive=torques["drive"],
            brake=torques["brake"],
        )
        assert_allclose(rate[:8], qd, rtol=0, atol=0)
        assert_allclose(rate[8:], expected, rtol=0, atol=1e-11 * abs(expected).max())


@pytest.mark.parametrize("method", ["RK45", "LSODA"])
def test_the_chosen_tolerances_are_the_loosest_that_reach_the_error(method):
    """Oracle: the solution again, and that with the next looser tolerance of the same kind."""
    still = PiecewiseLinear.zero(0.5)
    demand, car = Demand(0.5, 10.0, still, still, ROAD), car_row(the_car())
    inputs = prepare_free(demand, 1e-4, 0.01)
    reference = free_states(car[np.newaxis], inputs).values[0]
    choice = cheapest(method, car, demand, inputs.time, reference, 1e-4)
    solver = choice.solver
    states, evaluations = solver.solve()
    assert relative_error(states, reference) == choice.error <= 1e-4
    assert evaluations == choice.evaluations

    place = RELATIVE.index(solver.relative)
    assert any(solver.absolute == solver.relative * share for share in ABSOLUTE)
    if place:
        looser = RELATIVE[place - 1]
        wider = replace(
            solver, relative=looser, absolute=looser * solver.absolute / solver.relative
        )
        assert relative_error(wider.solve()[0], reference) > 1e-4
