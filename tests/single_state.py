"""The engine's accelerations in a single state, as the independent programs give them."""

import numpy as np
from ridetune.engine.roads.road import Road
from ridetune.engine.simulation.car_rows import car_row
from ridetune.engine.simulation.integration import free_outputs, rims_outputs
from ridetune.engine.simulation.output_channels import corner_output


def accelerations(vehicle, q, qd, *, road_height, road_rate, drive, brake, lift_off=False):
    """Second derivatives (8,) of the free car's coordinates in one state.

    q, qd (8,) : coordinates (`frames.COORDINATES`) and rates
    road_height, road_rate, drive, brake (4,) : contact points' heights (m) and rates, torques (N m)
    """
    acting = np.concatenate([road_height, road_rate, drive, brake])[np.newaxis]
    state = np.concatenate([q, qd])[np.newaxis]
    out = free_outputs(car_row(vehicle, lift_off), state, acting, Road.flat())
    arms = [corner_output(out, corner, "acceleration")[0] for corner in range(4)]
    return np.array([*out[0, :4], *arms])


def rims_accelerations(
    vehicle, pose, rates, v, u, u_rate, u_acc, a_x, braking=0.0, traction="exact"
):
    """Second derivatives and wheel forces of a car on its rims in one state.

    pose, rates (3,) : z, pitch, roll and their rates; v : speed, m/s
    u, u_rate, u_acc (4,) : wheel centres' heights from rest and derivatives
    Returns q, qd and qdd (8,), vertical_force and longitudinal_force (4,).
    """
    state = np.zeros(16)
    state[1:4], state[8], state[9:12] = pose, v, rates
    acting = np.concatenate([u, u_rate, u_acc, [a_x, v, braking]])[np.newaxis]
    out = rims_outputs(car_row(vehicle), state[np.newaxis], acting, traction == "exact")

    def of_corners(name):
        return np.array([corner_output(out, corner, name)[0] for corner in range(4)])

    return {
        "q": np.concatenate([state[:4], of_corners("angle")]),
        "qd": np.concatenate([state[8:12], of_corners("rate")]),
        "qdd": np.concatenate([out[0, :4], of_corners("acceleration")]),
        "vertical_force": of_corners("load"),
        "longitudinal_force": of_corners("longitudinal"),
    }
