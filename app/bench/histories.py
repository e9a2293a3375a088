"""What acts on the car over time in our own converged run, for programs without a road.

Other multibody programs have no road whose height depends on X. They are given the road under each
wheel, the longitudinal forces and the torques on the arms as functions of time, at the middle of
each of their steps, and hold them over it: any integrator is then one of order 2 at most.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...engine.demand import Demand
from ...engine.frames import CORNERS, CREEP_SPEED
from ...engine.simulation.car_rows import car_row
from ...engine.simulation.integration import free_outputs, free_states
from ...engine.simulation.output_channels import corner_output
from ...engine.simulation.stepping import prepare_free
from ...engine.vehicle import Vehicle
from .car_points import Corner
from .modes import FINER

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Histories:
    """A converged run of ours at the ends of n steps and what acts in their middles.

    states (n + 1, 16); road, road_rate, longitudinal, arm_torque (n, 4)
    """

    states: Array
    road: Array
    road_rate: Array
    longitudinal: Array
    arm_torque: Array

    def upward(self, corner: Corner, k: int) -> Array:
        """Force (n,) of tyre k on its wheel but for -Kt Z - Ct Z', Z the wheel centre's height."""
        tyre = corner.axle.tyre
        road = tyre.stiffness * (self.road[:, k] + corner.axle.wheel.radius)
        return corner.tyre_load + road + tyre.damping * self.road_rate[:, k]


def histories(vehicle: Vehicle, demand: Demand, step: float) -> Histories:
    """Our own run of a demand with steps FINER times shorter, for a peer's steps."""
    inputs = prepare_free(demand, step / FINER, step / 2)
    car = car_row(vehicle)
    states = free_states(car_row(vehicle)[np.newaxis], inputs).values[0]
    outputs = free_outputs(car, states, inputs.sample_inputs, inputs.road)
    road = np.column_stack([corner_output(outputs, k, "road") for k in range(4)])
    longitudinal = np.column_stack([corner_output(outputs, k, "longitudinal") for k in range(4)])
    drive, brake = inputs.sample_inputs[:, 8:12], inputs.sample_inputs[:, 12:16]
    by_chassis = [vehicle.axle_at(name).torque_reaction == "chassis" for name in CORNERS]
    inboard = vehicle.brakes is not None and vehicle.brakes.reaction == "chassis"
    direction = np.tanh(states[:, 8:9] / CREEP_SPEED)
    middle = slice(1, None, 2)
    return Histories(
        states[::2],
        road[middle],
        np.gradient(road, step / 2, axis=0)[middle],
        longitudinal[middle],
        (by_chassis * drive - inboard * brake * direction)[middle],
    )
