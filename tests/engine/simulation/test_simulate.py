"""Simulations of whole cars: batches, forces, accelerations at points, starts and failures."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.curves import smooth_step
from ridetune.engine.errors import RoadError, SimulationDiverged, SimulationError
from ridetune.engine.frames import AXLES, CORNERS, GRAVITY
from ridetune.engine.identification.identify import identify
from ridetune.engine.identification.problem import Problem
from ridetune.engine.manoeuvre import manoeuvre_from_json, reference_manoeuvres
from ridetune.engine.roads.road import Road
from ridetune.engine.run import Run
from ridetune.engine.simulation.car_rows import car_row, car_rows
from ridetune.engine.simulation.integration import free_states
from ridetune.engine.simulation.rims import prepare
from ridetune.engine.simulation.rims_settings import RimsSettings
from ridetune.engine.simulation.simulate import (
    rims_batch,
    simulate_posts,
    simulate_rims,
    simulate_road,
)
from ridetune.engine.simulation.stepping import prepare_free
from ridetune.engine.torque_laws import HoldSpeed
from ridetune.engine.vehicle_file import reference_vehicles

PLACES = ("mount", "pivot")
STIFFNESSES = np.linspace(18000.0, 32000.0, 65)


@pytest.fixture(scope="module")
def car():
    return reference_vehicles()["paper"]


@pytest.fixture(scope="module")
def short_drive():
    return replace(reference_manoeuvres()["2"], duration=7.0)


@pytest.fixture(scope="module")
def driven(car, short_drive):
    return simulate_road(car, short_drive).run


def rows(*cars):
    return np.stack([car_row(car) for car in cars])


@pytest.mark.parametrize("count", [2, 9, 65])
def test_a_batch_gives_each_cars_single_result(car, short_drive, count):
    """Oracle: the same car alone. Lanes contract products differently: rounding only."""
    inputs = prepare_free(short_drive.demand(car), 0.002, 0.1)
    stiffness = np.array(STIFFNESSES[:count], dtype=float)
    rows = car_rows(car, ["front.suspension.stiffness"], stiffness[:, np.newaxis])
    batch = free_states(rows, inputs).values
    alone = np.concatenate([free_states(row[np.newaxis], inputs).values for row in rows])
    assert_allclose(batch, alone, rtol=0, atol=1e-11)


def test_mounts_and_pivots_carry_the_sprung_mass(car):
    """Oracle: Newton's second law of the chassis alone along its own axes, on a symmetric road.

    sum(mount + pivot) = m_s R^T (a_x, 0, z'' + g). Without roll the lateral reaction of the
    guided chassis has no part along these axes.
    """
    bump = reference_manoeuvres()["bump"]
    run = simulate_road(car, bump, points={"point.cg": (0.0, 0.0, 0.0)}).run
    force_x, force_z = (
        sum(run[f"{place}.{corner}.force_{axis}"] for place in PLACES for corner in CORNERS)
        for axis in "xz"
    )
    sin, cos = np.sin(run["chassis.pitch"]), np.cos(run["chassis.pitch"])
    forward, upward = run["chassis.a_x"], run["point.cg.a_z"] + GRAVITY
    mass = car.chassis.mass
    tolerance = 1e-12 * mass * GRAVITY * len(CORNERS)
    assert_allclose(force_x, mass * (cos * forward - sin * upward), rtol=0, atol=tolerance)
    assert_allclose(force_z, mass * (sin * forward + cos * upward), rtol=0, atol=tolerance)


def test_tyres_carry_the_whole_cars_inertia(car, driven):
    """Oracle: momentum balance along Z, m z'' of every body from the wheels' and chassis's motion.

    Integrated over the run: sum of loads less weight equals the change of vertical momentum. The
    arms' CG is at the wheel centre, so their momentum is m_i times the wheel's rise rate.
    Trapezoidal rule at 5 ms on a 12 Hz hop: relative error (w h)^2/12 = 1.2 % of the hop's part.
    """
    time = driven.time
    load = sum(driven[f"tyre.{corner}.load"] for corner in CORNERS) - car.total_mass * GRAVITY
    impulse = np.concatenate([[0.0], np.cumsum(0.5 * (load[1:] + load[:-1]) * np.diff(time))])
    momentum = car.chassis.mass * driven["chassis.z_rate"] + sum(
        car.axle_at(corner).wheel.mass * np.gradient(driven[f"wheel.{corner}.z"], time)
        for corner in CORNERS
    )
    inner = slice(2, -2)
    assert_allclose(impulse[inner], momentum[inner], atol=0.02 * np.ptp(momentum))


def test_acceleration_at_a_seat_is_the_second_derivative_of_its_path(car, driven):
    """Oracle: second differences of the seat's height, whose error is h^2/12 of the fourth
    derivative: (w h)^2/12 = 1.2 % at 12 Hz, and less where the chassis moves slowly."""
    height = driven["chassis.z"] + (
        0.15 * np.sin(driven["chassis.pitch"])
        + np.cos(driven["chassis.pitch"])
        * (0.37 * np.sin(driven["chassis.roll"]) + 0.05 * np.cos(driven["chassis.roll"]))
    )
    h = driven.sample_step
    expected = (height[2:] - 2.0 * height[1:-1] + height[:-2]) / h**2
    seat = driven["seat.driver.a_z"]
    assert_allclose(seat[1:-1], expected, rtol=0, atol=0.02 * np.abs(seat).max())


def test_a_raised_rig_lifts_the_car_without_moving_the_suspension(car):
    """Oracle: rigid translation."""
    time = np.linspace(0.0, 1.0, 101)
    posts = {f"post.{corner}.z": np.full(time.size, 0.02) for corner in CORNERS}
    run = simulate_posts(car, Run("raised", time, posts)).run
    assert_allclose(run["chassis.z"], 0.02, atol=1e-9)
    for corner in CORNERS:
        assert_allclose(run[f"suspension.{corner}.travel"], 0.0, atol=1e-9)


def test_a_car_stands_on_a_tilted_start_in_equilibrium(car):
    """Oracle: accelerations at the start vanish, and each side's tyres follow its height."""
    x = np.arange(-10.0, 30.0, 0.5)
    road = Road(-10.0, 0.5, np.full(x.size, 0.01), np.zeros(x.size))
    standing = replace(reference_manoeuvres()["coast"], duration=1.0, initial_speed=0.0)
    run = simulate_road(car, standing, road=road).run
    assert abs(run["seat.driver.a_z"]).max() < 1e-7
    # Left tyres up by 10 mm on a 1.5 m track: roll of the ground 0.38 deg, the body rolls less
    # than twice that and in the same sense.
    assert 0.01 / 1.51 * 0.9 < run["chassis.roll"][0] < 2 * 0.01 / 1.50


