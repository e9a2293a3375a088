"""What a fit says of the sensors: what it found of them, and what would mend a channel."""

from collections.abc import Mapping, Sequence

import numpy as np

from .channels import INPUT_CHANNELS
from .compared_runs import ComparedRun
from .fit import DELAY_MATTERS, Offer, SensorEstimate, determined
from .fit_findings import ChannelFaults
from .problem import Problem
from .sensing import A_X
from .sensor_model import LARGEST_GAIN, SMALLEST_GAIN, SensorModel, SensorVariable


def estimated(
    one: SensorVariable,
    value: float,
    std_error: float,
    interval: tuple[float, float],
    at_bound: bool,
    runs: Sequence[ComparedRun],
) -> SensorEstimate:
    """A quantity of a sensor as a fit reports it."""
    half_width = 0.5 * (interval[1] - interval[0])
    return SensorEstimate(
        name=one.name,
        channel=one.channel,
        quantity=one.quantity,
        run=one.run,
        value=value,
        unit=one.unit,
        std_error=std_error,
        confidence_interval=interval,
        start=one.start,
        lower=one.lower,
        upper=one.upper,
        at_bound=at_bound,
        determined=_determined(one, value, half_width, at_bound, runs),
    )


def _determined(
    one: SensorVariable,
    value: float,
    half_width: float,
    at_bound: bool,
    runs: Sequence[ComparedRun],
) -> str:
    """ "yes", "weakly" or "no"; what is nominally 0 is judged by what it matters to."""
    size = abs(value)
    if one.quantity == "delay":
        size = DELAY_MATTERS
    elif one.quantity == "bias":
        size = next(_spread(seen, one.channel) for seen in runs if seen.name == one.run)
    return determined(size, half_width, at_bound)


def _spread(seen: ComparedRun, channel: str) -> float:
    """Standard deviation of a channel in a run, as it is compared or drives the model."""
    if channel not in INPUT_CHANNELS:
        return float(np.std(seen.measured[channel]))
    place = A_X if channel == INPUT_CHANNELS[-1] else INPUT_CHANNELS.index(channel)
    return float(np.std(seen.inputs.stage_inputs[:, 0, place]))


def offers(
    problem: Problem,
    runs: Sequence[ComparedRun],
    faults: Mapping[tuple[str, str], ChannelFaults],
) -> tuple[Offer, ...]:
    """What of a sensor would mend the channels that are probably wrong.

    runs : those whose inputs are not in doubt
    A sensor is that of all runs: nothing is offered where they do not agree.
    """
    found = []
    for run, channel in faults:
        factors = [
            {one.factor for one in faults[seen.name, channel].found if one.factor is not None}
            if (seen.name, channel) in faults
            else set()
            for seen in runs
            if channel in seen.measured
        ]
        if len(factors[0]) != 1 or any(other != factors[0] for other in factors):
            continue
        factor = next(iter(factors[0]))
        if sensor := _mended(problem.sensors, channel, factor):
            quantity, value = next(iter(sensor.items()))
            found.append(
                Offer(
                    run=run,
                    channel=channel,
                    sensor=sensor,
                    sentence=f"{channel} of run {run} would go with the model were its sensor's "
                    f"{quantity} {value:.6g}.",
                )
            )
    return tuple(found)


def _mended(sensors: SensorModel, channel: str, factor: float) -> dict[str, float]:
    """What to fix of a sensor whose readings are so many times what its model says."""
    known = sensors.fixed.get(channel, {})
    if factor < 0.0:
        return {"sign": -known.get("sign", 1.0)}
    gain = factor * known.get("gain", 1.0)
    return {"gain": gain} if SMALLEST_GAIN <= gain <= LARGEST_GAIN else {}
