"""What several measurements need, made once and only where one asks for it."""

from collections.abc import Mapping
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...engine.simulation.car_rows import car_row
from ...engine.simulation.simulate import FREE_STEP
from . import flops
from .histories import Histories, histories
from .modes import Mode, posts_mode, rims_mode, road_mode, some_cars, the_car, the_demand
from .peak import measured_peak
from .timing import QUICK, THOROUGH, Pace, one_core

Array = NDArray[np.float64]

BATCH_SIZE = 64
"""Cars of a batch: eight groups of lanes, and few enough for their states to stay in memory."""


class Workbench:
    """Pace, peak, operations, modes and cars of one run of the benchmark."""

    def __init__(self, quick: bool = False):
        self.pace: Pace = QUICK if quick else THOROUGH

    @cached_property
    def peak(self) -> float:
        """Floating-point operations a second that a core can do at most."""
        with one_core():
            return measured_peak(self.pace)

    @cached_property
    def operations(self) -> Mapping[str, int]:
        """Floating-point operations of a right-hand side by mode."""
        return flops.operations()

    @cached_property
    def one(self) -> Array:
        """The reference car (1, CAR_ROWS)."""
        return car_row(the_car())[np.newaxis]

    @cached_property
    def many(self) -> Array:
        """Cars like it (BATCH_SIZE, CAR_ROWS)."""
        return some_cars(BATCH_SIZE)

    @cached_property
    def road(self) -> Mode:
        """Manoeuvre 2."""
        return road_mode()

    @cached_property
    def posts(self) -> Mode:
        """Its road on four posts."""
        return posts_mode()

    @cached_property
    def rims(self) -> Mode:
        """Its recording on rims."""
        return rims_mode()

    @cached_property
    def our_error(self) -> float:
        """Error of our single car's Manoeuvre 2, which peers are to reach."""
        return self.road.error(self.one)

    @cached_property
    def histories(self) -> Histories:
        """What programs without a road are given of Manoeuvre 2, for our step."""
        return histories(the_car(), the_demand(), FREE_STEP)

    def our_run(self) -> Array:
        """Our single car's Manoeuvre 2, which peers are timed in turn with."""
        return self.road.states(self.one)