def test_lift_off_keeps_loads_positive_and_reports_the_share_of_time_without_contact(car):
    bump = reference_manoeuvres()["bump"]
    pulled = simulate_road(car, bump)
    free = simulate_road(car, bump, lift_off=True)
    assert min(pulled.run[f"tyre.{c}.load"].min() for c in CORNERS) < 0.0
    assert min(free.run[f"tyre.{c}.load"].min() for c in CORNERS) == 0.0
    assert pulled.negative_load_share["fl"] > 0.0
    assert free.negative_load_share["fl"] > 0.0


def test_divergence_names_time_and_coordinate(car):
    """A pothole a hundred times too deep throws the car over."""
    x = np.arange(0.0, 100.0, 0.25)
    depth = np.where((x > 20.0) & (x < 25.0), -30.0, 0.0)
    road = Road(0.0, 0.25, depth, np.zeros(x.size))
    with pytest.raises(SimulationDiverged, match=r"diverged at t = \d+\.\d+ s in \w+\.") as caught:
        simulate_road(car, reference_manoeuvres()["bump"], road=road)
    assert caught.value.time > 0.0


def test_a_wheel_that_passes_the_mount_of_its_strut_is_named(car):
    """Oracle: the same car with mounts out of the way; the wheel passes a mount 0.1 m above it
    when its travel there reaches 0.1 m. Struts of 1 m are nearly vertical, as those of 0.1 m are
    not, which is worth the 10 ms."""
    time = np.linspace(0.0, 1.0, 201)
    posts = {f"post.{corner}.z": np.zeros(time.size) for corner in CORNERS}
    posts["post.fr.z"] = 0.3 * np.clip((time - 0.5) / 0.05, 0.0, 1.0)
    run, mount = Run("thrown up", time, posts), "front.suspension.mount_height"
    travel = simulate_posts(car.with_values({mount: 1.0}), run).run["suspension.fr.travel"]
    passed = time[np.argmax(travel > 0.1)]
    assert 0.5 < passed < 0.6
    sentence = r"in suspension\.fr\.travel; the wheel centre passed the mount .* raise mount_height"
    with pytest.raises(SimulationDiverged, match=sentence) as caught:
        simulate_posts(car.with_values({mount: 0.1}), run)
    assert caught.value.time == pytest.approx(passed, abs=0.01)


