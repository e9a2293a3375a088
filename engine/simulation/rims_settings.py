"""How recordings are prepared for the rims mode: filters, initial state, longest step."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

from ..errors import SimulationError

InitialState = Literal["equilibrium", "measured"]

SHORTEST_STEP, LONGEST_STEP = 1e-4, 0.02
"""Below nothing is gained but memory and patience are lost; above the cubic splines of the wheels
miss their own corners, s."""

LOWEST_CUTOFF = 0.5
"""Below even the motion of the body on its springs is filtered away, Hz."""

LOWEST_HIGHPASS, HIGHEST_HIGHPASS = 0.02, 5.0
"""Below no recording is long enough; above the motion of the body is filtered away, Hz."""


@dataclass(frozen=True, slots=True)
class RimsSettings:
    """How recordings are prepared; kept in every fit.

    a_x_cutoff_hz, rim_cutoff_hz : zero-phase low-pass of a_x and of the wheels; None for none
    output_cutoff_hz, output_highpass_hz : low-pass and high-pass of z, pitch and roll, of the model
        and of the measurement alike
    initial_state : "equilibrium" (static under the first wheel displacements, at rest) or
        "measured" (z, pitch, roll and their rates from the record's first 0.2 s)
    step : longest integration step, s
    """

    a_x_cutoff_hz: float | None = 20.0
    rim_cutoff_hz: float | None = 50.0
    output_cutoff_hz: float | None = None
    initial_state: InitialState = "equilibrium"
    step: float = 0.005
    output_highpass_hz: float | None = None

    def __post_init__(self) -> None:
        """Refuse settings that mean nothing."""
        for name in ("a_x_cutoff_hz", "rim_cutoff_hz", "output_cutoff_hz"):
            cutoff = getattr(self, name)
            if cutoff is not None and not LOWEST_CUTOFF <= cutoff < math.inf:
                raise SimulationError(
                    f"{name} is {cutoff}; give a frequency of at least {LOWEST_CUTOFF} Hz, or none."
                )
        low = self.output_highpass_hz
        if low is not None and not LOWEST_HIGHPASS <= low <= HIGHEST_HIGHPASS:
            raise SimulationError(
                f"output_highpass_hz is {low}; give a frequency from {LOWEST_HIGHPASS} to "
                f"{HIGHEST_HIGHPASS} Hz, or none."
            )
        high = self.output_cutoff_hz
        if low is not None and high is not None and low >= high:
            raise SimulationError(
                f"output_highpass_hz is {low} and output_cutoff_hz is {high}, which leaves nothing "
                "to compare; lower the first or raise the second."
            )
        if self.initial_state not in get_args(InitialState):
            raise SimulationError(
                f'initial_state is "{self.initial_state}"; it can be "equilibrium" or "measured".'
            )
        if not SHORTEST_STEP <= self.step <= LONGEST_STEP:
            raise SimulationError(
                f"step is {self.step} s; give one from {SHORTEST_STEP} to {LONGEST_STEP} s."
            )

    @property
    def output_band(self) -> tuple[float | None, float | None]:
        """Lowest and highest frequency at which z, pitch and roll are compared, Hz."""
        return self.output_highpass_hz, self.output_cutoff_hz
