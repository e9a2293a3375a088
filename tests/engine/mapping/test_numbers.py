"""What numbers say by themselves, whatever they are."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from ridetune.engine.errors import MeasurementError
from ridetune.engine.mapping.apply import apply
from ridetune.engine.mapping.mapping import ChannelMapping, MappedColumn
from ridetune.engine.mapping.numbers import statistics
from ridetune.engine.mapping.survey import survey

from .mapped_tables import held

ANY = st.floats(width=64, allow_nan=True, allow_infinity=True) | st.sampled_from(
    [0.0, 1.0, -64.0, 65535.0, 1e30, math.nan]
)


@settings(max_examples=100, deadline=None)
@given(arrays(np.float64, st.integers(0, 40), elements=ANY))
def test_statistics_hold_of_any_numbers(values):
    """Oracle: what is neither missing nor a stand-in lies between the ends."""
    found = statistics(values)
    replaced = [one.value for one in found.stand_ins]
    rest = values[np.isfinite(values) & ~np.isin(values, replaced)]
    assert found.missing == np.count_nonzero(~np.isfinite(values))
    assert sum(one.samples for one in found.stand_ins) + rest.size + found.missing == values.size
    if rest.size:
        assert (found.minimum, found.maximum) == (rest.min(), rest.max())
    else:
        assert found.constant


@settings(max_examples=100, deadline=None)
@given(
    arrays(np.float64, 24, elements=ANY),
    arrays(np.float64, 24, elements=ANY),
    st.booleans(),
    st.sampled_from([None, (), (-64.0,)]),
)
def test_any_table_becomes_a_finite_run_or_one_sentence(time, values, sorted_, missing):
    time = np.sort(time) if sorted_ else time
    table = held({"Time": ("s", time), "height": ("mm", values)})
    entry = MappedColumn("height", "chassis.z", "mm", missing=missing)
    mapping = ChannelMapping((MappedColumn("Time", "time", "s"), entry), longest_gap=10.0)
    try:
        survey(table)
        run = apply(mapping, table)
    except MeasurementError as error:
        said = str(error)
    else:
        said = "lap: "
        assert np.isfinite(run["chassis.z"]).all()
        assert np.all(np.diff(run.time) > 0.0)
    assert said.startswith("lap: ")


def test_clipped_ends_are_seen_and_flat_rests_are_not():
    time = np.arange(0.0, 60.0, 0.01)
    wave = 20.0 * np.sin(time)
    assert statistics(np.clip(wave, -15.0, 15.0)).clipped == (-15.0, 15.0)
    assert statistics(wave).clipped == ()
    assert statistics(np.maximum(wave, 0.0)).clipped == ()
    assert statistics(np.round(wave)).clipped == ()


def test_size_and_step_are_those_of_the_wave():
    """Oracle: 99.5 % of |sin| over whole periods lie below sin(0.995 pi / 2)."""
    time = np.linspace(0.0, 20.0 * np.pi, 20_001)
    found = statistics(3.0 + 2.0 * np.sin(time))
    assert found.swing == pytest.approx(2.0 * np.sin(0.995 * np.pi / 2.0), rel=1e-3)
    assert statistics(time).step == pytest.approx(np.pi / 1000.0)