def test_wheels_on_a_recording_that_pass_a_mount_are_named(car):
    """Oracle: the rear wheels rise 0.2 m in 0.1 s under a car whose body cannot follow."""
    time = np.linspace(0.0, 1.0, 201)
    rise = 0.2 * np.clip((time - 0.5) / 0.1, 0.0, 1.0)
    channels = {f"wheel.{c}.z": rise if c[0] == "r" else 0.0 * time for c in CORNERS}
    run = Run("thrown up", time, channels | {"chassis.a_x": 0.0 * time})
    low = car.with_values({"rear.suspension.mount_height": 0.05})
    with pytest.raises(SimulationDiverged, match=r"in suspension\.r[lr]\.travel; .* mount"):
        simulate_rims(low, run)
    assert np.all(np.isnan(rims_batch(rows(low, car), prepare(run, car), "exact")[0, -1]))


def test_rims_out_of_reach_are_named(car, driven):
    """Wheel heights in mm read as m pass any mount, and then cannot be reached by an arm of 1 m."""
    wheels = {
        name: 1000.0 * values if name.startswith("wheel") else values
        for name, values in driven.channels.items()
    }
    run = Run("wrong unit", driven.time, wheels)
    with pytest.raises(SimulationDiverged, match=r"passed the mount .* check the units"):
        simulate_rims(car, run)
    high = {f"{axle}.suspension.mount_height": 5.0 for axle in AXLES}
    with pytest.raises(SimulationDiverged, match="wheel centre cannot reach"):
        simulate_rims(car.with_values(high), run)


def test_a_car_without_equilibrium_fails_alone_in_its_batch(car, driven):
    """Oracle: arms of 0.1 m cannot follow wheels that start half a metre apart; arms of 1 m can."""
    raised = {**driven.channels, "wheel.fl.z": driven["wheel.fl.z"] + 0.5}
    run = Run("raised", driven.time, raised)
    short = car.with_values({"front.pivot.distance": 0.1})
    inputs = prepare(run, car)
    batch = rims_batch(rows(short, car), inputs, "exact")
    assert np.all(np.isnan(batch[0]))
    assert_allclose(batch[1], rims_batch(rows(car), inputs, "exact")[0], rtol=0, atol=1e-11)
    with pytest.raises(SimulationError, match="No static equilibrium"):
        simulate_rims(short, run)


def test_a_lifted_car_starts_at_rest_on_its_lifted_wheels(car, driven):
    """Oracle: rigid translation, beyond the reach of arms whose chassis stays down."""
    time = np.linspace(0.0, 1.0, 201)
    channels = {f"wheel.{corner}.z": np.full(time.size, 3.0) for corner in CORNERS}
    run = simulate_rims(car, Run("lifted", time, channels | {"chassis.a_x": 0.0 * time})).run
    assert_allclose(run["chassis.z"], 3.0, rtol=0, atol=1e-9)
    assert_allclose(run["arm.fl.angle"], 0.0, rtol=0, atol=1e-9)


def test_modes_refuse_each_others_manoeuvres(car):
    manoeuvres = reference_manoeuvres()
    with pytest.raises(SimulationError, match="posts mode"):
        simulate_road(car, manoeuvres["heave"])
    with pytest.raises(SimulationError, match="road mode"):
        simulate_posts(car, manoeuvres["2"])
    with pytest.raises(SimulationError, match="lacks post.fl.z"):
        simulate_posts(car, Run("none", np.array([0.0, 1.0]), {}))


