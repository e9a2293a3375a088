"""What is told of a recording: its channels, what is missing or doubtful, what its data are."""

import hashlib
from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from ...engine.channels import channel
from ...engine.errors import MeasurementError
from ...engine.run import Run

if TYPE_CHECKING:
    from ...engine.formats.table import Table


def summary(
    run: Run, mapping: Mapping[str, Any] | None = None, raw: Run | None = None
) -> dict[str, Any]:
    """What a person wants to know of a recording before using it.

    mapping : that of its columns, in which signs may be confirmed; None for our own names
    raw : the recording before anything was done to it, where that is another
    """
    from ...engine.mapping.mapping import mapping_from_json
    from ...engine.mapping.signs import check_signs
    from ...engine.measurement import missing_for_identification

    missing = list(missing_for_identification(run))
    sure = () if mapping is None else mapping_from_json(mapping).sure_signs
    return {
        "needs_mapping": False,
        "samples": len(run.time),
        "duration": run.duration,
        "sample_step": run.sample_step,
        "channels": [_channel(name, run) for name in run.columns],
        "warnings": list(run.warnings),
        "usable_for_identification": not missing,
        "missing": missing,
        "sign_suggestions": [asdict(one) for one in check_signs(run, sure)],
        "data_sha256": _digest(raw or run),
        "vehicle": run.vehicle or None,
        "plant": run.plant or None,
    }


def unmapped_summary(table: "Table", reason: MeasurementError) -> dict[str, Any]:
    """`summary` of a file that needs a mapping: what is missing is missing in the guess, too."""
    from ...engine.mapping.survey import survey
    from ...engine.measurement import missing_for_identification
    from ...engine.plausibility import require_samples

    found = survey(table)
    samples = max((one.samples for one in found.columns), default=0)
    require_samples(samples, found.source)
    nothing = np.arange(2.0)
    guessed = {one.channel: nothing for one in found.guess.mapping.columns if one.channel != "time"}
    return {
        "needs_mapping": True,
        "samples": samples,
        "duration": 0.0,
        "sample_step": 0.0,
        "channels": [],
        "warnings": [str(reason), *found.warnings],
        "usable_for_identification": False,
        "missing": list(missing_for_identification(Run(found.source, nothing, guessed))),
        "sign_suggestions": [],
        "vehicle": None,
        "plant": None,
    }


def _digest(run: Run) -> str:
    """What stands for a run's samples, however its file writes them."""
    made = hashlib.sha256()
    for name in ("time", *sorted(run.columns)):
        made.update(name.encode())
        made.update(np.ascontiguousarray(run[name], dtype=float).tobytes())
    return made.hexdigest()


def _channel(name: str, run: Run) -> Mapping[str, Any]:
    values = run[name]
    return {
        "name": name,
        "unit": channel(name).unit,
        "minimum": float(values.min()),
        "maximum": float(values.max()),
        "rms": float(np.sqrt(np.mean(values**2))),
    }
