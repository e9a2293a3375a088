"""Measurements as the REST interface shows them, beside others of their session."""

from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

from .store import Measurement, Store


def measurements_to_json(store: Store, sid: str) -> list[dict[str, Any]]:
    """All of a session, oldest first."""
    kept = store.measurements(sid)
    return [_shown(one, kept) for one in kept]


def measurement_to_json(store: Store, sid: str, kept: Measurement) -> dict[str, Any]:
    """One of a session."""
    return _shown(kept, store.measurements(sid))


def _shown(kept: Measurement, of_session: Sequence[Measurement]) -> dict[str, Any]:
    first = _first_of_same_data(kept, of_session)
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
        "created": datetime.fromtimestamp(kept.created, UTC).isoformat(),
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


def _first_of_same_data(kept: Measurement, of_session: Sequence[Measurement]) -> Measurement | None:
    """The oldest recording with the same data, unless it is this one, or this one has been deleted
    meanwhile."""
    keys = data_keys(of_session)
    if kept.id not in keys:
        return None
    first = next(one for one in of_session if keys[one.id] == keys[kept.id])
    return None if first.id == kept.id else first
