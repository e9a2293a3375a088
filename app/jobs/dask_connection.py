"""A connection to Dask: a client of a scheduler elsewhere, or of workers of this machine's own."""

import asyncio
import logging
import threading
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

from .. import logs
from ..settings import Certificates

log = logging.getLogger(__name__)

CONNECT = 2.0
"""Time that a scheduler elsewhere has to be connected to, s; as long after it was lost, Dask's
client closes itself.
"""

ANSWER = 5.0
"""Time that a scheduler, or what it asks its workers, has for an answer, s."""

CONFIGURATION = {
    # The default of 15 s drops a nanny for good whose worker is lost twice in that time.
    "distributed.deploy.lost-worker-timeout": "365d",
    "distributed.scheduler.allowed-failures": 2,
    # Its web servers start in any case: without pages to show, and not on a port others may want.
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
    # What it draws on those pages: samples of every stack, and whether the event loops are late,
    # fifty times a second in each process.
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "500ms",
}


class DaskConnection:
    """One client, from its start to its end; raises what Dask does where it cannot start."""

    client: Any = None
    _local: Any = None

    def __init__(
        self, address: str, certificates: Certificates | None, workers: int, scratch: Path
    ):
        """address : of a scheduler elsewhere; empty for `workers` processes of this machine"""
        from dask import config
        from distributed import Client

        config.set(CONFIGURATION)
        logging.getLogger("distributed").setLevel(logging.ERROR)
        logging.getLogger("distributed.client").addFilter(_unless_given_up)
        logs.adopt("distributed")
        self._loop = _LoopThread()
        own: dict[str, Any] = {"loop": self._loop.loop, "set_as_default": False, "name": "ridetune"}
        try:
            if address:
                security = _security(certificates)
                self.client = Client(address, security=security, timeout=CONNECT, **own)
            else:
                self._local = _workers_here(workers, scratch, self._loop.loop)
                self.client = Client(self._local, **own)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """End the client, the futures that it still had, and workers of our own."""
        if self.client is not None:
            _told(lambda: self.client.close(timeout=ANSWER))
        if self._local is not None:
            _told(self._local.close)
        self._loop.close()


class _LoopThread:
    """Dask's event loop, in a thread of its own that ends with the connection: Dask would leave one
    behind for each client that cannot connect, or that closes itself.
    """

    def __init__(self):
        started: Future[Any] = Future()
        self._thread = threading.Thread(
            target=lambda: asyncio.run(self._run(started)), name="dask-loop", daemon=True
        )
        self._thread.start()
        self.loop = started.result()

    async def _run(self, started: Future[Any]) -> None:
        from tornado.ioloop import IOLoop

        self._ended = asyncio.Event()
        started.set_result(IOLoop.current())
        await self._ended.wait()

    def close(self) -> None:
        self.loop.add_callback(self._ended.set)
        self._thread.join(ANSWER)


def _unless_given_up(record: logging.LogRecord) -> bool:
    """A client that is closed while it looks for its scheduler tells that as an error, with a
    traceback; that the scheduler was lost is told by whoever closes it.
    """
    return not (record.exc_info and record.exc_info[0] is asyncio.CancelledError)


def _told(close: Callable[[], None]) -> None:
    """What goes wrong at an end stops neither the rest of it nor the caller, who goes on anew."""
    try:
        close()
    except Exception as error:
        log.warning("the job workers are left without a farewell: %r", error)


def _workers_here(workers: int, scratch: Path, loop: Any) -> Any:
    from distributed import LocalCluster

    no_dashboard: Any = None
    return LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        processes=True,
        security=True,
        loop=loop,
        dashboard_address=no_dashboard,
        scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
        local_directory=str(scratch),
        silence_logs=logging.ERROR,
    )


def _security(certificates: Certificates | None) -> Any:
    """What Dask calls the files, and that it must do nothing without them."""
    from distributed import Security

    if certificates is None:
        return None
    return Security(
        tls_ca_file=str(certificates.ca),
        tls_client_cert=str(certificates.certificate),
        tls_client_key=str(certificates.key),
        require_encryption=True,
    )
