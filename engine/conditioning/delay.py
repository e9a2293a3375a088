"""The delay of a channel, given or found against a reference.

Y_k and R_k are the spectra of the channel and of its reference, both in one band and tapered at the
ends; R_k is multiplied by (i w_k)^m for a derivative of order m. Then

    (1)  C(tau) = Re sum_k conj(R_k) Y_k exp(i w_k tau)

has its maximum at the delay: first on the samples, by one inverse transform, then by Newton's
method on C' = 0, which is the least-squares fit of Y_k = c R_k exp(-i w_k tau). No parabola goes
through samples, so that there is none of its bias. The standard error follows from what the fit
leaves, E_k, frequency by frequency, so that noise need not be white:

    (2)  var(tau) = sum_k (c w_k |R_k|)^2 |E_k|^2 / 2 / (sum_k (c w_k |R_k|)^2)^2
"""

from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import windows

from ..errors import ConditioningError
from ..filters import in_band
from ..plausibility import FEWEST_SAMPLES
from ..run import Run
from ..vehicle import Range, Vehicle
from .done import Array, Done, history, require_band, require_even

TAPERED = 0.2
"""Share of the record over which the window rises and falls."""

UNLIKE = 0.3
"""Correlation below which a delay means nothing."""

FEWEST_FREQUENCIES = 10
"""Lines of the spectrum, one over the record's length apart, that a band must hold."""

MOST_OF_RECORD = 0.25
"""Share of the record up to which a delay is searched."""


class Lag(NamedTuple):
    """A delay, s, its standard error, s, and how alike the two are when it is taken off."""

    seconds: float
    standard_error: float
    correlation: float


@dataclass(frozen=True, slots=True)
class Delay:
    """Take a channel's delay off: x(t) = reading(t + delay); the record loses as much at its end.

    seconds : by which the channel is late; None to find it
    reference : the channel that is not late
    order : how often the reference is differentiated to become what is compared; negative for
        integrated: -1 makes a speed of an acceleration
    band_hz : in which the two are compared
    longest : delay that is looked for either way, s
    """

    kind: ClassVar[str] = "delay"
    channel: str
    seconds: Annotated[float, Range("s", -1e6, 1e6)] | None = None
    reference: str | None = None
    order: Annotated[int, Range("1", -2, 2)] = 0
    band_hz: Annotated[tuple[float, float], Range("Hz", 0.01, 1e4)] = (0.5, 5.0)
    longest: Annotated[float, Range("s", 1e-3, 10.0)] = 0.5

    def __post_init__(self) -> None:
        """Refuse a delay that is both given and looked for, or neither."""
        if (self.seconds is None) == (self.reference is None):
            raise ConditioningError(
                "a delay is either given in seconds or found against a reference; give one of the "
                "two."
            )

    def apply(self, run: Run, vehicle: Vehicle | None) -> Done:
        """The run with the channel moved, cut to where all channels are known."""
        values = history(run, self.channel)
        if self.seconds is None:
            lag, told = self._found(run, values)
            numbers = {
                "delay_s": lag.seconds,
                "standard_error_s": lag.standard_error,
                "correlation": lag.correlation,
            }
        else:
            lag, told = Lag(self.seconds, 0.0, 1.0), ""
            numbers = {"delay_s": self.seconds}
        time, seconds = run.time, lag.seconds
        first, last = time[0] - min(seconds, 0.0), time[-1] - max(seconds, 0.0)
        kept = (time >= first - 1e-12) & (time <= last + 1e-12)
        if abs(seconds) >= run.duration or np.count_nonzero(kept) < FEWEST_SAMPLES:
            raise ConditioningError(
                f"a delay of {seconds:g} s leaves nothing of a record of {run.duration:.3g} s; "
                "correct it."
            )
        moved = CubicSpline(time, values)(np.clip(time[kept] + seconds, time[0], time[-1]))
        channels = {name: run[name][kept] for name in run.columns} | {self.channel: moved}
        return Done(
            channels,
            time[kept],
            numbers=numbers,
            band_hz=(None, None),
            sentences=(f"{self.channel} was {1e3 * seconds:.2f} ms late{told}; taken off.",),
        )

    def _found(self, run: Run, values: Array) -> tuple[Lag, str]:
        assert self.reference is not None
        require_even(run)
        require_band(run, self.band_hz)
        if (self.band_hz[1] - self.band_hz[0]) * run.duration < FEWEST_FREQUENCIES:
            raise ConditioningError(
                f"band_hz is {self.band_hz[1] - self.band_hz[0]:g} Hz wide, of which a record of "
                f"{run.duration:.3g} s tells too little; widen it."
            )
        if self.reference == self.channel and self.order == 0:
            raise ConditioningError(f"{self.channel} is its own reference; name another channel.")
        if self.longest > MOST_OF_RECORD * run.duration:
            raise ConditioningError(
                f"longest is {self.longest:g} s, more than a quarter of the record of "
                f"{run.duration:.3g} s; lower it."
            )
        reference = history(run, self.reference)
        for name, one in ((self.channel, values), (self.reference, reference)):
            if not moves(run.time, one, self.band_hz):
                raise ConditioningError(
                    f"{name} does not move between {self.band_hz[0]:g} and {self.band_hz[1]:g} Hz, "
                    "so that no delay shows; choose another band or reference."
                )
        lag = find_lag(run.time, values, reference, self.order, self.band_hz, self.longest)
        if abs(lag.seconds) > self.longest:
            raise ConditioningError(
                f"no delay within {self.longest:g} s makes {self.channel} follow {self.reference}; "
                "raise longest, or choose another reference."
            )
        if lag.correlation < UNLIKE:
            raise ConditioningError(
                f"{self.channel} does not follow {self.reference} (correlation "
                f"{lag.correlation:.2f} at best); check its sign, or choose another reference, "
                "order or band."
            )
        told = (
            f" ± {1e3 * lag.standard_error:.2g} ms against {self.reference} (correlation "
            f"{lag.correlation:.3f})"
        )
        return lag, told