def test_a_misspelt_choice_is_refused_with_the_choices(car, driven, short_drive):
    with pytest.raises(SimulationError, match='traction is "exakt"; it can be "exact" or "paper"'):
        simulate_rims(car, driven, traction="exakt")
    with pytest.raises(SimulationError, match='traction is "typo"; it can be "exact" or "paper"'):
        rims_batch(rows(car), prepare(driven, car), "typo")
    for simulate, motion in (
        (simulate_road, short_drive),
        (simulate_posts, reference_manoeuvres()["heave"]),
        (simulate_rims, driven),
    ):
        with pytest.raises(SimulationError, match='model is "7DOF"; it can be "8dof" or "7dof"'):
            simulate(car, motion, model="7DOF")


def test_what_the_seven_dof_model_ignores_is_told(car, driven, short_drive):
    """Oracle: the same run, but for the sentence."""
    plain = simulate_road(car, short_drive, model="7dof")
    lifted = simulate_road(car, short_drive, model="7dof", lift_off=True)
    assert plain.warnings == ()
    assert "lift_off is ignored" in lifted.warnings[0]
    assert_allclose(lifted.run["chassis.z"], plain.run["chassis.z"], rtol=0, atol=0)
    finer = simulate_road(car, short_drive, model="7dof", step=0.001)
    assert "step is ignored" in finer.warnings[0]

    plain = simulate_rims(car, driven, model="7dof")
    told = RimsSettings(a_x_cutoff_hz=5.0, initial_state="measured", step=0.002)
    marked = replace(driven, braking=())
    many = simulate_rims(car, marked, model="7dof", traction="paper", settings=told)
    names = "traction, braking, a_x_cutoff_hz, initial_state, step are ignored"
    assert names in many.warnings[-1]
    assert_allclose(many.run["chassis.z"], plain.run["chassis.z"], rtol=0, atol=0)


def test_posts_with_gaps_are_refused(car):
    time = np.linspace(0.0, 1.0, 101)
    posts = {f"post.{corner}.z": np.zeros(time.size) for corner in CORNERS}
    posts["post.rl.z"] = np.where(time == 0.5, np.nan, 0.0)
    with pytest.raises(SimulationError, match=r"gaps \(not a number\) in post\.rl\.z; cut"):
        simulate_posts(car, Run("holed", time, posts))


def test_a_grade_takes_no_speed(car):
    """Oracle: docs/model.md; without rolling resistance no force acts along X, so the speed at the
    top of a 5 % grade of 40 m, with the car at rest on its springs again, is that at its foot."""
    free = {f"{axle}.tyre.rolling_resistance": 0.0 for axle in AXLES}
    x = np.arange(0.0, 80.0, 0.5)
    ramp = 0.05 * 40.0 * smooth_step((x - 10.0) / 40.0)
    rolling = replace(reference_manoeuvres()["coast"], duration=9.0, initial_speed=10.0)
    road = Road(0.0, 0.5, ramp, ramp)
    run = simulate_road(car.with_values(free), rolling, road=road).run
    assert run["chassis.z"][-1] == pytest.approx(2.0, abs=1e-4)
    assert run["chassis.v_x"][-1] == pytest.approx(10.0, abs=1e-6)


@pytest.mark.parametrize("model", ["8dof", "7dof"])
def test_leaving_a_given_road_is_told_with_place_and_time(car, model):
    """Oracle: at 20 m/s the front wheels, 1.30 m ahead, pass X = 31.28 m at 1.499 s."""
    drive = replace(reference_manoeuvres()["constant-speed-c"], duration=3.0)
    rough = 0.001 * (np.arange(31) % 2)

    def warnings(start, spacing):
        road = Road(start, spacing, rough, 0.0 * rough, name="r.csv")
        return simulate_road(car, drive, road=road, model=model).warnings

    [short] = warnings(1.28, 1.0)
    assert "r.csv ends at X = 31.28 m" in short
    assert "pass at t = 1.50 s on their way to 61.30 m" in short
    assert warnings(0.0, 3.0) == ()
    [displaced] = warnings(20.0, 2.0)
    assert "begins at X = 20.00 m, ahead of the front wheels, which start at 1.30 m" in displaced
    assert len(warnings(1000.0, 1.0)) == 1
    for ground in (None, Road.flat()):
        assert simulate_road(car, drive, road=ground, model=model).warnings == ()


