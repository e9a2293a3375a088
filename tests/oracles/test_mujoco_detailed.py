"""The detailed car against MuJoCo's bodies and forces written out by hand."""

import numpy as np
import pytest
from ridetune.engine.detailed.builder import Model
from ridetune.engine.detailed.car_file import reference_car
from ridetune.engine.detailed.equilibrium import settle
from ridetune.engine.detailed.pose import rotation
from ridetune.engine.frames import GRAVITY

from .mujoco_detailed import MujocoDetailedCar


@pytest.fixture(scope="module")
def at_rest():
    """The oracle, its bodies where the engine lets the car rest."""
    model = Model(reference_car())
    q = settle(model) + model.design
    oracle = MujocoDetailedCar(model.car)
    oracle.place(q[:, :3], rotation(q[:, 3:]) @ np.swapaxes(np.array(model.frames), 1, 2))
    return oracle


def test_no_force_is_left_in_any_of_164_motions_at_rest(at_rest):
    """Oracle: N^T f = 0, to 1e-8 of the weight; the static solver's own residual is below."""
    motions = at_rest.admissible()
    assert motions.shape[1] == 164
    left = motions.T @ at_rest.applied()
    assert np.abs(left).max() < 1e-8 * reference_car().total_mass * GRAVITY
