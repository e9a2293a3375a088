"""The web application: routes, services and the order in which they start and stop."""

import asyncio
import contextlib
import logging
import os
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from functools import partial
from importlib.metadata import version

from fastapi import FastAPI
from fastapi.staticfiles import StaticFiles

from .access.guard import Guard
from .jobs.cluster import Cluster
from .jobs.jobs import Jobs
from .limits import Limits
from .package_files import package_folder
from .recordings.recordings import Recordings
from .routes.parts import EVERY_PART
from .settings import Settings
from .simulators.simulators import Simulators
from .storage.store import Store
from .viewer.relay import Viewers
from .viewer.relay import router as viewer
from .web.callers import Callers
from .web.draining import Drain, Draining
from .web.heads import Heads
from .web.heartbeat import beat
from .web.interface import describe, operation_id
from .web.metrics import Metrics
from .web.observed import Observed
from .web.pool import Pool
from .web.problems import Unexpected, reply_to_errors
from .web.readiness import Readiness
from .web.services import Services
from .web.services_metrics import ServicesCollector
from .web.shares import Shares
from .work.campaign import KIND as CAMPAIGN
from .work.campaign import campaign
from .work.identification import KIND as IDENTIFICATION
from .work.identification import identify_runs, of_recordings
from .work.profile import KIND as PROFILE
from .work.profile import profile_parameter
from .work.sweep import KIND as SWEEP
from .work.sweep import sweep
from .work.validation import KIND as VALIDATION
from .work.validation import validation
from .work.warmup import WarmUp, ready_to_simulate

log = logging.getLogger(__name__)

CORES = os.cpu_count() or 1

REAPS = 10
"""How often, while a viewer without a tab is kept, those that are due are looked for."""


def create_app(
    settings: Settings,
    *,
    store: Store | None = None,
    simulators: Simulators | None = None,
    warm_up: Callable[[WarmUp, Simulators], object] = ready_to_simulate,
) -> FastAPI:
    """The service; its data directory is locked from here or from start-up until it stops.

    simulators : those that several services of one process have in common, which outlast it
    """

    draining, metrics = Draining(), Metrics()

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        ours = simulators or Simulators(CORES)
        services = _services(settings, store, ours, warm_up, draining, metrics)
        app.state.services = services
        services.warmup.start()
        services.jobs.start(asyncio.get_running_loop())
        collector = ServicesCollector(services)
        metrics.registry.register(collector)
        own = [
            asyncio.create_task(_reap(services)),
            asyncio.create_task(beat(metrics.lag.observe)),
        ]
        try:
            yield
        finally:
            for task in own:
                task.cancel()
            await asyncio.gather(*own, return_exceptions=True)
            metrics.registry.unregister(collector)
            await asyncio.to_thread(_close, services, lent=simulators is not None)

    app = FastAPI(
        title="ridetune",
        version=version("ridetune"),
        summary="Tune the ride of a car from measurements.",
        openapi_url="/api/openapi.json",
        docs_url=None,
        redoc_url=None,
        # Else a DELETE below something whose name is empty would be sent on to that itself.
        redirect_slashes=False,
        generate_unique_id_function=operation_id,
        lifespan=lifespan,
    )
    for part in EVERY_PART:
        app.include_router(part)
    app.include_router(viewer)
    app.mount("/static", StaticFiles(directory=package_folder("static")))
    app.openapi = describe(app)
    reply_to_errors(app)
    # The last one is the outermost.
    app.add_middleware(Heads)
    app.add_middleware(Unexpected)
    app.add_middleware(Drain, draining=draining)
    app.add_middleware(Guard, settings=settings)
    app.add_middleware(Observed, metrics=metrics)
    app.state.draining = draining
    return app


def _services(
    settings: Settings,
    store: Store | None,
    simulators: Simulators,
    warm_up: Callable[[WarmUp, Simulators], object],
    draining: Draining,
    metrics: Metrics,
) -> Services:
    store = store or Store(settings.data, settings.limits, settings.database)
    cluster = Cluster(settings.cluster, store.directory.scratch, certificates=settings.certificates)
    recordings = Recordings(store)
    warmup = WarmUp(lambda warmup: warm_up(warmup, simulators))
    return Services(
        settings=settings,
        store=store,
        recordings=recordings,
        interactive=interactive(settings.limits, partial(metrics.worked, "interactive")),
        simulators=simulators,
        readers=readers(settings.limits, partial(metrics.worked, "readers")),
        cluster=cluster,
        jobs=Jobs(
            store,
            cluster,
            {
                CAMPAIGN: campaign(),
                IDENTIFICATION: of_recordings(identify_runs, store, recordings),
                PROFILE: of_recordings(profile_parameter, store, recordings),
                SWEEP: sweep(store, recordings),
                VALIDATION: validation(store, recordings),
            },
            ready=warmup.wait,
            taking=lambda: not draining.begun,
        ),
        warmup=warmup,
        draining=draining,
        readiness=Readiness(
            draining,
            warmup,
            store.database,
            store.directory.path,
            settings.cluster,
            lambda: cluster.refused,
        ),
        metrics=metrics,
        callers=Callers(settings.limits),
        event_streams=Shares(
            settings.limits.session_events,
            "The session's jobs are followed {} times already; close one of its pages, or ask for "
            "the job itself now and then.",
        ),
        simulation_streams=Shares(
            settings.limits.session_streams,
            "The session has {} streams of simulations open; close one of its pages.",
        ),
        viewers=Viewers(settings.limits),
    )


def interactive(limits: Limits, worked: Callable[[float, float], None]) -> Pool:
    """As wide as there are simulators."""
    share = limits.session_simulations
    return Pool(
        "simulations",
        CORES,
        share=share,
        most=limits.waiting_simulations,
        at_once=share,
        worked=worked,
    )


def readers(limits: Limits, worked: Callable[[float, float], None]) -> Pool:
    """One file of a session at a time, so that one that sends many keeps nobody else waiting."""
    return Pool(
        "files to read",
        limits.readers,
        share=limits.session_readings,
        most=limits.waiting_readings,
        at_once=1,
        retry_after=5,
        worked=worked,
    )


def _close(services: Services, *, lent: bool) -> None:
    """End the parts, those first that others serve; one that fails leaves none of them open.

    lent : whether the simulators are another's
    """
    with contextlib.ExitStack() as last_first:
        last_first.callback(services.store.close)
        last_first.callback(services.viewers.close)
        # Jobs are handed back once no request adds one any more.
        last_first.callback(services.jobs.close)
        last_first.callback(services.readers.close)
        if not lent:
            last_first.callback(services.simulators.close)
        last_first.callback(services.interactive.close)
        last_first.callback(services.warmup.close)


async def _reap(services: Services) -> None:
    while True:
        await asyncio.sleep(services.settings.limits.unwatched_seconds / REAPS)
        with contextlib.suppress(Exception):
            await asyncio.to_thread(services.viewers.reap)
