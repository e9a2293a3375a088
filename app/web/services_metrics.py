"""Numbers of a running service that are looked up when somebody asks for its metrics."""

import logging
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector
from sqlalchemy import func, select

from ..storage.tables import jobs, sessions
from .services import Services

log = logging.getLogger(__name__)


class ServicesCollector(Collector):
    """Asks the parts of a service; one that does not answer is left out."""

    def __init__(self, services: Services):
        self._services = services

    def collect(self) -> Iterator[Metric]:
        """The families of every part that answers."""
        for look in (self._kept, self._failed, self._working, self._workers, self._watched):
            try:
                yield from look()
            except Exception as error:
                log.warning("metrics lack what could not be looked up: %r", error)

    def describe(self) -> Iterable[Metric]:
        """Nothing before the service runs."""
        return ()

    def _kept(self) -> list[Metric]:
        count: Callable[..., Any] = func.count
        with self._services.store.database.reading() as connection:
            kept = connection.execute(select(count()).select_from(sessions)).scalar_one()
            grouped = select(
                jobs.c.kind, jobs.c.state, count(), func.sum(jobs.c.attempts)
            ).group_by(jobs.c.kind, jobs.c.state)
            rows = connection.execute(grouped).all()
        lost: Counter[str] = Counter()
        for kind, _, _, attempts in rows:
            lost[kind] += attempts
        return [
            _gauge("sessions", "Sessions that are kept.", kept),
            _gauges(
                "jobs",
                "Jobs that are kept.",
                ("kind", "state"),
                {(kind, state): number for kind, state, number, _ in rows},
            ),
            _gauges(
                "lost_attempts",
                "How often kept jobs lost their workers.",
                ("kind",),
                {(kind,): number for kind, number in lost.items()},
            ),
        ]

    def _failed(self) -> list[Metric]:
        errors = CounterMetricFamily(
            "ridetune_database_errors", "Transactions that the database failed."
        )
        errors.add_metric((), self._services.store.database.errors)
        return [errors]

    def _working(self) -> list[Metric]:
        pools = {"interactive": self._services.interactive, "readers": self._services.readers}
        return [
            _gauges(
                "work_running",
                "Work of requests that runs.",
                ("pool",),
                {(name,): pool.running for name, pool in pools.items()},
            ),
            _gauges(
                "work_waiting",
                "Work of requests that waits.",
                ("pool",),
                {(name,): pool.under_way - pool.running for name, pool in pools.items()},
            ),
            _gauge(
                "draining", "Whether the service was told to end.", self._services.draining.begun
            ),
            _gauge("under_way", "Requests and websockets.", self._services.draining.under_way),
        ]

    def _workers(self) -> list[Metric]:
        cluster = self._services.cluster
        tasks = CounterMetricFamily(
            "ridetune_tasks",
            "What job workers were given, and what became of it; what is lost is given anew.",
            labels=("became",),
        )
        for became, number in cluster.became.items():
            tasks.add_metric((became,), number)
        simulators = self._services.simulators
        lost = CounterMetricFamily(
            "ridetune_simulators_lost", "Processes that simulate which were lost and replaced."
        )
        lost.add_metric((), simulators.lost)
        return [
            _gauge("workers", "Job workers that are there.", cluster.workers()),
            _gauge("simulators", "Processes that simulate for requests.", simulators.count()),
            tasks,
            lost,
        ]

    def _watched(self) -> list[Metric]:
        count = self._services.viewers.count()
        return [_gauge("viewers", "3D scenes that are kept ready.", count)]


def _gauge(name: str, told: str, value: float) -> Metric:
    return _gauges(name, told, (), {(): value})


def _gauges(
    name: str, told: str, labels: tuple[str, ...], values: dict[tuple[str, ...], float]
) -> Metric:
    family = GaugeMetricFamily(f"ridetune_{name}", told, labels=labels)
    for place, value in values.items():
        family.add_metric(place, value)
    return family
