"""What people wait for, as the service names it to a simulator, where what does it is loaded."""

from collections.abc import Mapping
from typing import Any

from ...engine.run import Run
from ...engine.vehicle import Vehicle
from ..simulators.simulator import Host


def simulated(host: Host, *given: Any) -> tuple[bytes | Run, Vehicle | None]:
    """A simulation, as `simulate.simulated`."""
    from .simulate import simulated

    return simulated(host, *given)


def advised(host: Host, *given: Any) -> Mapping[str, Any]:
    """Advice on what to drive next, as `advice.advised`."""
    from .advice import advised

    return advised(host, *given)
