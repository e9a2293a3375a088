"""Recordings as a process has them that did not read them: asked for once, then remembered."""

import json
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

from ...engine.remembered import Remembered
from ...engine.run import Run
from ...engine.simulation.rims_settings import RimsSettings
from ..storage.measurement import Measurement, done_to
from .runs import size, with_braking

if TYPE_CHECKING:
    from ...engine.simulation.recorded_motion import RecordedMotion

REMEMBERED_VALUES = 4_000_000
"""Numbers kept in memory over all runs, and as many over all motions: 32 MB."""


class LentRecordings:
    """Runs of measurements, and the motion that they prescribe to every car."""

    def __init__(self, ask: Callable[[Measurement], Run]):
        """`ask` fetches a run from where it is read."""
        self._ask = ask
        self._runs: Remembered[str, Run] = Remembered(REMEMBERED_VALUES)
        self._motions: Remembered[tuple[object, RimsSettings], RecordedMotion] = Remembered(
            REMEMBERED_VALUES
        )

    def run(self, measurement: Measurement) -> Run:
        """The recording as it is used."""
        known = json.dumps(vars(measurement), sort_keys=True)
        return self._runs.made(known, lambda: self._ask(measurement), size)

    def motion(
        self,
        measurement: Measurement,
        settings: RimsSettings,
        braking: Iterable[tuple[float, float]] | None,
    ) -> "RecordedMotion":
        """What the recording prescribes to every car, with its braking marked, if it is marked.

        Noise and marks are no part of the motion, so that it outlives a change of them, but for
        noise that conditioning asks for.
        """
        from ...engine.simulation.recorded_motion import recorded_motion

        run = with_braking(self.run(measurement), braking)
        motion = self._motions.made(
            (done_to(measurement), settings),
            lambda: recorded_motion(run, settings),
            lambda made: made.stage_inputs.size,
        )
        return replace(motion, run=run)
