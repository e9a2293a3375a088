"""Everything a sensor could see at given states: accelerations, forces, loads and travels."""

from typing import NamedTuple

import numpy as np

from ..frames import GRAVITY
from ..jit import compiled, inlined
from .buffer import CAR, ROWS, STAGE, STATES, body_of, corner_of, given_to
from .contact import find_contacts, read_road
from .direct import bar_torques
from .forces import direction_of_travel, strut
from .integrate import car_on_rims, free_car, rims_at
from .kinematics import convective_acceleration, pivot, turned
from .lanes import storer
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


OUTPUTS = len(CarOutput._fields) + 4 * len(CornerOutput._fields)

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
def _free_output(corner, chassis, seen, c_dd, arm_dd, given):
    return _corner_output(
        corner, chassis, seen, c_dd, arm_dd, seen.force_X, seen.load, given.road, 1.0
    )


@inlined
def _rim_output(corner, chassis, seen, c_dd, arm_dd, load, traction, braking):
    share = (1.0 - braking) * corner.drive_share + braking * corner.brake_share
    force_X = share * traction - seen.resistance * load
    return _corner_output(corner, chassis, seen, c_dd, arm_dd, force_X, load, np.nan, seen.reach)


@inlined
def _car_output(body, c_dd, traction, fl, fr, rl, rr):
    front, rear = bar_torques(body, fl.arm, fr.arm, rl.arm, rr.arm)
    return CarOutput(c_dd.x, c_dd.z, c_dd.pitch, c_dd.roll, traction, front, rear)


@inlined
def _store(out, car, fl, fr, rl, rr):
    first = len(car)
    size = len(fl)
    store_car(out, 0, 1, 0, car)
    store_corner(out, first, 1, 0, fl)
    store_corner(out, first + size, 1, 0, fr)
    store_corner(out, first + 2 * size, 1, 0, rl)
    store_corner(out, first + 3 * size, 1, 0, rr)


@compiled
def observe_free(car, states, inputs, road, start, spacing, out):
    """Outputs of one car in the road and posts modes.

    car (CAR_ROWS,), states (n, 16), inputs (n, 16) as of `integrate_free`, out (n, OUTPUTS)
    """
    buffer = np.zeros(ROWS)
    buffer[CAR:] = car
    corner_fl, corner_fr = corner_of(buffer, 0, 1, 0), corner_of(buffer, 1, 1, 0)
    corner_rl, corner_rr = corner_of(buffer, 2, 1, 0), corner_of(buffer, 3, 1, 0)
    for i in range(states.shape[0]):
        buffer[STAGE : STAGE + STATES] = states[i]
        find_contacts(buffer, 1)
        read_road(buffer, 1, inputs[i], road, start, spacing)
        chassis, fl, fr, rl, rr, a = free_car(buffer, 1, 0)
        _store(
            out[i],
            _car_output(body_of(buffer, 1, 0), a.chassis, 0.0, fl, fr, rl, rr),
            _free_output(corner_fl, chassis, fl, a.chassis, a.fl, given_to(buffer, 0, 1, 0)),
            _free_output(corner_fr, chassis, fr, a.chassis, a.fr, given_to(buffer, 1, 1, 0)),
            _free_output(corner_rl, chassis, rl, a.chassis, a.rl, given_to(buffer, 2, 1, 0)),
            _free_output(corner_rr, chassis, rr, a.chassis, a.rr, given_to(buffer, 3, 1, 0)),
        )


@compiled
def observe_rims(car, states, inputs, exact, out):
    """Outputs of one car in the rims mode; inputs (n, 15) as of `integrate_rims`."""
    buffer = np.zeros(ROWS)
    buffer[CAR:] = car
    corner_fl, corner_fr = corner_of(buffer, 0, 1, 0), corner_of(buffer, 1, 1, 0)
    corner_rl, corner_rr = corner_of(buffer, 2, 1, 0), corner_of(buffer, 3, 1, 0)
    for i in range(states.shape[0]):
        buffer[STAGE : STAGE + STATES] = states[i]
        u = inputs[i]
        way, b = direction_of_travel(u[13]), u[14]
        chassis, fl, fr, rl, rr, a = car_on_rims(buffer, 1, 0, rims_at(u), u[12], way, b, exact)
        c, F = a.chassis, a.traction
        _store(
            out[i],
            _car_output(body_of(buffer, 1, 0), c, F, fl, fr, rl, rr),
            _rim_output(corner_fl, chassis, fl, c, a.fl, a.fl_load, F, b),
            _rim_output(corner_fr, chassis, fr, c, a.fr, a.fr_load, F, b),
            _rim_output(corner_rl, chassis, rl, c, a.rl, a.rl_load, F, b),
            _rim_output(corner_rr, chassis, rr, c, a.rr, a.rr_load, F, b),
        )
