"""What of a sensor would mend a channel that is probably wrong."""

from collections.abc import Mapping, Sequence

from ..simulation.channel_faults import ChannelFaults
from .compared_runs import ComparedRun
from .fit import Offer
from .problem import Problem
from .sensor_model import LARGEST_GAIN, SMALLEST_GAIN, SensorModel


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
