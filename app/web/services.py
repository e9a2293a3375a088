"""What the handlers share, made once per service and found at `app.state.services`."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Protocol, TypeVar, cast

from fastapi import Depends
from starlette.requests import HTTPConnection

from ...engine.vehicle import Vehicle
from ..jobs.cluster import Cluster
from ..jobs.jobs import Jobs
from ..recordings.recordings import Recordings
from ..settings import Settings
from ..simulators.simulators import Simulators
from ..storage.store import Store
from ..work.warmup import WarmUp
from .callers import Callers
from .draining import Draining
from .metrics import Metrics
from .pool import Pool
from .readiness import Readiness
from .shares import Shares

T = TypeVar("T")


class Viewers(Protocol):
    """The 3D scenes of the sessions; every method may be called from any thread."""

    def show(self, sid: str, vehicle: Vehicle) -> None:
        """Show a car in a session's scene."""

    def stop(self, sid: str) -> None:
        """End a session's scene."""

    def reap(self) -> None:
        """End the scenes nobody has watched for a while."""

    def count(self) -> int:
        """How many scenes there are."""
        ...

    def close(self) -> None:
        """End all scenes."""


@dataclass(frozen=True)
class Services:
    """One running service.

    interactive : for what a person waits for and takes a core, in one of the simulators
    readers : for what opens files in children
    event_streams, simulation_streams : of jobs, and of what a slider asks for, open at the moment
    """

    settings: Settings
    store: Store
    recordings: Recordings
    interactive: Pool
    simulators: Simulators
    readers: Pool
    cluster: Cluster
    jobs: Jobs
    warmup: WarmUp
    draining: Draining
    readiness: Readiness
    metrics: Metrics
    callers: Callers
    event_streams: Shares
    simulation_streams: Shares
    viewers: Viewers

    def in_simulator(
        self, sid: str, work: Callable[..., T], *given: Any, **answers: Callable[..., Any]
    ) -> T:
        """Result of `work(host, *given)` in a simulator, for a session; on a thread of the pool for
        interactive work. `answers` are what the work may ask for besides recordings. Refused while
        the kernels are not there.
        """
        self.warmup.require()
        return self.simulators.run(sid, work, *given, recording=self.recordings.run, **answers)


def services_of(connection: HTTPConnection) -> Services:
    """The services of the application that serves a request or a websocket."""
    return cast(Any, connection.app).state.services


async def _shared(connection: HTTPConnection) -> Services:
    """As `services_of`; what is not asynchronous would wait for a thread of the pool."""
    return services_of(connection)


Shared = Annotated[Services, Depends(_shared)]
