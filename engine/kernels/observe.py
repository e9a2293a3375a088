"""Everything a sensor could see at given states: accelerations, forces, loads and travels."""

from typing import NamedTuple

import numpy as np

from ..frames import GRAVITY
from ..jit import compiled, inlined
from .buffer import (
    BARS,
    LOADS,
    ROWS,
    SLOPE,
    STAGE,
    STATES,
    TRACTION,
    chassis_at,
    corner_of,
    given_to,
    load_quad,
    rim_at,
    take_car,
)
from .constrained import bent
from .forces import direction_of_travel, strut
from .free import corner_at, free_slopes
from .kinematics import convective_acceleration, pivot, turned
from .lanes import storer
from .on_rims import rim_arm_at, rim_corner_at, rim_slopes
from .vec3 import add, cross, scale, y_cross


class CarOutput(NamedTuple):
    """Second derivatives and bar torques."""

    x_acceleration: float
    z_acceleration: float
    pitch_acceleration: float
    roll_acceleration: float
    traction: float
    """The rims mode's traction F, N; 0 in the other modes."""
    front_bar: float
    rear_bar: float


class CornerOutput(NamedTuple):
    """One corner; forces in N, on the chassis and along B's axes where they are vectors."""

    angle: float
    rate: float
    acceleration: float
    rise: float
    load: float
    longitudinal: float
    travel: float
    spring: float
    damper: float
    road: float
    mount_x: float
    mount_z: float
    pivot_x: float
    pivot_z: float
    reach: float
    """Rims mode: negative where the wheel centre cannot reach its prescribed height."""
    clearance: float
    """Negative where the wheel centre has passed the mount of its spring-damper."""


CORNER, CORNER_SIZE = len(CarOutput._fields), len(CornerOutput._fields)
OUTPUTS = CORNER + 4 * CORNER_SIZE

store_car, store_corner = storer(CarOutput), storer(CornerOutput)


@inlined
def _pivot_force(corner, chassis, arm, wheel, c_dd, arm_dd, element, force_X, force_Z):
    """Force of the arm on the chassis at the pivot, B: all that acts on the arm, less m a."""
    p = turned(corner.cg_x, corner.cg_y, corner.cg_z, arm)
    c = add(pivot(corner), p)
    angular = add((c_dd.roll, 0.0, 0.0), scale(c_dd.pitch, chassis.e_Y))
    inertial = add(
        add(scale(c_dd.x, chassis.e_X), scale(c_dd.z + GRAVITY, chassis.e_Z)),
        add(cross(angular, c), scale(arm_dd, y_cross(p))),
    )
    acceleration = add(inertial, convective_acceleration(chassis, arm, c, p))
    tyre = add(scale(force_X, chassis.e_X), scale(force_Z, chassis.e_Z))
    compression = element.spring + element.damper
    on_wheel = (-compression * element.axis_x, 0.0, -compression * element.axis_z)
    return add(add(tyre, on_wheel), scale(-corner.mass, acceleration))


@inlined
def _corner_output(corner, chassis, seen, c_dd, arm_dd, force_X, force_Z, road, reach):
    element = strut(corner, seen.wheel.arm, seen.arm)
    compression = element.spring + element.damper
    at_pivot = _pivot_force(
        corner, chassis, seen.arm, seen.wheel, c_dd, arm_dd, element, force_X, force_Z
    )
    return CornerOutput(
        seen.arm.angle,
        seen.arm.rate,
        arm_dd,
        seen.wheel.rise,
        force_Z,
        force_X,
        element.travel,
        element.spring,
        element.damper,
        road,
        compression * element.axis_x,
        compression * element.axis_z,
        at_pivot[0],
        at_pivot[2],
        reach,
        element.clearance,
    )


@inlined
def _keep_car(out, samples, sample, buffer, c_dd):
    """Outputs of the whole car after its slopes have been found."""
    traction, front, rear = buffer[TRACTION], buffer[BARS + 1], buffer[BARS + 3]
    found = CarOutput(c_dd.x, c_dd.z, c_dd.pitch, c_dd.roll, traction, front, rear)
    store_car(out, 0, samples, sample, found)


@inlined
def _keep_corner(out, samples, sample, wheel, found):
    """Outputs of one wheel."""
    store_corner(out, CORNER + wheel * CORNER_SIZE, samples, sample, found)


@compiled
def observe_free(car, states, inputs, road, start, spacing, out):
    """Outputs of one car in the road and posts modes.

    car (CAR_ROWS,), states (n, 16), inputs (n, 16) as of `integrate_free`; out (OUTPUTS, n), in
    which a channel lies in one piece
    """
    buffer, kept, samples = np.zeros(ROWS), out.reshape(-1), states.shape[0]
    take_car(buffer, 1, 0, car)
    driven = (road, start, spacing)
    for i in range(samples):
        buffer[STAGE : STAGE + STATES] = states[i]
        free_slopes(buffer, 1, inputs[i], driven)
        state, chassis = chassis_at(buffer, 1, 0)
        c, way = load_quad(buffer, SLOPE + 8, 1, 0), direction_of_travel(state.x_rate)
        _keep_car(kept, samples, i, buffer, c)
        for w in range(4):
            corner, seen = corner_of(buffer, 4, w), corner_at(buffer, 4, w, state, chassis, way)
            arm_dd, ground = buffer[SLOPE + 12 + w], given_to(buffer, 4, w).road
            found = _corner_output(
                corner, chassis, seen, c, arm_dd, seen.force_X, seen.load, ground, 1.0
            )
            _keep_corner(kept, samples, i, w, found)


@compiled
def observe_rims(car, states, inputs, exact, out):
    """Outputs of one car in the rims mode; inputs (n, 15) as of `integrate_rims`, the rest as of
    `observe_free`.
    """
    buffer, kept, samples = np.zeros(ROWS), out.reshape(-1), states.shape[0]
    take_car(buffer, 1, 0, car)
    driven = (exact,)
    for i in range(samples):
        buffer[STAGE : STAGE + STATES] = states[i]
        u = inputs[i]
        rim_slopes(buffer, 1, u, driven)
        state, chassis = chassis_at(buffer, 1, 0)
        c, way, b = load_quad(buffer, SLOPE + 8, 1, 0), direction_of_travel(u[13]), u[14]
        _keep_car(kept, samples, i, buffer, c)
        for w in range(4):
            corner = corner_of(buffer, 4, w)
            arm, reach = rim_arm_at(buffer, w)
            rim = rim_at(buffer, w)
            seen = rim_corner_at(buffer, 4, w, rim, arm, state, chassis, way, b)
            share = (1.0 - b) * corner.drive_share + b * corner.brake_share
            load = buffer[LOADS + w]
            force_X = share * buffer[TRACTION] - seen.resistance * load
            arm_dd = bent(seen.bend, c)
            found = _corner_output(corner, chassis, seen, c, arm_dd, force_X, load, np.nan, reach)
            _keep_corner(kept, samples, i, w, found)
