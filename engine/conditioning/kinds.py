"""A step of every kind, as it begins when a person adds it."""

from collections.abc import Mapping
from typing import Any, get_args

from ..run import Run
from .chain import Step
from .suggestion import RATE

GPS = {
    "channel": "chassis.v_x",
    "reference": "chassis.body_a_x",
    "order": -1,
    "band_hz": [0.2, 2.0],
}
"""Finds by how much a speed comes late."""

BEGIN: Mapping[str, Mapping[str, Any]] = {
    "resample": {"rate_hz": RATE},
    "speed": {"acceleration": True},
    "angles": {"angle": "pitch"},
    "displacement": {"channels": []},
}
"""What steps of a kind begin with beyond what holds untold."""


def steps_to_add(run: Run) -> list[dict[str, Any]]:
    """One JSON object a kind, in the order in which steps belong; what only a person knows is left
    out.
    """
    late = GPS if {GPS["channel"], GPS["reference"]} <= {*run.columns} else {}
    begin = {**BEGIN, "delay": late}
    return [{"kind": one.kind, **begin.get(one.kind, {})} for one in get_args(Step)]
