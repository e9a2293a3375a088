"""The detailed car driven: against closed forms, conservation and the paper's figures."""

import signal
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.detailed.builder import Model
from ridetune.engine.detailed.car_file import reference_car
from ridetune.engine.detailed.driving import LONGEST_STEP, DetailedRunDiverged, drive
from ridetune.engine.detailed.equilibrium import settle
from ridetune.engine.detailed.ground import patch_road
from ridetune.engine.detailed.point_mass import apparent_mass, point_mass
from ridetune.engine.detailed.pose import point
from ridetune.engine.errors import Cancelled, SimulationError
from ridetune.engine.frames import CORNERS, GRAVITY
from ridetune.engine.manoeuvre import Manoeuvre, reference_manoeuvres
from ridetune.engine.roads.road import LEFT
from ridetune.engine.roads.road_specs import BumpRoad
from ridetune.engine.torque_laws import Deceleration, DriveTable

CAR = reference_car()


def push(torque, duration=1.5, **more):
    table = DriveTable((0.0, 0.2), (0.0, 2.0 * torque))
    return Manoeuvre("push", "road", duration, drive=table, **more)


def test_at_rest_it_rests():
    """Oracle: equilibrium; displacements stay below what Newton's tolerance leaves."""
    run = drive(CAR, Manoeuvre("wait", "road", 0.3))
    for name in ("chassis.z", "chassis.pitch", "chassis.roll", "chassis.x", "wheel.rl.z"):
        assert np.abs(run[name]).max() < 1e-6
    loads = sum(run[f"tyre.{corner}.load"][-1] for corner in CORNERS)
    assert loads == pytest.approx(CAR.total_mass * GRAVITY, rel=1e-6)


def test_what_acts_at_the_wheels_is_of_the_sample_s_own_time():
    """Oracle: where the wheels rest, the averaged road and the tyre's law there; the table.

    At 20 m/s the road rises by 1.2 mm in a step, which is 240 N of load.
    """
    table = DriveTable((0.0, 0.02), (0.0, 400.0))
    bump = BumpRoad(1.0, 1.0, 0.02)
    manoeuvre = Manoeuvre("on", "road", 0.02, initial_speed=20.0, drive=table, road=bump)
    run = drive(CAR, manoeuvre)
    assert_allclose(run["drive.rl.torque"], 1e4 * run.time, atol=1e-9)
    model = Model(CAR)
    front = CAR.wheels[0]
    q = (settle(model) + model.design)[model.wheels[0]]
    x, _, z = point(q, model.in_body(front.body, front.centre))
    road = patch_road(manoeuvre.demand(point_mass(CAR)).road, CAR.tyre.patch_length)
    x -= CAR.measured_point[0]
    height, slope = road.height(LEFT, x), road.slope(LEFT, x)
    assert slope > 0.03
    assert run["road.fl.z"][0] == pytest.approx(height, rel=1e-9)
    squeeze = CAR.tyre.free_radius + height - z
    load = CAR.tyre.stiffness * squeeze + CAR.tyre.damping * 20.0 * slope
    assert run["tyre.fl.load"][0] == pytest.approx(load, rel=1e-9)


def test_what_stands_stays_standing_at_the_longest_step():
    """Oracle: equilibrium; round-off of 1e-12 m must die out, not rock the car up on its tyres."""
    run = drive(CAR, Manoeuvre("wait", "road", 2.0), step=LONGEST_STEP, sample_step=0.01)
    for name in ("chassis.z", "chassis.v_x", "wheel.fl.z"):
        assert np.abs(run[name]).max() < 1e-9


@pytest.fixture(scope="module")
def pushed():
    return drive(CAR, push(300.0))


def test_speed_is_the_impulse_over_the_apparent_mass(pushed):
    """Oracle: dv/dt = (2 T/r - fr M g tanh(v/v0)) / M', with v from the run, to the swinging.

    The car nods on its springs while the torque is on: the measured point moves against the mean
    of all bodies by some millimetres a swing, which is 1 % of the speed.
    """
    t, v = pushed.time, pushed["chassis.v_x"]
    torque = pushed["drive.rl.torque"] + pushed["drive.rr.torque"]
    rolling = 0.01 * CAR.total_mass * GRAVITY * np.tanh(v / 0.1)
    pull = (torque / CAR.tyre.rolling_radius - rolling) / apparent_mass(CAR)
    impulse = np.sum((pull[1:] + pull[:-1]) / 2.0 * np.diff(t))
    assert v[-1] == pytest.approx(impulse, rel=0.02)


def test_torque_makes_it_squat_and_moves_load_to_the_rear(pushed):
    """Oracle: moment balance about the ground, dW = M a h / wheelbase, to the swinging."""
    assert pushed["chassis.pitch"][-1] < 0.0 < pushed["chassis.a_x"][-1]
    rear = sum(pushed[f"tyre.{corner}.load"] for corner in ("rl", "rr"))
    height = sum(body.mass * body.cg[2] for body in CAR.bodies)
    moved = np.mean(pushed["chassis.a_x"][-100:]) * height / 2.6
    assert np.mean(rear[-100:] - rear[0]) == pytest.approx(moved, rel=0.1)


def test_left_and_right_stay_mirror_images(pushed):
    """The car's own masses are as good as symmetric: the driver is balanced by the chassis's CG."""
    for front in ("f", "r"):
        left, right = pushed[f"wheel.{front}l.z"], pushed[f"wheel.{front}r.z"]
        assert_allclose(left, right, rtol=0, atol=0.05 * np.abs(left).max())


