"""The detailed car at rest: forces, modes, side view, and cars that cannot stand."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.detailed.builder import Model
from ridetune.engine.detailed.car_file import reference_car
from ridetune.engine.detailed.concept import known_vehicle
from ridetune.engine.detailed.equilibrium import settle
from ridetune.engine.detailed.modes import modes
from ridetune.engine.detailed.records import Joint
from ridetune.engine.detailed.rigid import counts
from ridetune.engine.detailed.side_view import instant_centres
from ridetune.engine.errors import SimulationError
from ridetune.engine.frames import GRAVITY

CAR = reference_car()


@pytest.fixture(scope="module")
def settled():
    model = Model(CAR)
    settle(model)
    return model


def test_exudyn_counts_the_same_degrees_of_freedom():
    found = Model(CAR).system.ComputeSystemDegreeOfFreedom()
    assert (found["nODE2"], found["degreeOfFreedom"]) == (306, counts(CAR).by_joints)
    assert found["redundantConstraints"] == 0


def test_tyres_carry_the_weight_and_its_moments(settled):
    """Oracle: sum W = M g; sum W x and sum W y by the bodies' CGs, to their shift at rest."""
    kind = settled.exudyn.OutputVariableType.Force
    loads = np.array([-settled.system.GetObjectOutput(tyre, kind)[2] for tyre in settled.tyres])
    assert loads.sum() == pytest.approx(CAR.total_mass * GRAVITY, rel=1e-9)
    centres = np.array([wheel.centre for wheel in CAR.wheels])
    cg = sum(body.mass * np.array(body.cg) for body in CAR.bodies) / CAR.total_mass
    assert_allclose(loads @ centres[:, :2] / loads.sum(), cg[:2], rtol=0, atol=5e-3)


@pytest.mark.parametrize(
    ("least", "greatest", "names", "count"),
    [
        (1.2, 1.7, {"chassis"}, 2),
        (2.0, 2.9, {"chassis"}, 1),
        (10.5, 12.5, {"f_rim_L", "f_rim_R", "r_rim_L", "r_rim_R"}, 4),
        (24.0, 29.0, {"f_rim_L", "f_rim_R", "r_rim_L", "r_rim_R"}, 4),
    ],
    ids=["heave and pitch", "roll", "wheel hop", "wheels fore and aft"],
)
def test_modes_lie_in_the_bands_of_a_car(settled, least, greatest, names, count):
    found = [mode for mode in modes(settled) if least < mode.frequency < greatest]
    assert sum(next(iter(mode.shares)) in names for mode in found) == count


def test_seven_motions_have_no_stiffness_and_all_are_counted(settled):
    """x, y, yaw and four wheels' spin: level ground looks alike from everywhere."""
    frequencies = [mode.frequency for mode in modes(settled)]
    assert len(frequencies) == counts(CAR).by_null_space
    assert sum(frequency < 1e-3 for frequency in frequencies) == 7


def test_rear_carriers_turn_about_a_point_ahead_and_above():
    """A multilink axle of this kind lifts its wheels backwards: d of 1 to 3 m, phi above ground."""
    for centre in instant_centres(Model(CAR), "rear", (-0.01, 0.0, 0.01)):
        assert 1.0 < centre.distance < 3.0
        assert 0.1 < centre.angle < 0.6


def test_a_car_that_cannot_stand_is_said_to_be_so_in_one_sentence():
    """Springs without preload and stiffness let the chassis down."""
    slack = replace(CAR.rear, spring=replace(CAR.rear.spring, stiffness=10.0, preload=0.0))
    none = replace(slack.bump_stop, stiffness=0.0, cubic=0.0)
    slack = replace(slack, bump_stop=none)
    with pytest.raises(SimulationError, match=r"At rest|no position of rest") as refused:
        settle(Model(replace(CAR, rear=slack)))
    assert "\n" not in str(refused.value)


def test_a_locked_suspension_is_named():
    """The front carriers welded to the subframe."""
    welds = tuple(
        Joint("revolute", ("f_subframe", f"f_knuckle_{side}"), (0.0, 0.0, 0.3), (0.0, 0.0, 1.0))
        for side in "LR"
    )
    car = replace(CAR, joints=CAR.joints + welds)
    for ask in (lambda: instant_centres(Model(car), "front", (0.0,)), lambda: known_vehicle(car)):
        with pytest.raises(SimulationError, match=r"front suspension (is locked|does not follow)"):
            ask()
