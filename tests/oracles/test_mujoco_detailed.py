"""The detailed car against MuJoCo's tree of bodies and forces written out by hand."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.detailed.builder import Model
from ridetune.engine.detailed.car_file import reference_car
from ridetune.engine.detailed.equilibrium import settle
from ridetune.engine.detailed.modes import modes
from ridetune.engine.frames import GRAVITY

from .mujoco_detailed import resting


@pytest.fixture(scope="module")
def settled():
    model = Model(reference_car())
    return model, settle(model) + model.design


@pytest.fixture
def at_rest(settled):
    """The oracle, its bodies where the engine lets the car rest."""
    model, q = settled
    return resting(model, q)


def test_no_force_is_left_in_any_of_164_motions_at_rest(at_rest):
    """Oracle: N^T f = 0, to 1e-8 of the weight; the static solver's own residual is below."""
    motions = at_rest.admissible()
    assert motions.shape[1] == 164
    left = motions.T @ at_rest.applied()
    assert np.abs(left).max() < 1e-8 * reference_car().total_mass * GRAVITY


def test_the_tree_stands_where_the_engine_does(settled, at_rest):
    """Its joints let every body be where Exudyn's constraints let it be."""
    x, _, _, _ = at_rest.now
    assert_allclose(x, settled[1][:, :3], rtol=0, atol=1e-9)


def test_every_mode_has_the_frequency_of_the_tree(settled, at_rest):
    """Oracle: MuJoCo's mass matrix, hand-written forces differenced along the tree's motions.

    Both difference forces over 1e-6 of a unit motion. Forces of 1e4 N carry round-off of 1e-12 N,
    so stiffnesses of 1e-6 N/m, which is nothing; curvature goes with the square of 1e-6 against the
    shortest scale of a law, 1 mm: 1e-6 of a stiffness.
    """
    ours = np.array([mode.frequency for mode in modes(settled[0])])
    theirs = at_rest.frequencies()
    assert_allclose(ours[:7], 0.0, atol=1e-3)
    assert_allclose(theirs[:7], 0.0, atol=1e-3)
    assert_allclose(ours[7:], theirs[7:], rtol=2e-6)
