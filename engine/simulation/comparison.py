"""How a simulation on recorded rims compares with what was recorded."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..channels import INPUT_CHANNELS
from ..run import Run
from ..run_notes import DEFAULT_NOISE
from .channel_faults import channel_faults
from .initial_state import swings_in
from .rims import RimsInputs, filtered_outputs
from .rims_settings import RimsSettings

Array = NDArray[np.float64]
Outputs = Mapping[str, Array]


@dataclass(frozen=True, slots=True)
class Comparison:
    """What a comparison finds.

    fit_percent : by measured channel
    faults : sentences on channels that are probably wrong
    warnings : these, and one where the record starts away from the model's equilibrium
    """

    fit_percent: Mapping[str, float]
    faults: tuple[str, ...]
    warnings: tuple[str, ...]


def compared(
    measured: Run,
    simulated: Run,
    inputs: RimsInputs,
    settings: RimsSettings,
    *,
    linear: bool,
) -> Comparison:
    """Compare a simulation with the run whose rims drove it.

    inputs : what was made of the run;  settings : the outputs' filters among them
    linear : whether the 7-DOF model was simulated, which begins at rest and says nothing of faults
    """
    recorded, followed = (
        filtered_outputs(one, settings.output_band) for one in (measured, simulated)
    )
    faults = inputs.faults
    if not linear and not faults:  # which would make every output look wrong
        faults = _channel_faults(measured, recorded, followed)
    warnings = list(faults)
    if not inputs.stands:
        warnings += _swing(measured, recorded, followed, settings, linear=linear)
    given = {*INPUT_CHANNELS, "chassis.v_x", "chassis.x"}
    scores = {
        name: fit_percent(recorded.get(name, measured[name]), followed.get(name, simulated[name]))
        for name in measured.columns
        if name in simulated and name not in given
    }
    return Comparison(scores, faults, tuple(warnings))


def fit_percent(measured: Array, simulated: Array) -> float:
    """100 (1 - |y - y_hat| / |y - mean(y)|); minus infinity for a constant measurement missed."""
    scatter = float(np.linalg.norm(measured - np.mean(measured)))
    miss = float(np.linalg.norm(measured - simulated))
    if scatter == 0.0:
        return 100.0 if miss == 0.0 else -np.inf
    return 100.0 * (1.0 - miss / scatter)


def _channel_faults(run: Run, recorded: Outputs, followed: Outputs) -> tuple[str, ...]:
    """What is probably wrong with the recorded outputs; gaps tell nothing."""
    whole = {name: values for name, values in recorded.items() if np.isfinite(values).all()}
    found = channel_faults(run.name, whole, {**DEFAULT_NOISE, **run.noise}, followed)
    return tuple(sentence for one in found.values() for sentence in one.sentences)


def _swing(
    measured: Run, recorded: Outputs, followed: Outputs, settings: RimsSettings, *, linear: bool
) -> list[str]:
    """A sentence where the record starts away from the equilibrium in which the model starts."""
    name, time = measured.name, measured.time
    if linear:
        remedy = "begin the run at rest, as the 7-DOF model does"
        return swings_in(name, time, recorded, followed, remedy=remedy)
    return [] if settings.initial_state == "measured" else swings_in(name, time, recorded, followed)
