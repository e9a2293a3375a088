"""Steps to add by hand. Oracles: the documented table and example, and the suggested order."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from ridetune.engine.conditioning.kinds import steps_to_add
from ridetune.engine.conditioning.suggestion import suggest
from ridetune.engine.run import Run

from ...factories import paper_vehicle
from ...raw_sensors import drive, recorded

DOCUMENTED = (Path(__file__).parents[3] / "docs" / "conditioning.md").read_text("utf-8")
CAR = paper_vehicle()


@pytest.fixture(scope="module")
def raw():
    return recorded(CAR, drive(CAR), seed=1, delay=0.3)


def test_each_documented_kind_is_there_once_in_the_table_s_order(raw):
    kinds = [step["kind"] for step in steps_to_add(raw)]
    assert kinds == re.findall(r"^\| `([\w-]+)` \|", DOCUMENTED, re.MULTILINE)


def test_the_order_is_that_of_what_is_suggested(raw):
    """With a late speed and 500 samples a second every kind but those of mends and gains."""
    kinds = [step["kind"] for step in steps_to_add(raw)]
    suggested = [step.kind for step in suggest(raw, CAR).steps]
    assert {"resample", "delay", "rest", "speed", "rim-from-travel"} < {*suggested}
    assert suggested == sorted(suggested, key=kinds.index)


def test_a_delay_begins_as_the_documented_one_of_a_speed_where_there_is_one(raw):
    [example] = re.findall(r'`(\{"kind": "delay", .*?\})`', DOCUMENTED, re.DOTALL)
    delay = next(step for step in steps_to_add(raw) if step["kind"] == "delay")
    assert delay == json.loads(example)
    other = Run("r", [0.0, 1.0], {"chassis.z": np.zeros(2)})
    assert {"kind": "delay"} in steps_to_add(other)
