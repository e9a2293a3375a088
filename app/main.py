"""The web application: routes, services and the order in which they start and stop."""

import asyncio
import contextlib
import logging
import os
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from importlib.metadata import version
from importlib.util import find_spec

from fastapi import FastAPI
from fastapi.staticfiles import StaticFiles

from . import (
    routes_advice,
    routes_campaigns,
    routes_catalogue,
    routes_conditioning,
    routes_identifications,
    routes_mappings,
    routes_measurements,
    routes_page,
    routes_profiles,
    routes_sessions,
    routes_simulations,
    routes_sweeps,
    routes_validations,
)
from .campaign_job import KIND as CAMPAIGN
from .campaign_job import campaign
from .cluster import Cluster
from .guard import Guard
from .identification_job import KIND as IDENTIFICATION
from .identification_job import identify_runs, of_recordings
from .interface import describe, operation_id
from .jobs import Jobs
from .package_files import package_folder
from .pool import Pool
from .problems import reply_to_errors
from .profile_job import KIND as PROFILE
from .profile_job import profile_parameter
from .recordings import Recordings
from .services import Services, Viewers
from .settings import Limits, Settings
from .store import Store
from .sweep_job import KIND as SWEEP
from .sweep_job import sweep
from .validation_job import KIND as VALIDATION
from .validation_job import validation
from .warmup import WarmUp, ready_to_simulate

log = logging.getLogger(__name__)

REAPS = 10
"""How often, while a viewer without a tab is kept, those that are due are looked for."""


def create_app(
    settings: Settings,
    *,
    store: Store | None = None,
    warm_up: Callable[[WarmUp], object] = ready_to_simulate,
) -> FastAPI:
    """The service; its data directory is locked from here or from start-up until it stops."""

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        services = _services(settings, store, warm_up)
        app.state.services = services
        services.warmup.start()
        services.jobs.start(asyncio.get_running_loop())
        reaper = asyncio.create_task(_reap(services))
        try:
            yield
        finally:
            reaper.cancel()
            await asyncio.gather(reaper, return_exceptions=True)
            await asyncio.to_thread(_close, services)

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
    for part in (
        routes_catalogue,
        routes_sessions,
        routes_simulations,
        routes_measurements,
        routes_conditioning,
        routes_mappings,
        routes_identifications,
        routes_sweeps,
        routes_profiles,
        routes_validations,
        routes_advice,
        routes_campaigns,
        routes_page,
    ):
        app.include_router(part.router)
    if find_spec(".viewer", __package__):
        from .viewer import router

        app.include_router(router)
    app.mount("/static", StaticFiles(directory=package_folder("static")))
    app.openapi = describe(app)
    reply_to_errors(app)
    app.add_middleware(Guard, settings=settings)
    return app


def _services(
    settings: Settings, store: Store | None, warm_up: Callable[[WarmUp], object]
) -> Services:
    store = store or Store(settings.data, settings.limits, settings.database)
    recordings = Recordings(store)
    warmup = WarmUp(warm_up)
    return Services(
        settings=settings,
        store=store,
        recordings=recordings,
        interactive=interactive(settings.limits),
        readers=readers(settings.limits),
        jobs=Jobs(
            store,
            Cluster(settings.cluster, store.directory.scratch),
            {
                CAMPAIGN: campaign(),
                IDENTIFICATION: of_recordings(identify_runs, store, recordings),
                PROFILE: of_recordings(profile_parameter, store, recordings),
                SWEEP: sweep(store, recordings),
                VALIDATION: validation(store, recordings),
            },
            ready=warmup.wait,
        ),
        warmup=warmup,
        viewers=_viewers(settings.limits),
    )


def interactive(limits: Limits) -> Pool:
    """As wide as the cores: a wider one would not compute faster, it would only take the event
    loop's share of Python's lock.
    """
    share = limits.session_simulations
    return Pool(
        "simulations",
        os.cpu_count() or 1,
        share=share,
        most=limits.waiting_simulations,
        at_once=share,
    )


def readers(limits: Limits) -> Pool:
    """One file of a session at a time, so that one that sends many keeps nobody else waiting."""
    return Pool(
        "files to read",
        limits.readers,
        share=limits.session_readings,
        most=limits.waiting_readings,
        at_once=1,
        retry_after=5,
    )


def _viewers(limits: Limits) -> Viewers | None:
    if not find_spec(".viewer", __package__):
        return None
    from .viewer import Viewers as Scenes

    return Scenes(limits.unwatched_seconds)


def _close(services: Services) -> None:
    services.warmup.close()
    services.interactive.close()
    services.readers.close()
    services.jobs.close()
    if services.viewers is not None:
        services.viewers.close()
    services.store.close()


async def _reap(services: Services) -> None:
    while services.viewers is not None:
        await asyncio.sleep(services.settings.limits.unwatched_seconds / REAPS)
        with contextlib.suppress(Exception):
            await asyncio.to_thread(services.viewers.reap)
