"""What the service counts, in Prometheus' terms; one registry an application.

Labels have few values: routes are told by their templates, methods and states by their names. What
can be looked up is looked up when somebody asks (`services_metrics`); all else is counted as it
happens.
"""

import platform
from importlib.metadata import version

from prometheus_client import (
    CollectorRegistry,
    Counter,
    Gauge,
    GCCollector,
    Histogram,
    Info,
    ProcessCollector,
    disable_created_metrics,
)

# When a series began is of no use here and doubles their number.
disable_created_metrics()

SECONDS = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60)


class Metrics:
    """The counters of one application."""

    def __init__(self):
        self.registry = CollectorRegistry()
        ProcessCollector(registry=self.registry)
        GCCollector(registry=self.registry)
        Info("ridetune_build", "The program that runs.", registry=self.registry).info(
            {"version": version("ridetune"), "python": platform.python_version()}
        )
        self._requests = self._histogram(
            "http_request_seconds", "Requests by route and status.", "method", "route", "status"
        )
        self._received = self._counter(
            "http_received_bytes", "Bodies of requests; those of measurements are uploads.", "route"
        )
        self._sent = self._counter("http_sent_bytes", "Bodies of replies.", "route")
        self.websockets = Gauge(
            "ridetune_websockets", "Websockets that are open.", registry=self.registry
        )
        self._closed = self._counter("websockets_closed", "Websockets by close code.", "code")
        self._waited = self._histogram(
            "work_waited_seconds", "Work of requests before it ran, by pool.", "pool"
        )
        self._ran = self._histogram(
            "work_seconds", "Work of requests while it ran, by pool.", "pool"
        )
        self.lag = Histogram(
            "ridetune_event_loop_lag_seconds",
            "By how much the event loop is late.",
            buckets=SECONDS,
            registry=self.registry,
        )

    def requested(
        self, method: str, route: str, status: int, seconds: float, received: int, sent: int
    ) -> None:
        """A request has ended."""
        self._requests.labels(method, route, status).observe(seconds)
        if received:
            self._received.labels(route).inc(received)
        if sent:
            self._sent.labels(route).inc(sent)

    def hung_up(self, code: int) -> None:
        """A websocket has been closed, or was refused."""
        known = 1000 <= code < 1016
        self._closed.labels(code if known else "other").inc()

    def worked(self, pool: str, waited: float, ran: float) -> None:
        """Work of a request has been done, s."""
        self._waited.labels(pool).observe(waited)
        self._ran.labels(pool).observe(ran)

    def _histogram(self, name: str, told: str, *labels: str) -> Histogram:
        return Histogram(f"ridetune_{name}", told, labels, buckets=SECONDS, registry=self.registry)

    def _counter(self, name: str, told: str, *labels: str) -> Counter:
        return Counter(f"ridetune_{name}", told, labels, registry=self.registry)
