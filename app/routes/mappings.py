"""Which columns of an uploaded file are which channels: what is guessed, what holds, what is kept
by name for the next file.
"""

import json
from dataclasses import replace
from typing import Annotated, Any

from fastapi import APIRouter, Body, Query, Response

from ..access.sessions import SessionId
from ..errors import NotFound
from ..recordings.measurement_view import measurement_to_json
from ..schemas import JsonObject, NamedMapping
from ..storage.measurement import Measurement
from ..web.services import Services, Shared
from .columns import candidate_to_json, columns_to_json, preview
from .downloads import saved_as
from .strict_json import StrictRoute

MOST_SHOWN = 20
"""Columns in one preview."""

router = APIRouter(prefix="/api/sessions/{sid}", tags=["mappings"], route_class=StrictRoute)

MappingBody = Annotated[JsonObject, Body(description="Columns as channels, see docs/files.")]


@router.get("/measurements/{mid}/columns")
async def columns(sid: SessionId, mid: str, services: Shared) -> dict[str, Any]:
    """The file's columns, what each may be and why, and a mapping to begin with."""
    return await services.readers.run(sid, lambda: _columns(services, sid, mid))


def _columns(services: Services, sid: str, mid: str) -> dict[str, Any]:
    from ...engine.mapping.mapping import mapping_from_json

    kept = services.store.measurements.get(sid, mid)
    templates = {
        name: mapping_from_json(one, name)
        for name, one in services.store.mappings.of_session(sid).items()
    }
    found = services.recordings.survey(kept).with_templates(templates)
    return columns_to_json(found, kept.mapping)


@router.get("/measurements/{mid}/columns/candidate")
async def candidate(
    sid: SessionId, mid: str, services: Shared, index: int, channel: str
) -> dict[str, Any]:
    """A column as a channel that a person chooses for it: its unit and sign, and why."""
    kept = services.store.measurements.get(sid, mid)
    return await services.readers.run(
        sid, lambda: candidate_to_json(services.recordings.survey(kept), index, channel)
    )


@router.get("/measurements/{mid}/columns/preview")
async def columns_preview(
    sid: SessionId,
    mid: str,
    services: Shared,
    index: Annotated[list[int], Query(max_length=MOST_SHOWN)],
    points: Annotated[int, Query(ge=2, le=5000)] = 500,
) -> list[dict[str, Any]]:
    """Least and greatest value of some columns in stretches of equally many samples."""
    kept = services.store.measurements.get(sid, mid)

    def shown() -> list[dict[str, Any]]:
        with services.recordings.table(kept) as table:
            return preview(table, index, points)

    return await services.readers.run(sid, shown)


@router.get("/measurements/{mid}/mapping", response_class=Response)
def mapping(sid: SessionId, mid: str, services: Shared) -> Response:
    """The mapping that holds, as a file for other recordings and for the command line."""
    kept = services.store.measurements.get(sid, mid)
    if kept.mapping is None:
        raise NotFound(f"{kept.name} has no mapping; its columns go by their own names.")
    text = json.dumps(kept.mapping, indent=2, ensure_ascii=False) + "\n"
    return Response(
        text, media_type="application/json", headers=saved_as(kept.name, "mapping.json")
    )


@router.put("/measurements/{mid}/mapping")
async def set_mapping(
    sid: SessionId, mid: str, services: Shared, body: MappingBody
) -> dict[str, Any]:
    """Take a file's columns for channels; refused while a job reads it."""
    mapped = await services.readers.run(sid, lambda: _map(services, sid, mid, body))
    return measurement_to_json(services.store, sid, mapped)


def _map(services: Services, sid: str, mid: str, body: JsonObject) -> Measurement:
    from ...engine.mapping.mapping import mapping_from_json, mapping_to_json

    services.store.measurements.require_unused(sid, mid)
    kept = services.store.measurements.get(sid, mid)
    mapping = mapping_to_json(mapping_from_json(body, "mapping"))
    mapped = replace(kept, mapping=mapping)
    noise = dict(services.recordings.parse(mapped, kept.noise).noise)
    found = services.recordings.summed_up(replace(mapped, noise=noise))
    return services.store.measurements.set_mapping(sid, kept.id, mapping, noise, found)


@router.delete("/measurements/{mid}/mapping")
async def forget_mapping(sid: SessionId, mid: str, services: Shared) -> dict[str, Any]:
    """Go by the names of the file's columns again."""

    def by_names() -> Measurement:
        services.store.measurements.require_unused(sid, mid)
        kept = services.store.measurements.get(sid, mid)
        found, noise = services.recordings.by_names(kept)
        if not found["needs_mapping"]:
            bare = replace(kept, mapping=None, noise=noise, summary=found)
            found = services.recordings.summed_up(bare)
        return services.store.measurements.set_mapping(sid, kept.id, None, noise, found)

    named = await services.readers.run(sid, by_names)
    return measurement_to_json(services.store, sid, named)


@router.get("/mappings")
def mappings(sid: SessionId, services: Shared) -> list[dict[str, Any]]:
    """The mappings that are kept by name, the newest first."""
    kept = services.store.mappings.of_session(sid)
    return [{"name": name, "mapping": one} for name, one in kept.items()]


@router.post("/mappings", status_code=201)
def keep_mapping(sid: SessionId, services: Shared, body: NamedMapping) -> dict[str, Any]:
    """Keep a mapping under a name, in place of one that has it."""
    from ...engine.mapping.mapping import mapping_from_json, mapping_to_json

    mapping = mapping_to_json(mapping_from_json(body.mapping, "mapping"))
    services.store.mappings.keep(sid, body.name, mapping)
    return {"name": body.name, "mapping": mapping}


@router.delete("/mappings/{name}", status_code=204)
def delete_mapping(sid: SessionId, name: str, services: Shared) -> None:
    """Remove a mapping; measurements that have it keep it."""
    services.store.mappings.delete(sid, name)