def test_a_given_road_spares_building_the_manoeuvre_s_own(car):
    """Oracle: a manoeuvre whose own road cannot be built, on a road that can."""
    held = replace(reference_manoeuvres()["2"], duration=1.0, initial_speed=5.0, drive=HoldSpeed())
    with pytest.raises(RoadError, match="never ends"):
        simulate_road(car, held)
    assert simulate_road(car, held, road=Road.flat()).run.duration == pytest.approx(1.0)


@pytest.mark.parametrize("model", ["8dof", "7dof"])
def test_a_speed_no_car_reaches_is_refused(car, model):
    """Oracle: 150 m/s over the acceleration of 3000 N m on 0.3 m and 1240 kg, less fr g."""
    data = {"kind": "table", "time": [0, 25], "torque": [3000, 3000]}
    wild = manoeuvre_from_json({"name": "t", "kind": "road", "duration": 25, "drive": data})
    sentence = r"in chassis\.v_x; .* faster than 150 m/s"
    with pytest.raises(SimulationDiverged, match=sentence) as caught:
        simulate_road(car, wild, model=model)
    assert caught.value.time == pytest.approx(
        150.0 / (3e3 / 0.3 / 1240.0 - 0.01 * GRAVITY), rel=1e-3
    )


def test_both_models_follow_the_same_wheels(car, driven):
    """Oracle: one model's wheels against the other's, from a recording with noise to filter."""
    rng = np.random.default_rng(4)
    noisy = {
        name: values + rng.normal(scale=5e-4, size=values.size) if name[:5] == "wheel" else values
        for name, values in driven.channels.items()
    }
    run = Run("noisy", driven.time, noisy)
    eight, seven = (simulate_rims(car, run, model=model).run for model in ("8dof", "7dof"))
    for corner in CORNERS:
        name = f"wheel.{corner}.z"
        assert_allclose(seven[name], eight[name], rtol=0, atol=1e-9)
        assert np.abs(seven[name] - noisy[name]).max() > 5e-4


def test_both_models_report_the_loads_on_rims(car, driven):
    """Oracle: the share counted from the run's own loads."""
    for model in ("8dof", "7dof"):
        found = simulate_rims(car, driven, model=model)
        for corner, share in found.negative_load_share.items():
            assert share == np.mean(found.run[f"tyre.{corner}.load"] <= 0.0)
        assert list(found.negative_load_share) == list(CORNERS)


def test_rims_fed_back_reproduce_the_chassis(car, driven):
    """Oracle: the direct run itself. Between them: a_x low-passed at 20 Hz, splines at 5 ms."""
    fit = simulate_rims(car, driven).fit_percent
    assert min(fit[name] for name in ("chassis.z", "chassis.pitch", "chassis.roll")) > 99.9
    assert min(fit[f"suspension.{corner}.travel"] for corner in CORNERS) > 99.9
    assert min(fit[f"tyre.{corner}.load"] for corner in CORNERS) > 95.0


@pytest.mark.parametrize("channel", ["chassis.z", "chassis.pitch"])
def test_a_turned_channel_is_told_as_an_identification_tells_it(car, driven, channel):
    """Oracle: the turn that was made, and the identification's own words for the same recording."""
    turned = replace(driven, channels={**driven.channels, channel: -driven[channel]})
    found = simulate_rims(car, turned)
    [sentence] = found.faults
    assert sentence in found.warnings
    assert f"{channel} of run {driven.name} runs against the model" in sentence
    fit = identify(Problem.build(car, [turned], free=["K_F"]), most_evaluations=1)
    assert fit.faults == (sentence.replace(")", " at the start values)", 1),)
    assert simulate_rims(car, driven).faults == ()


def test_a_turned_input_accuses_no_output(car, driven):
    """Oracle: the turn that was made; dive and squat change places by it."""
    turned = replace(driven, channels={**driven.channels, "chassis.a_x": -driven["chassis.a_x"]})
    found = simulate_rims(car, turned)
    [sentence] = found.faults
    assert "chassis.a_x runs against the change of chassis.v_x" in sentence
    assert sentence in simulate_rims(car, turned, model="7dof").faults


def test_gaps_in_an_output_are_no_fault(car, driven):
    gaps = replace(
        driven, channels={**driven.channels, "chassis.z": np.full(driven.time.size, np.nan)}
    )
    assert simulate_rims(car, gaps).faults == ()
