"""One car through one manoeuvre, one recording or one rig test: the public face of the model.

Three modes (docs/model.md): `simulate_road` drives the car over a road by torques,
`simulate_rims` prescribes the wheel centres and a_x of a recording, `simulate_posts` stands the
car on four moving posts. `rims_batch` is the identification's view of many cars at once.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from ..channels import OUTPUT_CHANNELS, WHEEL_CHANNELS
from ..demand import Demand, PiecewiseLinear, PostMotion
from ..errors import SimulationDiverged, SimulationError
from ..filters import smoothed
from ..frames import AXLES, CORNERS
from ..manoeuvre import Manoeuvre
from ..roads.road import Road
from ..run import Run
from ..vehicle import Vehicle
from . import baseline
from .car_rows import car_row
from .comparison import compared
from .integration import check_sound, free_outputs, free_states, rims_outputs, rims_states
from .output_channels import (
    DEFAULT_POINTS,
    Points,
    common_channels,
    corner_output,
    torque_channels,
    traction_torques,
)
from .recorded_motion import RecordedMotion, recorded_motion
from .rims import RimsInputs, for_car
from .rims_settings import RimsSettings
from .stability import check_free_step, check_rims_step, stable_on_rims
from .stepping import prepare_free

Array = NDArray[np.float64]
Model = Literal["8dof", "7dof"]
Traction = Literal["exact", "paper"]

FREE_STEP = 0.0025
"""Integration step of the road and posts modes, s: wheel hop is in them. Two make a sample step."""

BENT_STEP = 0.00125
"""The same of a car with two-slope dampers, whose kinks lower the integrator's order to 2."""

FASTEST = 150.0
"""Greatest speed that a simulation may reach, m/s."""

SAMPLE_STEP = 0.005
"""Time between samples of a result, s."""


@dataclass(frozen=True, eq=False)
class Simulation:
    """What a simulation gives.

    run : every channel the mode and the model have, at the sample times
    negative_load_share : per corner, share of the samples with a tyre load at or below zero; the
        model then pulls on the road (or, with lift-off, has left it)
    fit_percent : rims mode, per measured channel: 100 (1 - |y - y_hat| / |y - mean(y)|)
    steps : integration steps taken
    faults : those of the warnings by which the recording is probably wrong, as an identification
        would find it
    """

    mode: Literal["road", "rims", "posts"]
    run: Run
    negative_load_share: Mapping[str, float]
    steps: int
    fit_percent: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()


def default_step(*cars: Vehicle) -> float:
    """Integration step of the road and posts modes for cars that take the same, s."""
    linear = (car.axle(axle).suspension.linear for car in cars for axle in AXLES)
    return FREE_STEP if all(linear) else BENT_STEP


def simulate_road(
    vehicle: Vehicle,
    manoeuvre: Manoeuvre,
    *,
    road: Road | None = None,
    model: Model = "8dof",
    lift_off: bool = False,
    step: float | None = None,
    sample_step: float = SAMPLE_STEP,
    points: Points = DEFAULT_POINTS,
) -> Simulation:
    """Drive a car through a manoeuvre of kind "road".

    road : takes the place of the manoeuvre's own; a warning tells where the car leaves it
    lift_off : tyres do not pull
    step : longest integration step, s; `default_step` of the car without
    Raises SimulationError for a manoeuvre of the other kind or steps outside what is accepted or
    too long for the car, SimulationDiverged when the car leaves the model's range.
    """
    if manoeuvre.kind != "road":
        raise SimulationError(
            f"Manoeuvre '{manoeuvre.name}' moves the posts of a rig; simulate it in posts mode."
        )
    demand = manoeuvre.demand(vehicle, road)
    found = _free(
        "road", vehicle, manoeuvre.name, demand, model, lift_off, step, sample_step, points
    )
    if road is None:
        return found
    return replace(found, warnings=(*found.warnings, *_road_warnings(road, vehicle, found.run)))


def simulate_posts(
    vehicle: Vehicle,
    motion: Manoeuvre | Run,
    *,
    model: Model = "8dof",
    lift_off: bool = False,
    step: float | None = None,
    sample_step: float = SAMPLE_STEP,
    points: Points = DEFAULT_POINTS,
) -> Simulation:
    """Stand a car on a four-post rig.

    motion : a manoeuvre of kind "posts", or a run with the four channels post.*.z; a run's posts
        are joined by a C2 spline and its first sample becomes t = 0
    """
    if isinstance(motion, Run):
        demand = posts_demand(motion)
    elif motion.kind == "posts":
        demand = motion.demand(vehicle)
    else:
        raise SimulationError(
            f"Manoeuvre '{motion.name}' drives on a road; simulate it in road mode."
        )
    return _free("posts", vehicle, motion.name, demand, model, lift_off, step, sample_step, points)


