"""A quarter of a second of files of every kind; `fuzz.py` runs for as long as it is told."""

import pytest

from .fuzz import HOSTILE, outcomes, texts


@pytest.mark.parametrize("kind", HOSTILE)
def test_files_give_a_table_or_one_sentence(kind, tmp_path):
    """Oracle: the checks in `read`; the first files are sure to come."""
    tally = outcomes(kind, 0.25, seed=7, keep=tmp_path)
    assert sum(tally.outcomes.values()) >= 10
    assert not tally.findings


@pytest.mark.parametrize("kind", texts.KINDS)
def test_texts_are_read_or_refused_with_one_sentence(kind, tmp_path):
    """Oracle: the checks in `findings`, and that what is read reads back equal."""
    tally = texts.outcomes(kind, 0.25, seed=7, keep=tmp_path)
    assert sum(tally.outcomes.values()) >= 10
    assert not tally.findings