def moves(time: Array, values: Array, band: tuple[float, float]) -> bool:
    """Whether a channel holds anything but rounding in a band, Hz."""
    size = max(float(np.max(np.abs(values))), 1e-12)
    return bool(np.std(in_band(time, values, band)) > 1e-9 * size)


def find_lag(
    time: Array,
    values: Array,
    reference: Array,
    order: int,
    band: tuple[float, float],
    longest: float,
) -> Lag:
    """By how much `values` is later than the reference's derivative of some order.

    time : (samples,) evenly spaced, s
    longest : s; a delay beyond it means that there is no maximum within
    """
    step = float(time[-1] - time[0]) / (len(time) - 1)
    window = windows.tukey(len(time), TAPERED)
    later, earlier = (np.fft.rfft(window * in_band(time, one, band)) for one in (values, reference))
    w = 2.0 * np.pi * np.fft.rfftfreq(len(time), step)
    # What the window leaks out of the band, an integral would blow up.
    inside = (w >= 2.0 * np.pi * band[0]) & (w <= 2.0 * np.pi * band[1])
    w, later, earlier = w[inside], later[inside], earlier[inside] * (1j * w[inside]) ** order
    cross = np.conj(earlier) * later

    whole = np.zeros(len(inside), dtype=complex)
    whole[inside] = cross
    likeness = np.fft.irfft(whole, len(time))
    most = int(longest / step) + 1
    lags = np.arange(-most, most + 1)
    delay = step * float(lags[np.argmax(likeness[lags])])
    for _ in range(20):
        turned = cross * np.exp(1j * w * delay)
        slope, bend = -np.sum(w * turned.imag), -np.sum(w**2 * turned.real)
        if bend >= 0.0:
            break
        change = float(np.clip(-slope / bend, -step, step))
        delay += change
        if abs(change) < 1e-9 * step:
            break

    energy = float(np.sum(np.abs(earlier) ** 2))
    gain = float(np.sum((cross * np.exp(1j * w * delay)).real)) / energy
    left = later - gain * earlier * np.exp(-1j * w * delay)
    weight = (gain * w * np.abs(earlier)) ** 2
    variance = np.sum(weight * np.abs(left) ** 2) / 2.0 / np.sum(weight) ** 2
    likeness_there = gain * np.sqrt(energy / np.sum(np.abs(later) ** 2))
    return Lag(delay, float(np.sqrt(variance)), float(likeness_there))