def simulate_rims(
    vehicle: Vehicle,
    recording: Run | RecordedMotion,
    *,
    traction: Traction = "exact",
    settings: RimsSettings | None = None,
    model: Model = "8dof",
    points: Points = DEFAULT_POINTS,
) -> Simulation:
    """Let a car follow the wheel centres and a_x of a recording, at the recording's own times.

    recording : a run, or the motion made of it once for many cars
    settings : how a run's motion is made; a motion made before has its own
    traction : "exact" follows a_x exactly; "paper" is the paper's Eq. 3, biased, for comparison
    Raises MeasurementError for a run without the inputs, SimulationError for a step too long for
    the car, SimulationDiverged when a wheel centre cannot reach its height or the car leaves the
    model's range.
    """
    _require_choice("traction", traction, Traction)
    _require_choice("model", model, Model)
    motion = _motion(recording, settings)
    run, settings = motion.run, motion.settings
    inputs = for_car(motion, vehicle)
    ignored: tuple[str, ...] = ()
    if model == "7dof":
        untold = RimsSettings()
        ignored = _ignored(
            traction=traction != "exact",
            braking=run.braking is not None,
            a_x_cutoff_hz=settings.a_x_cutoff_hz != untold.a_x_cutoff_hz,
            initial_state=settings.initial_state != untold.initial_state,
            step=settings.step != untold.step,
        )
        ignored += _straightened(vehicle)
        heights = np.column_stack([run[name] for name in WHEEL_CHANNELS])
        heights = smoothed(run.time, heights, settings.rim_cutoff_hz)
        result = replace(baseline.simulate_rims(vehicle, run.time, heights, points), name=run.name)
    else:
        result = _rims_run(vehicle, inputs, traction, points)
    found = compared(run, result, inputs, settings, linear=model == "7dof")
    return Simulation(
        "rims",
        result,
        _load_shares(result),
        inputs.node_time.size - 1,
        found.fit_percent,
        tuple(dict.fromkeys([*inputs.warnings, *ignored, *found.warnings])),
        found.faults,
    )


def rims_batch(cars: Array, inputs: RimsInputs, traction: Traction) -> Array:
    """z, pitch and roll of many cars (C, CAR_ROWS) on the same rims, (C, samples, 3); NaN where one
    failed or throughout where the step is too long for one.
    """
    _require_choice("traction", traction, Traction)
    stable = stable_on_rims(cars, inputs.step)
    found = np.full((len(cars), len(inputs.time), 3), np.nan)
    if stable.any():
        states = rims_states(cars[stable], inputs, traction == "exact").values
        found[stable] = inputs.at_samples(states[:, :, 1:4], states[:, :, 9:12])
    return found


def _free(
    mode: Literal["road", "posts"],
    vehicle: Vehicle,
    name: str,
    demand: Demand,
    model: Model,
    lift_off: bool,
    step: float | None,
    sample_step: float,
    points: Points,
) -> Simulation:
    """Road and posts modes, which differ only in what moves the contact points."""
    _require_choice("model", model, Model)
    untold = default_step(vehicle)
    inputs = prepare_free(demand, untold if step is None else step, sample_step)
    if model == "7dof":
        if demand.posts is not None:
            result = baseline.simulate_posts(vehicle, demand.posts, sample_step, points)
        else:
            result = baseline.simulate_road(vehicle, demand, sample_step, points)
        result = replace(result, name=name)
        _check_speed(result)
        return Simulation(
            mode,
            result,
            _load_shares(result),
            inputs.steps.size,
            warnings=(
                *_ignored(lift_off=lift_off, step=step not in (None, untold)),
                *_straightened(vehicle),
            ),
        )
    car = car_row(vehicle, lift_off)
    check_free_step(car, demand.brake.values.max(axis=0), float(inputs.steps.max()))
    states = free_states(car[np.newaxis], inputs)
    check_sound(
        states,
        0,
        inputs.time,
        lambda sample: free_outputs(
            car,
            states.values[0, sample - 1 : sample],
            inputs.sample_inputs[sample - 1 : sample],
            inputs.road,
        )[0],
    )
    outputs = free_outputs(car, states.values[0], inputs.sample_inputs, inputs.road)
    channels = common_channels(states.values[0], outputs, points)
    channels |= torque_channels(inputs.sample_inputs)
    ground = "road.{}.z" if mode == "road" else "post.{}.z"
    for index, corner in enumerate(CORNERS):
        channels[ground.format(corner)] = corner_output(outputs, index, "road")
    result = Run(name, inputs.time, channels)
    _check_speed(result)
    return Simulation(mode, result, _load_shares(result), inputs.steps.size)


def _motion(recording: Run | RecordedMotion, settings: RimsSettings | None) -> RecordedMotion:
    if isinstance(recording, Run):
        return recorded_motion(recording, settings or RimsSettings())
    if settings is not None:
        raise SimulationError(
            f"The motion of run {recording.run.name} was made with settings of its own; leave them"
            " out, or give the run."
        )
    return recording


