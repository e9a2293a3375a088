import numpy as np
import pytest
from ridetune.engine.channels import OUTPUT_CHANNELS, WHEEL_CHANNELS, channel
from ridetune.engine.manoeuvre import reference_manoeuvres
from ridetune.engine.simulation.simulate import simulate_posts, simulate_road
from ridetune.engine.spikes import despiked, spikes

from ..factories import paper_vehicle

CAR = paper_vehicle()
TIME = np.arange(0.0, 20.0, 0.005)
ROUGH = 0.01 * np.sin(8.0 * TIME) + 0.003 * np.sin(75.0 * TIME)


@pytest.mark.parametrize("length", [1, 2, 3])
def test_spikes_are_named_with_their_number_and_place(length):
    values = ROUGH.copy()
    values[2500 : 2500 + length] += 0.1
    [sentence] = spikes(channel("wheel.fl.z"), TIME, values)
    furthest = 1e3 * values[2500 : 2500 + length].max()
    assert f"wheel.fl.z jumps to {furthest:.4g} mm" in sentence
    assert f"in {length} of 4000 samples from 12.5 s on" in sentence


def test_the_running_median_takes_spikes_off_and_little_else():
    """Oracle: the record before. At a turning point the median of 7 samples lies within what the
    motion does in 3."""
    values = ROUGH.copy()
    values[[700, 2500, 2501]] += 5.0
    within = np.max(np.abs(ROUGH[3:] - ROUGH[:-3]))
    np.testing.assert_allclose(despiked(values), ROUGH, rtol=0, atol=within)


@pytest.mark.parametrize("key", reference_manoeuvres())
@pytest.mark.parametrize("sample_step", [0.001, 0.005, 0.01])
def test_no_manoeuvre_makes_a_spike(key, sample_step):
    """Oracle: bumps, potholes and torque steps are what cars do."""
    manoeuvre = reference_manoeuvres()[key]
    simulate = simulate_road if manoeuvre.kind == "road" else simulate_posts
    run = simulate(CAR, manoeuvre, sample_step=sample_step).run
    found = [
        sentence
        for name in (*WHEEL_CHANNELS, *OUTPUT_CHANNELS, "chassis.a_x", "chassis.v_x")
        if name in run
        for sentence in spikes(channel(name), run.time, run[name])
    ]
    assert found == []
