"""Advice as JSON: SI, null for what is infinite (an error that nothing bounds)."""

from collections.abc import Sequence
from typing import Any

from ..manoeuvre import manoeuvre_to_json
from ..parameters import parameter
from .advisor import Advice, Advisory, Knowledge
from .fit_file import plain


def advisory_to_json(advisory: Advisory) -> dict[str, Any]:
    """All of it, the best first; a candidate's "manoeuvre" is what any command drives."""
    return plain(
        {
            "now": {"parameters": _parameters(advisory.now), "worst": advisory.worst},
            "candidates": [_candidate(one) for one in advisory.ranked],
            "together": [_candidate(one) for one in advisory.together],
            "excluded": [{"key": key, "why": why} for key, why in advisory.excluded.items()],
            "warnings": list(advisory.warnings),
            "seconds": advisory.seconds,
        }
    )


def _candidate(one: Advice) -> dict[str, Any]:
    return {
        "key": one.key,
        "name": one.manoeuvre.name,
        "duration": one.manoeuvre.duration,
        "manoeuvre": manoeuvre_to_json(one.manoeuvre),
        "sentence": one.sentence,
        "remark": one.remark,
        "promoted": one.promoted,
        "gain": one.gain,
        "worst": one.worst,
        "parameters": _parameters(one.after),
    }


def _parameters(known: Sequence[Knowledge]) -> list[dict[str, Any]]:
    return [
        {
            "name": one.name,
            "symbol": parameter(one.name).symbol,
            "value": one.value,
            "unit": parameter(one.name).unit,
            "std_error": one.std_error,
            "confidence_interval": list(one.confidence_interval),
            "determined": one.determined,
        }
        for one in known
    ]
