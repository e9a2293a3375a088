from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.channels import INPUT_CHANNELS
from ridetune.engine.errors import MeasurementError, VehicleError
from ridetune.engine.run import Run
from ridetune.engine.simulation.braking import braking_weight, find_braking, slow_acceleration
from ridetune.engine.simulation.rims import prepare
from ridetune.engine.vehicle import Brakes

from ...factories import paper_vehicle

CAR = paper_vehicle()
BRAKED = replace(CAR, brakes=Brakes(front_share=0.65))


def still_run(time, **changed):
    """A car at rest, but for the channels given."""
    zero = np.zeros_like(time)
    return Run("still", time, {**dict.fromkeys(INPUT_CHANNELS, zero), **changed})


def test_braking_is_found_where_the_car_decelerates_long_and_hard_enough():
    """Oracle: the begin and end of a stop; a 1 Hz low-pass shifts an edge of 4 m/s2 seen at a
    seventh of it by less than half a period."""
    time = np.arange(0.0, 20.0, 0.005)
    a_x = np.zeros_like(time)
    a_x[(time > 5.0) & (time < 9.0)] = -4.0
    a_x[(time > 12.0) & (time < 12.1)] = -4.0
    a_x[time > 15.0] = -0.4
    [(begin, end)] = find_braking(time, slow_acceleration(time, a_x), rolling=0.01)
    assert abs(begin - 5.0) < 0.5
    assert abs(end - 9.0) < 0.5


def test_braking_weight_ramps_over_a_tenth_of_a_second_outside_the_interval():
    time = np.array([4.8, 4.9, 4.95, 5.0, 7.0, 9.0, 9.05, 9.1, 9.2])
    expected = [0.0, 0.0, 0.5, 1.0, 1.0, 1.0, 0.5, 0.0, 0.0]
    assert_allclose(braking_weight(time, [(5.0, 9.0)]), expected, rtol=0, atol=1e-12)


def test_a_braking_car_needs_brakes_to_brake_with():
    time = np.arange(0.0, 10.0, 0.005)
    run = still_run(time, **{"chassis.a_x": np.where((time > 3) & (time < 6), -4.0, 0.0)})
    assert prepare(run, BRAKED).stage_inputs[:, :, 14].max() == 1.0
    without = prepare(run, CAR)
    assert without.stage_inputs[:, :, 14].max() == 0.0
    [fault] = without.faults
    assert "no brakes" in fault
    assert fault in without.warnings
    assert not prepare(run, BRAKED).faults
    assert not prepare(replace(run, braking=()), CAR).faults


def test_marked_braking_goes_before_what_a_x_shows():
    time = np.arange(0.0, 10.0, 0.005)
    a_x = np.where((time > 3) & (time < 6), -4.0, 0.0)
    run = replace(still_run(time, **{"chassis.a_x": a_x}), braking=((7.0, 8.0),))
    prepared = prepare(run, BRAKED)
    begin = np.arange(len(prepared.stage_inputs)) * 0.005
    expected = braking_weight(begin, [(7.0, 8.0)])
    assert_allclose(prepared.stage_inputs[:, 0, 14], expected, rtol=0, atol=1e-9)
    assert prepared.braking == ((7.0, 8.0),)
    assert prepare(replace(run, braking=()), BRAKED).braking == ()
    with pytest.raises(VehicleError, match="no brakes"):
        prepare(run, CAR)


def test_marks_that_reach_beyond_the_record_are_cut_to_it():
    """Oracle: within the record the weight is that of the mark as it was given."""
    time = np.linspace(2.0, 10.0, 1601)
    run = replace(still_run(time), braking=((-3.0, 4.0), (9.0, 99.0)))
    prepared = prepare(run, BRAKED)
    assert prepared.braking == ((2.0, 4.0), (9.0, 10.0))
    begin = prepared.node_time[:-1]
    expected = braking_weight(begin, [(-3.0, 4.0), (9.0, 99.0)])
    assert_allclose(prepared.stage_inputs[:, 0, 14], expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("interval", "sentence"),
    [((8.0, 7.0), "give the begin first"), ((12.0, 14.0), "it lasts from 0 to 10 s")],
)
def test_marks_that_mean_nothing_in_the_run_are_refused(interval, sentence):
    run = replace(still_run(np.linspace(0.0, 10.0, 2001)), braking=(interval,))
    with pytest.raises(MeasurementError, match=sentence):
        prepare(run, BRAKED)
