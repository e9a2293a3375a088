"""The parts of the REST interface, in the order in which a request's route is looked for."""

from . import (
    advice,
    campaigns,
    catalogue,
    conditioning,
    health,
    identifications,
    mappings,
    measurements,
    metrics,
    page,
    profiles,
    sessions,
    simulation_stream,
    simulations,
    sweeps,
    validations,
)

EVERY_PART = (
    # First what is asked for most.
    health.router,
    simulations.router,
    simulation_stream.router,
    sessions.router,
    catalogue.router,
    measurements.router,
    conditioning.router,
    mappings.router,
    identifications.router,
    sweeps.router,
    profiles.router,
    validations.router,
    advice.router,
    campaigns.router,
    page.router,
    metrics.router,
)
