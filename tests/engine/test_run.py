"""Time histories: their order, their checks, and what they answer."""

import math
import pickle

import numpy as np
import pytest
from ridetune.engine.errors import MeasurementError
from ridetune.engine.run import Run


def make_run(**changes):
    fields = {
        "name": "a run",
        "time": np.array([1.0, 1.1, 1.25, 2.0]),
        "channels": {
            "seat.driver.a_z": np.zeros(4),
            "wheel.fl.z": np.arange(4),
            "chassis.z": np.ones(4),
        },
    }
    return Run(**fields | changes)


def test_a_run_lists_its_channels_in_the_order_of_the_table():
    assert make_run().columns == ["chassis.z", "wheel.fl.z", "seat.driver.a_z"]


def test_a_run_gives_its_channels_as_contiguous_doubles():
    values = make_run()["wheel.fl.z"]
    assert values.dtype == np.float64
    assert values.flags.c_contiguous
    np.testing.assert_array_equal(values, [0.0, 1.0, 2.0, 3.0])


def test_a_run_knows_its_duration_and_its_usual_step():
    run = make_run()
    assert run.duration == pytest.approx(1.0)
    assert run.sample_step == pytest.approx(0.15)  # median of 0.1, 0.15, 0.75


def test_a_run_always_holds_time():
    run = make_run()
    assert "time" in run
    assert run["time"] is run.time
    assert "chassis.z" in run
    assert "chassis.roll" not in run


def test_a_run_says_what_it_holds_when_asked_for_something_else():
    with pytest.raises(MeasurementError, match=r"a run: there is no channel chassis\.roll"):
        make_run()["chassis.roll"]
    with pytest.raises(MeasurementError, match=r"did you mean chassis\.roll"):
        make_run()["chassis.rol"]


@pytest.mark.parametrize(
    "time", [[0.0, 1.0, 1.0, 2.0], [0.0, 2.0, 1.0, 3.0], [0.0, math.nan, 2.0, 3.0], [0.0], 1.0]
)
def test_a_run_s_time_must_increase(time):
    with pytest.raises(MeasurementError, match="a run: time must be one strictly increasing"):
        make_run(time=time, channels={})


def test_a_run_s_channels_must_be_as_long_as_its_time():
    with pytest.raises(MeasurementError, match=r"chassis\.z has shape \(3,\), but time has \(4,\)"):
        make_run(channels={"chassis.z": np.zeros(3)})


def test_a_run_takes_known_channels_only():
    with pytest.raises(MeasurementError, match=r"did you mean chassis\.roll"):
        make_run(channels={"chassis.rol": np.zeros(4)})


def test_a_run_survives_the_trip_to_a_worker_process():
    run = pickle.loads(pickle.dumps(make_run(noise={"chassis.z": 5e-4})))
    assert run.columns == make_run().columns
    assert run.noise == {"chassis.z": 5e-4}
