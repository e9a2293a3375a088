"""Other multibody programs, with force elements of their own, drive the car where we do."""

import re
import tomllib
from math import log2
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.app.bench.exudyn_peer import ExudynCar
from ridetune.app.bench.histories import histories
from ridetune.app.bench.modes import relative_error
from ridetune.app.bench.mujoco_peer import MujocoCar
from ridetune.app.bench.peers import EXTRAS
from ridetune.engine.manoeuvre import Manoeuvre
from ridetune.engine.roads.road import Road
from ridetune.engine.torque_laws import Deceleration, DriveTable

from ...factories import random_vehicle

ROOT = Path(__file__).parents[3]


def by_mujoco(integrator):
    return lambda *what: MujocoCar(*what, integrator).states()


def by_exudyn(*what):
    return ExudynCar(*what).states()


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(
    ("states_of", "order"),
    [(by_mujoco("RK4"), 2), (by_mujoco("Euler"), 1), (by_exudyn, 2)],
    ids=["mujoco-rk4", "mujoco-euler", "exudyn-rk4"],
)
def test_they_converge_to_our_converged_run(seed, states_of, order):
    """Oracle: their trees, forces and integrators; holding what acts over a step leaves order 2.

    A random car accelerates from 8 m/s, then brakes, on a wavy road. Differences that fall with the
    order fall to zero: both programs integrate the same equations.
    """
    rng = np.random.default_rng([12, seed])
    vehicle = random_vehicle(rng, braked=True)
    drive = DriveTable((0.0, 0.1, 0.6, 0.6), (0.0, 900.0, 900.0, 0.0))
    brake = Deceleration(level=4.0, start=0.6, ramp=0.1)
    x = np.arange(-4.0, 30.0, 0.02)
    road = Road(-4.0, 0.02, 0.02 * np.cos(1.3 * x + 0.4), 0.02 * np.cos(0.9 * x - 0.7))
    manoeuvre = Manoeuvre("drive", "road", 1.0, initial_speed=8.0, drive=drive, brake=brake)
    demand = manoeuvre.demand(vehicle, road)

    errors = []
    for step in (0.002, 0.001, 0.0005):
        given = histories(vehicle, demand, step)
        errors.append(relative_error(states_of(vehicle, given, step), given.states))
    orders = [log2(a / b) for a, b in zip(errors, errors[1:], strict=False)]
    assert_allclose(orders, order, rtol=0, atol=0.15)
    assert errors[-1] < {1: 1e-2, 2: 1e-4}[order]


def test_what_a_missing_peer_asks_for_is_what_the_project_names():
    """Oracle: the extras of pyproject.toml, and what the tests run on."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    extras = project["project"]["optional-dependencies"]
    for module, extra in EXTRAS.items():
        assert [re.split("[<>=]", one)[0] for one in extras[extra]] == [module]
    assert set(extras["bench"] + extras["detailed"]) <= set(project["dependency-groups"]["test"])
