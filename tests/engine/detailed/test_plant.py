"""The detailed car in a campaign: what is known of it, its points, and how a drive ends."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from ridetune.engine.campaign import Campaign
from ridetune.engine.campaign_run import drive
from ridetune.engine.detailed.car_file import reference_car
from ridetune.engine.detailed.concept import cut, known_vehicle
from ridetune.engine.detailed.plant import DetailedPlant
from ridetune.engine.equilibrium import loads_at_rest
from ridetune.engine.errors import Cancelled, SimulationError
from ridetune.engine.manoeuvre import Manoeuvre
from ridetune.engine.sensors import RECORDED, SensorSet
from ridetune.engine.torque_laws import DriveTable

CAR = reference_car()
PLANT = DetailedPlant.of(CAR)


def push(torque, duration):
    drive = DriveTable((0.0, 0.2), (0.0, 2.0 * torque))
    return Manoeuvre("push", "road", duration, drive=drive)


def driven(plant, manoeuvre, progress=lambda seconds: None):
    return plant.drive(
        manoeuvre, sample_step=plant.step, progress=progress, cancelled=lambda: False
    )


def test_the_measured_point_is_the_sprung_mass_s_cg():
    """Oracle: the moment balance of all bodies less the corners at their wheel centres."""
    assert_allclose(cut(CAR).sprung.cg, CAR.measured_point, rtol=0, atol=5e-4)


def test_the_known_car_has_the_masses_of_a_car_cut_by_hand():
    """Oracle: wheel, carrier and damper tube whole, links, rod and half shaft by half."""
    known = PLANT.vehicle
    assert known.total_mass == pytest.approx(CAR.total_mass, rel=1e-9)
    assert known.front.wheel.mass == pytest.approx(46.9, rel=0.04)
    assert known.rear.wheel.mass == pytest.approx(48.85, rel=0.04)
    for found, by_hand in zip(
        (known.chassis.inertia.xx, known.chassis.inertia.yy, known.chassis.inertia.zz),
        (324.2, 1650.5, 1763.5),
        strict=True,
    ):
        assert found == pytest.approx(by_hand, rel=0.01)


def test_a_measured_point_off_the_cg_is_refused_with_the_right_one():
    with pytest.raises(SimulationError, match=r"CG of the sprung mass is at \[-1\.24.*0\.525"):
        known_vehicle(replace(CAR, measured_point=(-1.0, 0.0, 0.6)))


def test_a_torque_held_by_the_carrier_is_one_on_the_arm():
    """Oracle: an inboard motor's reaction is the chassis's, a hub motor's the carrier's."""
    hubs = tuple(
        replace(wheel, driven_against=wheel.driven_against and wheel.carrier)
        for wheel in CAR.wheels
    )
    assert PLANT.vehicle.rear.torque_reaction == "chassis"
    assert known_vehicle(replace(CAR, wheels=hubs)).rear.torque_reaction == "arm"


@pytest.fixture(scope="module")
def pushed():
    places = {"point.front": (1.0, 0.0, 0.0), "point.left": (0.0, 0.5, 0.0), "point.top": (0, 0, 1)}
    return driven(PLANT.with_points(places), push(300.0, 0.8)).run


def test_the_known_car_stands_on_its_wheels_as_the_car_does(pushed):
    """Oracle: the solver's tyre loads at rest."""
    loads = loads_at_rest(PLANT.vehicle).tyre_load
    for one, other in (("fl", "fr"), ("rl", "rr")):
        measured = pushed[f"tyre.{one}.load"][0] + pushed[f"tyre.{other}.load"][0]
        assert measured == pytest.approx(loads[one] + loads[other], rel=2e-3)


def test_it_has_the_channels_that_it_offers(pushed):
    points = ("seat.driver", "point.front", "point.left", "point.top")
    offered = {*PLANT.channels, *(f"{one}.a_{axis}" for one in points for axis in "xyz")}
    assert {*pushed.channels} == offered


def test_accelerometers_are_carried_by_the_chassis(pushed):
    """Oracle: derivatives of the rates of the measured point and the attitude, small angles."""
    rates = {
        "point.front.a_z": pushed["chassis.z_rate"] - pushed["chassis.pitch_rate"],
        "point.left.a_z": pushed["chassis.z_rate"] + 0.5 * pushed["chassis.roll_rate"],
        "point.top.a_x": pushed["chassis.v_x"] + pushed["chassis.pitch_rate"],
    }
    for name, rate in rates.items():
        derived = np.gradient(rate, pushed.time)[50:-50]
        assert_allclose(derived, pushed[name][50:-50], atol=0.03 * np.abs(derived).max())


def test_a_drive_that_diverges_is_told_and_keeps_its_beginning():
    told = []
    lost = driven(PLANT, push(5e5, 1.0), told.append)
    assert "diverged at t = " in lost.failure
    assert lost.run is not None
    assert all(np.isfinite(lost.run[name]).all() for name in lost.run.columns)
    assert told == sorted(told)
    assert told[-1] <= lost.run.duration + 0.1


def test_it_stops_soon_after_it_is_asked_to():
    told = []
    with pytest.raises(Cancelled):
        PLANT.drive(
            push(1.0, 60.0),
            sample_step=PLANT.step,
            progress=told.append,
            cancelled=lambda: len(told) > 1,
        )
    assert len(told) == 2
    assert told[-1] <= 0.02


def test_processes_record_what_one_process_does():
    """Oracle: the campaign in this process."""
    one = push(200.0, 0.2)
    campaign = Campaign.plan(PLANT, SensorSet(), {"one": one, "two": replace(one, duration=0.3)})
    here = {found.name: found.run for found in drive(campaign, processes=1)}
    beside = {found.name: found.run for found in drive(campaign, processes=2)}
    assert here.keys() == beside.keys()
    for name, run in here.items():
        assert run.columns == list(RECORDED)
        for channel in RECORDED:
            assert_array_equal(run[channel], beside[name][channel])
