"""A quarter of a second of spoilt files of every kind; `fuzz.py` runs for as long as it is told."""

from pathlib import Path

import pytest

from .fuzz import kinds, outcomes


@pytest.mark.parametrize("kind", kinds())
def test_spoilt_files_give_a_table_or_one_sentence(kind, tmp_path):
    """Oracle: the checks in `read`, which raise; the first files are sure to come."""
    assert list(outcomes(kind, 0.25, seed=7, keep=Path(tmp_path)))
