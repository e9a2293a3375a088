"""Sensors in an identification: what they read, what is found of them, what it costs the errors."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.campaign import drive_table_2
from ridetune.engine.channels import INPUT_CHANNELS, OUTPUT_CHANNELS
from ridetune.engine.errors import ProblemError
from ridetune.engine.identification.condensed import triangle
from ridetune.engine.identification.fit import Outcome
from ridetune.engine.identification.fit_file import fit_to_json
from ridetune.engine.identification.identify import Problem, identify
from ridetune.engine.identification.loss import Loss
from ridetune.engine.identification.profile import profile
from ridetune.engine.identification.residuals import Residuals
from ridetune.engine.identification.sensing import Reading, corrected, driven
from ridetune.engine.identification.uncertainty import Information, Uncertainty, uncertainty
from ridetune.engine.parameters import PARAMETER_NAMES
from ridetune.engine.run_notes import DEFAULT_NOISE
from ridetune.engine.sensors import Sensor, SensorSet, measured
from ridetune.engine.simulation.rims import prepare
from ridetune.engine.simulation.rims_settings import RimsSettings
from ridetune.engine.simulation.simulate import rims_batch

from ... import stand_in
from ...factories import paper_vehicle

CAR = paper_vehicle()
FOUR = [
    f"{axle}.suspension.{what}" for axle in ("front", "rear") for what in ("stiffness", "damping")
]
OFF = {name: 1.2 * CAR.value(name) for name in FOUR}
ELSEWHERE = {name: 1.1 * stand_in.REFERENCE.value(name) for name in PARAMETER_NAMES}
NOISY = {name: Sensor(noise=noise) for name, noise in DEFAULT_NOISE.items()}


@pytest.fixture(scope="module")
def true():
    """Manoeuvre 2 of Table 2, without noise."""
    return drive_table_2(CAR)[1]


def read(true, seed=0, **sensors):
    """What the sensors of a test car read, those told by channel with dots as underscores."""
    told = {name.replace("__", "."): sensor for name, sensor in sensors.items()}
    ideal = {name: Sensor() for name in (*INPUT_CHANNELS, "chassis.v_x")}
    noisy = {
        name: replace(sensor, noise=DEFAULT_NOISE[name]) if name in NOISY else sensor
        for name, sensor in {**ideal, **NOISY, **told}.items()
    }
    run = measured(true, SensorSet(200.0, noisy), seed, 0)
    return replace(run, noise={})


def fit(run, **named):
    return identify(Problem.build(CAR, [run], FOUR, start=OFF, **named))


def worst(found, errors=None):
    """The greatest error of a parameter, in its standard errors or those of another fit."""
    return max(
        abs(one.value - CAR.value(one.name)) / other.std_error
        for one, other in zip(found.parameters, (errors or found).parameters, strict=True)
    )


def of_sensor(found, name):
    return next(one for one in found.sensors if one.name == f"sensor.{name}")


def test_what_is_wrong_with_the_outputs_sensors_is_found_with_the_parameters(true):
    """Oracle: the sensors that recorded the car, and the car; four standard errors. With ideal
    sensors the same run leads more than ten of them away."""
    run = read(
        true,
        chassis__z=Sensor(gain=1.05, bias=0.004, delay=0.012),
        chassis__pitch=Sensor(delay=0.02),
        chassis__roll=Sensor(gain=0.9),
    )
    found = fit(
        run,
        sensors={
            "chassis.z": {"gain": "fit", "bias": "fit", "delay": "fit"},
            "chassis.pitch": {"delay": "fit"},
            "chassis.roll": {"gain": 0.9},
        },
    )
    assert worst(found) < 4.0
    assert worst(fit(run), found) > 10.0
    assert found.outcome == Outcome.DETERMINED
    for name, value in (
        ("chassis.z.gain", 1.05),
        ("chassis.z.bias", 0.004),
        ("chassis.z.delay", 0.012),
        ("chassis.pitch.delay", 0.02),
    ):
        one = of_sensor(found, name)
        assert abs(one.value - value) < 4.0 * one.std_error, name
        assert one.determined == "yes"
        assert one.run == (run.name if name.endswith("bias") else None)
    assert found.fixed_sensors == {"chassis.roll": {"gain": 0.9}}


def test_what_is_wrong_with_the_inputs_sensors_is_found_with_the_parameters(true):
    """Oracle: as before."""
    run = read(
        true,
        chassis__a_x=Sensor(gain=0.9, bias=0.1, delay=0.02),
        wheel__fl__z=Sensor(gain=1.1, bias=0.003),
    )
    found = fit(
        run,
        sensors={
            "chassis.a_x": {"gain": "fit", "bias": "fit", "delay": "fit"},
            "wheel.fl.z": {"gain": "fit", "bias": "fit"},
        },
    )
    assert worst(found) < 4.0
    assert worst(fit(run), found) > 10.0
    for name, value in (
        ("chassis.a_x.gain", 0.9),
        ("chassis.a_x.bias", 0.1),
        ("chassis.a_x.delay", 0.02),
        ("wheel.fl.z.gain", 1.1),
        ("wheel.fl.z.bias", 0.003),
    ):
        one = of_sensor(found, name)
        assert abs(one.value - value) < 4.0 * one.std_error, name


def test_known_sensors_of_inputs_are_taken_off_before_they_drive_the_model(true):
    """Oracle: the recording of ideal sensors, cut as the delay cuts it; a spline through samples
    every 5 ms is off by 1e-4 of the noise of z and less."""
    run = read(
        true,
        chassis__a_x=Sensor(gain=-0.9, bias=0.1, delay=0.02),
        wheel__fl__z=Sensor(gain=1.1, bias=0.003, delay=0.01),
    )
    sensors = {
        "chassis.a_x": {"gain": 0.9, "sign": -1, "bias": 0.1, "delay": 0.02},
        "wheel.fl.z": {"gain": 1.1, "bias": 0.003, "delay": 0.01},
    }
    found, ideal = fit(run, sensors=sensors), fit(read(true))
    assert found.runs[0].samples == len(true.time) - 4
    for one, other in zip(found.parameters, ideal.parameters, strict=True):
        # Four samples less and the kinks of a_x between the samples.
        assert abs(one.value - other.value) < 0.2 * other.std_error


def test_prepared_inputs_are_corrected_as_the_recording_would_have_been(true):
    """Oracle: inputs prepared from the corrected recording. Gain and bias commute with all that is
    done to it; a delay moves a spline through the samples or through the nodes, which differ by
    the kinks of a_x alone."""
    settings = RimsSettings()
    wheel, a_x = Reading(1.3, 0.002), Reading(0.8, 0.2)
    told = {"wheel.rl.z": wheel, "chassis.a_x": a_x}
    later = driven(prepare(true, CAR, settings), told)
    before = prepare(corrected(true, told), CAR, settings)
    columns = [*range(13)]
    assert_allclose(
        later.stage_inputs[:, :, columns], before.stage_inputs[:, :, columns], rtol=0, atol=1e-9
    )
    late = {"chassis.a_x": Reading(delay=0.01)}
    moved = driven(prepare(true, CAR, settings), late).stage_inputs[:-10, :, 12]
    oracle = prepare(true, CAR, settings).stage_inputs[2:, :, 12]
    assert_allclose(moved[: len(oracle) - 10], oracle[:-10][: len(moved)], rtol=0, atol=1e-9)


@pytest.mark.parametrize("band", [{}, {"output_cutoff_hz": 5.0}])
def test_derivatives_by_the_sensors_are_those_of_the_residuals(true, band):
    """Oracle: central differences of the residual vector, whose error is of order h^2 + 1e-11/h."""
    asked = Problem.build(
        CAR,
        [read(true)],
        FOUR[:1],
        settings=RimsSettings(**band),
        sensors={
            "chassis.z": {"gain": "fit", "bias": "fit", "delay": "fit", "sign": -1},
            "chassis.roll": {"gain": 1.2, "delay": "fit"},
            "chassis.a_x": {"gain": "fit"},
        },
    )
    residuals = Residuals(asked, rims_batch)
    x = np.array([one.variable(one.start) for one in asked.variables]) + 0.01
    exact = residuals.jacobian(x)
    step = 1e-4
    differences = np.column_stack(
        [
            (residuals.vector(x + step * way) - residuals.vector(x - step * way)) / (2.0 * step)
            for way in np.eye(len(x))
        ]
    )
    size = np.max(np.abs(exact), axis=0)
    assert np.all(np.abs(exact - differences) < 1e-5 * size)
    _, quick = residuals.quick(x + 0.0)
    assert np.all(np.abs(exact - quick) < 1e-4 * size)


def test_outputs_sensors_cost_no_simulations(true):
    """Oracle: the simulations of the same Jacobian without them: one a car and direction."""
    sensors = {name: {"gain": "fit", "bias": "fit", "delay": "fit"} for name in OUTPUT_CHANNELS}
    asked = Problem.build(CAR, [read(true)], FOUR, sensors=sensors)
    residuals = Residuals(asked, rims_batch)
    x = np.array([one.variable(one.start) for one in asked.variables])
    assert residuals.jacobian(x).shape[1] == 13
    assert residuals.simulations == 1 + 2 * 4


def test_sensors_widen_the_errors_as_the_schur_complement_says():
    """Oracle: of the information N = J^T J of car (c) and sensors (s), which white noise of known
    size makes the inverse covariance, N_cc - N_cs N_ss^-1 N_sc is the car's. The errors are
    estimated (see the stand-in's own test): 21 %. Fitted without sensors they are N_cc's."""
    run = stand_in.recording(stand_in.REFERENCE, seed=3)
    sensors = {name: {"gain": "fit", "bias": "fit", "delay": "fit"} for name in OUTPUT_CHANNELS}
    asked = Problem.build(stand_in.REFERENCE, [run], start=ELSEWHERE, sensors=sensors)
    found = identify(asked, simulate=stand_in.simulate)
    x = np.array(
        [
            one.variable(other.value)
            for one, other in zip(asked.variables, [*found.parameters, *found.sensors], strict=True)
        ]
    )
    slopes = Residuals(asked, stand_in.simulate).jacobian(x)
    known = slopes.T @ slopes
    car, sensor = slice(0, 12), slice(12, None)
    told = np.linalg.solve(known[sensor, sensor], known[sensor, car])
    schur = np.linalg.inv(known[car, car] - known[car, sensor] @ told)
    assert_allclose(found.errors.std_error, np.sqrt(np.diag(schur)), rtol=0.21)
    alone = identify(
        Problem.build(stand_in.REFERENCE, [run], start=ELSEWHERE), simulate=stand_in.simulate
    )
    narrow = np.sqrt(np.diag(np.linalg.inv(known[car, car])))
    assert_allclose(alone.errors.std_error, narrow, rtol=0.21)
    assert np.max(found.errors.std_error / alone.errors.std_error) > 1.1
    assert found.errors.covariance.shape == (12, 12)


def test_a_profile_is_as_wide_as_the_errors_that_the_sensors_have_widened():
    """Oracle: the stand-in is linear in the logarithms, where the interval by profile is that of
    the fit; between points half an error apart a chord errs by less than a hundredth."""
    run = stand_in.recording(stand_in.REFERENCE, seed=3)
    sensors = {"chassis.z": {"gain": "fit", "bias": "fit"}}
    asked = Problem.build(stand_in.REFERENCE, [run], FOUR, sensors=sensors)
    found = identify(asked, simulate=stand_in.simulate).parameters[0]
    profiled = profile(asked, found.name, simulate=stand_in.simulate)
    assert_allclose(profiled.confidence_interval, found.confidence_interval, rtol=1e-3)


def test_the_marginal_of_unknown_directions_is_what_they_move_of_the_first():
    """Oracle: by hand. Of three variables x0 + x2 is known to s^2 = 1 and x1 to 4; x0 - x2 is not
    known. Of the first two x0 is unknown and x1 is as known as before."""
    axis = np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0)
    covariance = np.outer(axis, axis) + np.diag([0.0, 4.0, 0.0])
    unknown = np.array([[1.0, 0.0, -1.0]]) / np.sqrt(2.0)
    whole = Uncertainty(covariance, unknown, 2.0, np.ones(3))
    first = whole.marginal(2)
    assert_allclose(first.std_error, [np.inf, 2.0])
    assert_allclose(np.abs(first.unknown), [[1.0, 0.0]], atol=1e-12)
    assert_allclose(first.covariance, [[0.0, 0.0], [0.0, 4.0]], atol=1e-12)


def test_marginal_information_gives_the_marginal_errors():
    """Oracle: the errors of all five variables, of which the first two are taken."""
    rng = np.random.default_rng(0)
    slopes, scores = rng.normal(size=(40, 5)), rng.normal(size=(40, 5))
    whole = Information(triangle(slopes), (scores.T @ scores,), 40.0, (30.0,))
    of_two = whole.marginal([0, 1])
    part, errors = uncertainty(of_two), uncertainty(whole).marginal(2)
    assert_allclose(part.covariance, errors.covariance, rtol=1e-10)
    schur = np.linalg.inv(np.linalg.inv(slopes.T @ slopes)[:2, :2])
    assert_allclose(of_two.root.T @ of_two.root, schur, rtol=1e-10)


def test_a_variable_without_effect_takes_nothing_from_the_others():
    """As the gain of an a_x that is zero throughout. Oracle: the information without it."""
    rng = np.random.default_rng(0)
    slopes, scores = rng.normal(size=(40, 3)), rng.normal(size=(40, 3))
    slopes[:, 2] = scores[:, 2] = 0.0
    whole = Information(triangle(slopes), (scores.T @ scores,), 40.0, (30.0,))
    known = Information(triangle(slopes[:, :2]), (scores[:, :2].T @ scores[:, :2],), 40.0, (30.0,))
    found = uncertainty(whole.marginal([0, 1]))
    assert_allclose(found.covariance, uncertainty(known).covariance, rtol=1e-10)
    assert len(found.unknown) == 0


def test_a_turned_channel_is_offered_its_sign_and_then_fits_as_if_it_were_not(true):
    """Oracle: the fit to the recording of the sensor that is not turned, to rounding."""
    upright = read(true)
    turned = replace(upright, channels={**upright.channels, "chassis.z": -upright["chassis.z"]})
    doubted = fit(turned)
    assert doubted.outcome == Outcome.DOUBTFUL
    [offer] = doubted.offers
    assert (offer.run, offer.channel, offer.sensor) == (turned.name, "chassis.z", {"sign": -1.0})
    mended, plain = fit(turned, sensors={offer.channel: offer.sensor}), fit(upright)
    assert mended.outcome == Outcome.DETERMINED
    assert not mended.offers
    assert mended.cost == pytest.approx(plain.cost, rel=1e-12)
    for one, other in zip(mended.parameters, plain.parameters, strict=True):
        assert one.value == pytest.approx(other.value, rel=1e-9)
        assert one.std_error == pytest.approx(other.std_error, rel=1e-9)


def test_a_channel_in_millimetres_is_offered_its_gain_and_then_fits_the_same(true):
    """Oracle: the same recording in metres; its default noise is a thousandth of the readings'."""
    metres = read(true)
    wrong = replace(metres, channels={**metres.channels, "chassis.z": 1e3 * metres["chassis.z"]})
    [offer] = fit(wrong).offers
    assert offer.sensor == {"gain": 1000.0}
    mended, plain = fit(wrong, sensors={offer.channel: offer.sensor}), fit(metres)
    assert mended.cost == pytest.approx(plain.cost, rel=1e-9)
    for one, other in zip(mended.parameters, plain.parameters, strict=True):
        assert one.value == pytest.approx(other.value, rel=1e-7)


def test_nothing_is_offered_of_a_sensor_that_only_one_of_two_runs_doubts():
    """A sensor is that of all runs."""
    fine = stand_in.recording(stand_in.REFERENCE, seed=1)
    turned = stand_in.recording(stand_in.REFERENCE, name="other", seed=2)
    turned = replace(turned, channels={**turned.channels, "chassis.z": -turned["chassis.z"]})
    build = {"start": ELSEWHERE}
    both = Problem.build(stand_in.REFERENCE, [fine, turned], **build)
    found = identify(both, simulate=stand_in.simulate)
    assert "multiply it by -1" in " ".join(found.warnings)
    assert not found.offers


def test_noise_is_found_to_its_scatter():
    """Oracle: the noise that was added. An estimate from N = 1001 samples scatters by
    1 / sqrt(2 N) = 2.2 %: four of that, and the fit is left as if it had been stated."""
    run = stand_in.recording(stand_in.REFERENCE, seed=5, noise=3.0)
    asked = Problem.build(stand_in.REFERENCE, [run], start=ELSEWHERE, fit_noise=True)
    found = identify(asked, simulate=stand_in.simulate)
    [seen] = found.runs
    assert set(seen.noise_source.values()) == {"fitted"}
    for name, noise in seen.noise.items():
        assert noise == pytest.approx(3.0 * DEFAULT_NOISE[name], rel=4 * 0.022)
    # The sum of squares is N a channel, up to what the last round has moved.
    assert found.cost == pytest.approx(0.5 * 3 * 1001, rel=0.03)
    stated = {name: {"noise": noise} for name, noise in seen.noise.items()}
    again = Problem.build(stand_in.REFERENCE, [run], start=ELSEWHERE, sensors=stated)
    other = identify(again, simulate=stand_in.simulate)
    assert set(other.runs[0].noise_source.values()) == {"typed"}
    for one, same in zip(found.parameters, other.parameters, strict=True):
        assert one.value == pytest.approx(same.value, rel=1e-5)


def test_outliers_do_not_enter_the_noise_that_a_loss_leaves_out():
    """Oracle: the noise without them. The median of N = 1001 values |e| of density 0.636 there
    scatters by 1 / (2 sqrt(N) 0.636 0.6745) = 3.7 %: four of that; one in a hundred above it moves
    it by 0.005 / 0.636 / 0.6745 = 1.2 %."""
    run = stand_in.recording(stand_in.REFERENCE, seed=6)
    values = run["chassis.z"].copy()
    values[5::100] += 0.02
    run = replace(run, channels={**run.channels, "chassis.z": values})
    asked = Problem.build(
        stand_in.REFERENCE, [run], start=ELSEWHERE, fit_noise=True, loss=Loss("cauchy")
    )
    [seen] = identify(asked, simulate=stand_in.simulate).runs
    noise = seen.noise["chassis.z"] / DEFAULT_NOISE["chassis.z"]
    assert noise == pytest.approx(1.0, abs=4 * 0.037 + 0.012)


def test_a_fit_tells_of_its_sensors_as_data():
    run = stand_in.recording(stand_in.REFERENCE, seed=3)
    asked = Problem.build(
        stand_in.REFERENCE,
        [run],
        start=ELSEWHERE,
        sensors={"chassis.z": {"bias": "fit", "sign": 1}, "chassis.roll": {"noise": 0.001}},
    )
    data = fit_to_json(identify(asked, simulate=stand_in.simulate))
    [bias] = data["sensors"]
    assert (bias["name"], bias["channel"], bias["quantity"], bias["run"]) == (
        *("sensor.chassis.z.bias", "chassis.z", "bias", "lap"),
    )
    assert (bias["start"], bias["lower"], bias["upper"], bias["unit"]) == (0.0, -0.05, 0.05, "m")
    assert data["fixed_sensors"] == {"chassis.z": {"sign": 1.0}, "chassis.roll": {"noise": 0.001}}
    assert data["offers"] == []
    assert data["runs"][0]["noise"]["chassis.roll"] == 0.001
    assert data["runs"][0]["noise_source"] == {
        "chassis.z": "default",
        "chassis.pitch": "default",
        "chassis.roll": "typed",
    }
    assert np.shape(data["covariance"]) == (12, 12)


@pytest.mark.parametrize(
    ("sensors", "sentence"),
    [
        ({"chasis.z": {"gain": 1.1}}, "did you mean chassis.z?"),
        ({"chassis.v_x": {"gain": 1.1}}, "no sensor of 'chassis.v_x'; there are chassis.z"),
        ({"chassis.z": {"gian": 1.1}}, "did you mean gain?"),
        ({"chassis.z": 3}, "give its quantities"),
        ({"chassis.z": {"gain": 0}}, "from 1e-06 to 1e+06"),
        ({"chassis.z": {"gain": "fitted"}}, 'give a finite number or "fit"'),
        ({"chassis.z": {"gain": True}}, 'give a finite number or "fit"'),
        ({"chassis.z": {"sign": 0.5}}, "give 1, or -1 for a turned sensor"),
        ({"chassis.z": {"sign": "fit"}}, "fix it at 1 or -1"),
        ({"chassis.z": {"delay": 2.0}}, "from -0.5 to 0.5"),
        ({"chassis.z": {"noise": 0}}, "a standard deviation in m, from 1e-12 to 1e+12"),
        ({"chassis.z": {"noise": 1e-200}}, "a standard deviation in m, from 1e-12 to 1e+12"),
        ({"wheel.fl.z": {"delay": "fit"}}, "find it by conditioning"),
        ({"chassis.a_x": {"noise": "fit"}}, "leave it out"),
        ({"chassis.roll": {"gain": "fit"}}, "no run compares chassis.roll"),
    ],
)
def test_what_a_sensor_cannot_be_is_refused_in_one_sentence(sensors, sentence):
    run = stand_in.recording(stand_in.REFERENCE, outputs=("chassis.z", "chassis.pitch"))
    with pytest.raises(ProblemError) as refused:
        Problem.build(stand_in.REFERENCE, [run], sensors=sensors)
    assert sentence in str(refused.value)


def test_a_bias_is_not_found_of_a_channel_in_whose_measured_state_the_model_begins(true):
    settings = RimsSettings(initial_state="measured")
    fitted = {"chassis.pitch": {"bias": "fit"}}
    with pytest.raises(ProblemError) as refused:
        Problem.build(CAR, [true], FOUR, settings=settings, sensors=fitted)
    assert str(refused.value).startswith("The bias of chassis.pitch is to be fitted, but")
    assert "begin in equilibrium, or state the bias" in str(refused.value)
    Problem.build(CAR, [true], FOUR, settings=settings, sensors={"chassis.a_x": {"bias": "fit"}})


@pytest.mark.parametrize(
    ("found", "told"),
    [
        ((), "chassis.z reads 20 instead of 0 mm, chassis.pitch reads 1 instead of 0 deg;"),
        (("chassis.z",), "there chassis.pitch reads 1 instead of 0 deg;"),
        (("chassis.z", "chassis.pitch"), None),
        (("wheel.fl.z",), None),
    ],
)
def test_a_rest_value_that_is_to_be_found_is_not_to_be_subtracted(true, found, told):
    off = {"chassis.z": 0.02, "chassis.pitch": np.radians(1.0)}
    run = replace(true, channels={k: v + off.get(k, 0.0) for k, v in true.channels.items()})
    sensors = {name: {"bias": "fit"} for name in found}
    [seen] = Problem.build(CAR, [run], FOUR, sensors=sensors).runs
    rests = [one for one in seen.inputs.warnings if "starts at rest" in one]
    assert len(rests) == (told is not None)
    assert told is None or told in rests[0]


def test_a_bias_behind_a_high_pass_and_a_noise_stated_twice_are_refused():
    run = stand_in.recording(stand_in.REFERENCE, samples=4001)
    settings = RimsSettings(output_highpass_hz=0.5)
    with pytest.raises(ProblemError, match="takes a constant off"):
        Problem.build(CAR, [run], settings=settings, sensors={"chassis.z": {"bias": "fit"}})
    with pytest.raises(ProblemError, match="stated twice"):
        Problem.build(CAR, [run], noise={"chassis.z": 1e-3}, sensors={"chassis.z": {"noise": 1e-3}})
