"""Everything a sensor could see at given states: accelerations, forces, loads and travels."""

from typing import NamedTuple

import numpy as np

from ..frames import GRAVITY
from ..jit import compiled, inlined
from .constrained import rim_accelerations, rim_corner
from .direct import accelerations, chassis_attitude, free_corner
from .forces import bar_torque, direction_of_travel, strut
from .integrate import (
    BODY_ROWS,
    CAR_ROWS,
    CORNER_ROWS,
    ROWS,
    STATES,
    _find_contacts,
    _read_road,
)
from .kinematics import convective_acceleration, pivot, turned
from .lanes import loader, storer
from .records import Body, Corner, RimInput, State, WheelInput
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


OUTPUTS = len(CarOutput._fields) + 4 * len(CornerOutput._fields)

load_body, load_corner = loader(Body), loader(Corner)
load_given, load_state = loader(WheelInput), loader(State)
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
    return CarOutput(
        c_dd.x,
        c_dd.z,
        c_dd.pitch,
        c_dd.roll,
        traction,
        bar_torque(body.front_bar_stiffness, body.front_bar_damping, fl.arm, fr.arm),
        bar_torque(body.rear_bar_stiffness, body.rear_bar_damping, rl.arm, rr.arm),
    )


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
    first_car = ROWS - CAR_ROWS
    first_corner = first_car + BODY_ROWS
    buffer[first_car:] = car
    body = load_body(buffer, first_car, 1, 0)
    corner_fl = load_corner(buffer, first_corner, 1, 0)
    corner_fr = load_corner(buffer, first_corner + CORNER_ROWS, 1, 0)
    corner_rl = load_corner(buffer, first_corner + 2 * CORNER_ROWS, 1, 0)
    corner_rr = load_corner(buffer, first_corner + 3 * CORNER_ROWS, 1, 0)
    for i in range(states.shape[0]):
        buffer[STATES : 2 * STATES] = states[i]
        _find_contacts(buffer, 1)
        _read_road(buffer, 1, inputs[i], road, start, spacing)
        state = load_state(buffer, STATES, 1, 0)
        chassis = chassis_attitude(state)
        way = direction_of_travel(state.x_rate)
        given_fl = load_given(buffer, 4 * STATES, 1, 0)
        given_fr = load_given(buffer, 4 * STATES + 4, 1, 0)
        given_rl = load_given(buffer, 4 * STATES + 8, 1, 0)
        given_rr = load_given(buffer, 4 * STATES + 12, 1, 0)
        fl = free_corner(corner_fl, chassis, state, state.fl, state.fl_rate, given_fl, way)
        fr = free_corner(corner_fr, chassis, state, state.fr, state.fr_rate, given_fr, way)
        rl = free_corner(corner_rl, chassis, state, state.rl, state.rl_rate, given_rl, way)
        rr = free_corner(corner_rr, chassis, state, state.rr, state.rr_rate, given_rr, way)
        a = accelerations(body, chassis, fl, fr, rl, rr)
        _store(
            out[i],
            _car_output(body, a.chassis, 0.0, fl, fr, rl, rr),
            _free_output(corner_fl, chassis, fl, a.chassis, a.fl, given_fl),
            _free_output(corner_fr, chassis, fr, a.chassis, a.fr, given_fr),
            _free_output(corner_rl, chassis, rl, a.chassis, a.rl, given_rl),
            _free_output(corner_rr, chassis, rr, a.chassis, a.rr, given_rr),
        )


@compiled
def observe_rims(car, states, inputs, exact, out):
    """Outputs of one car in the rims mode; inputs (n, 15) as of `integrate_rims`."""
    body = load_body(car, 0, 1, 0)
    corner_fl = load_corner(car, BODY_ROWS, 1, 0)
    corner_fr = load_corner(car, BODY_ROWS + CORNER_ROWS, 1, 0)
    corner_rl = load_corner(car, BODY_ROWS + 2 * CORNER_ROWS, 1, 0)
    corner_rr = load_corner(car, BODY_ROWS + 3 * CORNER_ROWS, 1, 0)
    for i in range(states.shape[0]):
        u = inputs[i]
        b = u[14]
        way = direction_of_travel(u[13])
        state = load_state(states[i], 0, 1, 0)
        chassis = chassis_attitude(state)
        z, z_rate = state.z, state.z_rate
        rim_fl, rim_fr = RimInput(u[0], u[4], u[8]), RimInput(u[1], u[5], u[9])
        rim_rl, rim_rr = RimInput(u[2], u[6], u[10]), RimInput(u[3], u[7], u[11])
        fl = rim_corner(corner_fl, chassis, z, z_rate, rim_fl, way, b)
        fr = rim_corner(corner_fr, chassis, z, z_rate, rim_fr, way, b)
        rl = rim_corner(corner_rl, chassis, z, z_rate, rim_rl, way, b)
        rr = rim_corner(corner_rr, chassis, z, z_rate, rim_rr, way, b)
        a = rim_accelerations(body, chassis, fl, fr, rl, rr, u[12], exact)
        c, F = a.chassis, a.traction
        _store(
            out[i],
            _car_output(body, c, F, fl, fr, rl, rr),
            _rim_output(corner_fl, chassis, fl, c, a.fl, a.fl_load, F, b),
            _rim_output(corner_fr, chassis, fr, c, a.fr, a.fr_load, F, b),
            _rim_output(corner_rl, chassis, rl, c, a.rl, a.rl_load, F, b),
            _rim_output(corner_rr, chassis, rr, c, a.rr, a.rr_load, F, b),
        )
