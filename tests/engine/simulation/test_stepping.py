"""Steps, samples and what acts during them."""

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.demand import Demand, PiecewiseLinear, PostMotion
from ridetune.engine.errors import SimulationError
from ridetune.engine.kernels.observe import OUTPUTS
from ridetune.engine.remembered import Remembered
from ridetune.engine.roads.road import Road
from ridetune.engine.simulation import stepping
from ridetune.engine.simulation.stepping import SAMPLE_BYTES, STEP_BYTES, prepare_free

JUMP = 0.0123


def demand(duration=0.1, posts=None):
    torque = PiecewiseLinear(
        np.array([0.0, JUMP, JUMP, duration]),
        np.array([[1.0] * 4, [1.0] * 4, [5.0] * 4, [7.0] * 4]),
    )
    return Demand(duration, 0.0, torque, PiecewiseLinear.zero(duration), None, posts)


def test_no_step_straddles_a_jump_or_a_sample():
    inputs = prepare_free(demand(), step=0.002, sample_step=0.005)
    ends = np.concatenate([[0.0], np.cumsum(inputs.steps)])
    assert np.min(np.abs(ends - JUMP)) < 1e-12
    assert inputs.steps.max() <= 0.002
    kept = inputs.samples >= 0
    assert_allclose(ends[kept], inputs.time, atol=1e-12)
    assert_allclose(inputs.samples[kept], np.arange(inputs.time.size))
    assert_allclose(ends[-1], 0.1, atol=1e-12)


def test_a_stage_at_a_jump_sees_the_value_inside_its_own_step():
    """Oracle: the two one-sided limits, 1 before and 5 after."""
    inputs = prepare_free(demand(), step=0.002, sample_step=0.005)
    ends = np.cumsum(inputs.steps)
    before = int(np.argmin(np.abs(ends - JUMP)))
    assert_allclose(inputs.stage_inputs[before, :, 8:12], 1.0, rtol=1e-9)
    assert_allclose(inputs.stage_inputs[before + 1, 0, 8:12], 5.0, rtol=1e-6)


def test_posts_follow_their_spline_with_its_rate():
    """Oracle: a cubic, which a spline through it reproduces with its derivative."""
    time = np.linspace(0.0, 0.1, 21)
    cubic = np.polynomial.Polynomial([0.0, 0.2, -3.0, 11.0])
    posts = PostMotion(time, np.repeat(cubic(time)[:, np.newaxis], 4, axis=1))
    inputs = prepare_free(demand(posts=posts), step=0.002, sample_step=0.005)
    middle = np.cumsum(inputs.steps) - 0.5 * inputs.steps
    assert_allclose(inputs.stage_inputs[:, 1, 0], cubic(middle), atol=1e-14)
    assert_allclose(inputs.stage_inputs[:, 1, 7], cubic.deriv()(middle), atol=1e-12)


def test_a_demand_with_a_long_road_is_let_go_when_another_comes(monkeypatch):
    """Oracle: the garbage collector; two roads of 80 000 numbers do not fit into 100 000."""
    monkeypatch.setattr(stepping, "_PREPARED", Remembered(100_000))

    def on_a_long_road():
        flat = np.zeros(10_001)
        driven = replace(demand(), road=Road(0.0, 0.1, flat, flat))
        prepare_free(driven, step=0.002, sample_step=0.005)
        return weakref.ref(driven)

    first, second = on_a_long_road(), on_a_long_road()
    gc.collect()
    assert first() is None
    assert second() is not None


def test_the_stated_memory_of_a_step_is_at_least_its_arrays():
    """Oracle: the sizes numpy states of what is kept."""
    inputs = prepare_free(demand(duration=10.0), step=0.002, sample_step=0.005)
    kept = sum(array.nbytes for array in (inputs.steps, inputs.samples, inputs.stage_inputs))
    assert kept <= STEP_BYTES * inputs.steps.size
    sampled = (
        inputs.time.nbytes + inputs.sample_inputs.nbytes + 8 * inputs.time.size * (16 + OUTPUTS)
    )
    assert sampled <= SAMPLE_BYTES * inputs.time.size


@pytest.mark.parametrize(
    ("duration", "step", "sample_step", "named"),
    [
        (0.1, 5e-324, 0.005, "step is"),
        (0.1, np.nan, 0.005, "step is"),
        (0.1, 0.5, 0.005, "step is"),
        (0.1, 0.002, 0.0, "sample_step is"),
        (0.001, 0.002, 0.005, "duration is"),
        (np.inf, 0.002, 0.005, "duration is"),
        (1e6, 0.002, 0.005, r"5e\+08 steps with 2e\+08 samples take 900 GB of memory, 1 GB are"),
        (600.0, 0.02, 0.001, r"take 1.98 GB of memory, .* take a longer step, fewer samples or"),
    ],
)
def test_steps_outside_what_is_accepted_are_refused(duration, step, sample_step, named):
    wrong = Demand(duration, 0.0, PiecewiseLinear.zero(1.0), PiecewiseLinear.zero(1.0), None, None)
    with pytest.raises(SimulationError, match=named):
        prepare_free(wrong, step, sample_step)


def test_inputs_of_the_same_demand_are_made_once_for_each_pair_of_steps():
    """Oracle: the inputs of an equal demand, made by itself."""
    asked = demand()
    inputs = prepare_free(asked, step=0.002, sample_step=0.005)
    finer = prepare_free(asked, step=0.001, sample_step=0.005)
    assert prepare_free(asked, step=0.002, sample_step=0.005) is inputs
    assert finer.steps.size > inputs.steps.size
    again = prepare_free(demand(), step=0.002, sample_step=0.005)
    assert again is not inputs
    assert np.array_equal(again.stage_inputs, inputs.stage_inputs)