def _rims_run(vehicle: Vehicle, inputs: RimsInputs, traction: Traction, points: Points) -> Run:
    """Channels of the 8-DOF car on its rims, at the recording's times."""
    exact = traction == "exact"
    car = car_row(vehicle)
    check_rims_step(car, inputs.step)
    states = rims_states(car[np.newaxis], inputs, exact)
    nodal = np.concatenate([inputs.stage_inputs[:1, 0], inputs.stage_inputs[:, 2]])
    check_sound(
        states,
        0,
        inputs.node_time,
        lambda node: rims_outputs(
            car, states.values[0, node - 1 : node], nodal[node : node + 1], exact
        )[0],
    )
    motion, given = states.values[0, inputs.seen_nodes], nodal[inputs.seen_nodes]
    outputs = rims_outputs(car, motion, given, exact)
    channels = common_channels(motion, outputs, points)
    channels |= traction_torques(vehicle, outputs, given[:, 14])
    channels["chassis.v_x"] = given[:, 13]
    if not inputs.on_nodes:
        smooth = inputs.at_samples(motion[:, 1:4], motion[:, 9:12])
        channels = {
            name: np.interp(inputs.time, inputs.node_time, values)
            for name, values in channels.items()
        }
        channels |= {name: smooth[:, k] for k, name in enumerate(OUTPUT_CHANNELS)}
    return Run(inputs.name, inputs.time, channels)


def _straightened(vehicle: Vehicle) -> tuple[str, ...]:
    """A warning on axles whose dampers the 7-DOF model takes for linear."""
    bent = [name for name in AXLES if not vehicle.axle(name).suspension.linear]
    if not bent:
        return ()
    return (
        f"The 7-DOF model is linear: {' and '.join(bent)} suspension.damping counts in jounce and"
        " rebound at every speed; rebound_ratio and knee_speed are ignored.",
    )


def _ignored(**told: bool) -> tuple[str, ...]:
    """A warning that lists what was told although the 7-DOF model has no use for it."""
    names = [name for name, given in told.items() if given]
    if not names:
        return ()
    return (
        "The 7-DOF model is linear, has no longitudinal motion, starts at rest and takes its own"
        f" step: {', '.join(names)} {'is' if len(names) == 1 else 'are'} ignored.",
    )


def _require_choice(name: str, value: str, choices: Any) -> None:
    """Raise SimulationError unless a value is one of a Literal's."""
    if value not in get_args(choices):
        listed = " or ".join(f'"{choice}"' for choice in get_args(choices))
        raise SimulationError(f'{name} is "{value}"; it can be {listed}.')


def _check_speed(run: Run) -> None:
    """Raise SimulationDiverged where a car drives faster than a car can."""
    if "chassis.v_x" not in run:
        return
    fast = np.abs(run["chassis.v_x"]) > FASTEST
    if fast.any():
        raise SimulationDiverged(
            float(run.time[np.argmax(fast)]),
            "chassis.v_x",
            f"the car is faster than {FASTEST:g} m/s, where the model means nothing; lower the"
            " torque or the initial speed, or shorten the manoeuvre.",
        )


def _road_warnings(road: Road, vehicle: Vehicle, run: Run) -> tuple[str, ...]:
    """Where the front wheels are on no profile; before and after it the ground is level."""
    if np.ptp(road.left) == 0.0 and np.ptp(road.right) == 0.0:
        return ()
    warnings, name = [], road.name or "given"
    standing = vehicle.front.cg_distance
    front = standing + run["chassis.x"]
    if road.start > standing:
        warnings.append(
            f"The road {name} begins at X = {road.start:.2f} m, ahead of the front wheels, which"
            f" start at {standing:.2f} m: the ground is level up to there; shift its x if the"
            " profile was to begin under the car (X = 0 is where its CG stands)."
        )
    beyond = front > road.end
    if beyond.any():
        warnings.append(
            f"The road {name} ends at X = {road.end:.2f} m, which the front wheels pass at t ="
            f" {run.time[np.argmax(beyond)]:.2f} s on their way to {front.max():.2f} m: the ground"
            " is level from there on; lengthen the profile, shift its x or shorten the manoeuvre."
        )
    return tuple(warnings)


def _load_shares(run: Run) -> dict[str, float]:
    return {
        corner: float(np.mean(run[f"tyre.{corner}.load"] <= 0.0))
        for corner in CORNERS
        if f"tyre.{corner}.load" in run
    }


def posts_demand(run: Run) -> Demand:
    """Demand of a rig test from a run with the posts' heights."""
    names = [f"post.{corner}.z" for corner in CORNERS]
    missing = [name for name in names if name not in run]
    if missing:
        raise SimulationError(
            f"Run {run.name} lacks {', '.join(missing)}; a rig test needs time and the four"
            " post.*.z."
        )
    gaps = [name for name in names if not np.all(np.isfinite(run[name]))]
    if gaps:
        raise SimulationError(
            f"Run {run.name} has gaps (not a number) in {', '.join(gaps)}; cut the record there."
        )
    time = run.time - run.time[0]
    heights = np.column_stack([run[name] for name in names])
    still = PiecewiseLinear.zero(run.duration)
    return Demand(run.duration, 0.0, still, still, None, PostMotion(time, heights))
