"""Measurements as the REST interface shows them, beside others of their session."""

from collections.abc import Sequence
from typing import Any

from ..instants import instant
from ..storage.measurement import Measurement
from ..storage.store import Store


def measurements_to_json(
    store: Store, sid: str, kept: Sequence[Measurement] | None = None
) -> list[dict[str, Any]]:
    """Those of a session that are told, or all, oldest first."""
    of_session = store.measurements.of_session(sid)
    keys = data_keys(of_session)
    oldest: dict[str, Measurement] = {}
    for one in of_session:
        oldest.setdefault(keys[one.id], one)
    # One that was deleted meanwhile has no key.
    return [
        _shown(one, oldest[keys[one.id]] if one.id in keys else one)
        for one in (of_session if kept is None else kept)
    ]


def measurement_to_json(store: Store, sid: str, kept: Measurement) -> dict[str, Any]:
    """One of a session."""
    [shown] = measurements_to_json(store, sid, [kept])
    return shown


def _shown(kept: Measurement, oldest: Measurement) -> dict[str, Any]:
    """A measurement beside the oldest with the same data, which may be itself."""
    first = None if oldest.id == kept.id else oldest
    remarks = []
    if first is not None:
        remarks.append(
            f"It holds the same data as {first.name}; a fit to both would count that drive twice."
        )
    return {
        "id": kept.id,
        "name": kept.name,
        "bytes": kept.bytes,
        "sha256": kept.sha256,
        "created": instant(kept.created),
        "sample": kept.sample,
        "noise": kept.noise,
        "manoeuvre": kept.manoeuvre,
        "conditioning": kept.conditioning and kept.conditioning["steps"],
        "conditioned": kept.conditioned,
        "mapping": kept.mapping,
        "needs_mapping": False,
        "sign_suggestions": [],
        "vehicle": None,
        "plant": None,
        "same_data_as": first and first.id,
        "remarks": remarks,
        **{name: value for name, value in kept.summary.items() if name != "data_sha256"},
    }


def data_keys(of_session: Sequence[Measurement]) -> dict[str, str]:
    """What stands for the data of each recording, by id: the same for those that hold the same.

    That is its samples, under its mapping and however its file writes them. Where they are not
    known, since the columns have no mapping yet or an earlier service took the file, those of the
    oldest recording with the same bytes, else the bytes.
    """
    by_bytes: dict[str, str] = {}
    for one in of_session:
        if samples := one.summary.get("data_sha256"):
            by_bytes.setdefault(one.sha256, samples)
    return {
        one.id: one.summary.get("data_sha256") or by_bytes.get(one.sha256, one.sha256)
        for one in of_session
    }