def test_half_the_step_changes_little():
    """Oracle: convergence; 1 ms is within 1 % of 0.5 ms in pitch and speed."""
    coarse, fine = (drive(CAR, push(300.0, 0.6), step=step) for step in (1e-3, 5e-4))
    for name in ("chassis.pitch", "chassis.v_x"):
        miss = np.abs(coarse[name] - fine[name]).max()
        assert miss < 0.01 * np.abs(fine[name]).max()


@pytest.mark.slow
def test_coasting_slows_it_by_the_rolling_resistance():
    """Oracle: fr M g over the apparent mass, over whole swings of the start."""
    run = drive(CAR, Manoeuvre("coast", "road", 2.0, initial_speed=10.0))
    slope = np.polyfit(run.time, run["chassis.v_x"], 1)[0]
    assert -slope == pytest.approx(0.01 * GRAVITY * CAR.total_mass / apparent_mass(CAR), rel=0.05)


@pytest.fixture(scope="module")
def stopped():
    """4 m/s, from 0.2 s on braked at 0.3 g: it stands after 1.6 s, and 1.4 s are left."""
    brake = Deceleration(0.3 * GRAVITY, start=0.2)
    return drive(CAR, Manoeuvre("stop", "road", 3.0, initial_speed=4.0, brake=brake))


@pytest.mark.slow
def test_brakes_slow_it_as_asked(stopped):
    """Oracle: the law's level; 4 m/s take 4 / 0.3 g, to the swinging of the measured point."""
    t, v = stopped.time, stopped["chassis.v_x"]
    braking = (t > 0.3) & (t < 1.4)
    slope = np.polyfit(t[braking], v[braking], 1)[0]
    assert -slope == pytest.approx(0.3 * GRAVITY, rel=0.02)
    front, rear = (stopped[f"brake.{corner}.torque"][200] for corner in ("fl", "rl"))
    assert front / (front + rear) == pytest.approx(0.65)


@pytest.mark.slow
def test_braking_moves_load_to_the_front_and_makes_it_dive(stopped):
    """Oracle: moment balance about the ground, dW = M a h / wheelbase, over a whole swing."""
    swing = (stopped.time > 0.7) & (stopped.time < 1.4)
    front = sum(stopped[f"tyre.{corner}.load"] for corner in ("fl", "fr"))
    height = sum(body.mass * body.cg[2] for body in CAR.bodies)
    moved = -np.mean(stopped["chassis.a_x"][swing]) * height / 2.6
    assert np.mean(front[swing] - front[0]) == pytest.approx(moved, rel=0.1)
    assert np.mean(stopped["chassis.pitch"][swing]) > 0.0


@pytest.mark.slow
def test_brakes_hold_it_at_rest(stopped):
    """Oracle: 1.4 s after it stands the swings have died out and no torque drives it."""
    assert np.abs(stopped["chassis.v_x"][-40:]).max() < 1e-3


def test_a_run_that_diverges_names_time_and_body_and_keeps_its_part():
    """A torque that no tyre carries turns the differential out of its bushings."""
    manoeuvre = push(5e5, 1.0)
    with pytest.raises(DetailedRunDiverged) as lost:
        drive(CAR, manoeuvre)
    assert 0.0 < lost.value.time < 1.0
    assert "body '" in str(lost.value)
    assert "\n" not in str(lost.value)
    assert lost.value.partial is not None
    assert lost.value.partial.time[-1] <= lost.value.time + 1e-9


def test_an_interrupt_is_one_however_deep_in_exudyn_it_arrives():
    """Raised inside a callback of Exudyn's it would come out as an error of that."""
    kept = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            drive(CAR, push(300.0), progress=lambda share: signal.raise_signal(signal.SIGINT))
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, kept)


def test_it_stops_when_told_to():
    told = []
    with pytest.raises(Cancelled):
        drive(CAR, push(300.0), progress=told.append, cancelled=lambda: len(told) > 2)
    assert told == sorted(told)
    assert len(told) == 3


@pytest.mark.parametrize(
    ("manoeuvre", "options", "sentence"),
    [
        (reference_manoeuvres()["heave"], {}, "one of a rig"),
        (push(1.0), {"step": 0.01}, "step is 0.01 s"),
        (push(1.0), {"sample_step": 0.0015}, "no whole number of steps"),
    ],
)
def test_what_it_cannot_do_is_said_before_anything_is_solved(manoeuvre, options, sentence):
    with pytest.raises(SimulationError, match=sentence):
        drive(CAR, manoeuvre, **options)


@pytest.mark.slow
def test_manoeuvre_2_lies_in_the_ranges_of_the_paper():
    """Oracle: Table 2 and Figs. 9 and 12; the first 11 s, on the smooth end of the classes.

    The longest step, with which a_x is off by 4 %, is enough for speeds and a mean pitch.
    """
    two = reference_manoeuvres()["2"]
    road = replace(two.road, class_factor=0.5, band=(0.03, 2.83))
    run = drive(CAR, replace(two.lasting(12.0), road=road), step=LONGEST_STEP, sample_step=0.01)
    assert run["drive.rl.torque"].max() == pytest.approx(600.0, rel=0.05)
    assert run["chassis.v_x"].max() == pytest.approx(15.0, rel=0.01)
    pulling = (run.time > 6.5) & (run.time < 9.8)
    squat = -np.rad2deg(np.mean(run["chassis.pitch"][pulling]))
    assert squat == pytest.approx(0.5, abs=0.1)
    coasting = run.time > 10.6
    slowing = -np.polyfit(run.time[coasting], run["chassis.v_x"][coasting], 1)[0]
    assert slowing == pytest.approx(0.01 * GRAVITY, rel=0.3)
