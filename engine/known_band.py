"""From which frequency on a conditioned run knows what drives the model and what is compared."""

from .channels import OUTPUT_CHANNELS, WHEEL_CHANNELS
from .run import Run

TIMES_LOWEST = 2.0
"""What is in a band counts from so many times its lowest frequency on: 1/65 is missing there."""


def lowest_known(run: Run) -> dict[str, float]:
    """By channel the frequency, Hz, below which conditioning has left nothing of it."""
    made = {name: record for record in run.conditioning for name in record.channels}
    return {
        name: low
        for name in (*WHEEL_CHANNELS, *OUTPUT_CHANNELS)
        if name in made and (low := made[name].band_hz[0]) is not None
    }


def output_highpass(run: Run) -> float | None:
    """What to compare the run above, Hz; None for everything."""
    lows = lowest_known(run)
    return TIMES_LOWEST * max(lows.values()) if lows else None
