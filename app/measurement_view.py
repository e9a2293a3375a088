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
        "same_data_as": first and first.id,
        "remarks": remarks,
        **{name: value for name, value in kept.summary.items() if name != "data_sha256"},
    }


def _first_of_same_data(kept: Measurement, of_session: Sequence[Measurement]) -> Measurement | None:
    """The oldest other recording with the same bytes or, however they are written, samples."""
    data = kept.summary.get("data_sha256")
    for one in of_session:
        if one.id == kept.id:
            break
        if one.sha256 == kept.sha256 or (data and one.summary.get("data_sha256") == data):
            return one
    return None
