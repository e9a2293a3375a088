"""What is said of a file that is refused."""

import re

import pytest
from ridetune.engine.errors import MeasurementError
from ridetune.engine.formats.child import Bounds
from ridetune.engine.formats.opening import opened


def read_all(path, bounds):
    with opened(path, path.name, apart=True, bounds=bounds) as table:
        return [(column.name, table.values(k)) for k, column in enumerate(table.columns)]


def refusal(path, bounds=None):
    """The one sentence a file is refused with, wherever that happens."""
    with pytest.raises(MeasurementError) as caught:
        read_all(path, bounds or Bounds())
    said = str(caught.value)
    assert said.startswith(path.name)
    assert said.endswith(".")
    assert "Traceback" not in said
    assert not re.search(r"\w(Error|Exception)\b", said)
    assert "\n" not in said
    return said


def held(tmp_path, name, data):
    path = tmp_path / name
    path.write_bytes(data)
    return path
