from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from ridetune.engine.conditioning.calibration import Rest, Scale
from ridetune.engine.conditioning.chain import condition, steps_from_json, steps_to_json
from ridetune.engine.conditioning.delay import Delay
from ridetune.engine.conditioning.motion import Angles, Displacement, Gravity, Speed
from ridetune.engine.conditioning.rims import RimFromTravel
from ridetune.engine.conditioning.sampling import Cut, Despike, Fill, Resample
from ridetune.engine.errors import ConditioningError, MeasurementError
from ridetune.engine.run import Run
from ridetune.engine.step_record import step_record_to_json, step_records_from_json

EVERY = (
    Cut(1.0, 9.0),
    Fill(("chassis.z",), 0.2),
    Despike(),
    Resample(100.0),
    Delay("chassis.v_x", reference="chassis.a_x", order=-1),
    Scale("chassis.pitch_rate", gain=-1.0),
    Rest(interval=(0.0, 1.0)),
    Speed("wheels", acceleration=True),
    Angles("pitch", False, 0.0),
    Gravity((0.1, 0.0, 0.2)),
    Displacement(("chassis.a_z",), (0.5, 20.0)),
    RimFromTravel(("fl", "rr"), "arm"),
)
TIME = np.arange(0.0, 10.0, 0.01)
RUN = Run("r", TIME, {"chassis.pitch": np.sin(TIME), "chassis.roll": np.cos(TIME)})


def test_every_step_goes_to_json_and_back():
    assert steps_from_json(steps_to_json(EVERY)) == EVERY
    assert len({step.kind for step in EVERY}) == 12


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        ({"kind": "rest"}, r"^s: must be a list of steps"),
        ([{"kind": "reest"}], r'^s: step\[0\].kind "reest" is not known; did you mean "rest"\?'),
        ([{}], r"^s: step\[0\].kind is missing; use"),
        ([{"kind": "scale"}], r"^s: step\[0\].channel is missing; add a text"),
        (
            [{"kind": "resample", "rate_hz": -1}],
            r"^s: step\[0\].rate_hz is -1, but must lie between",
        ),
        ([{"kind": "rest", "chanels": []}], r'chanels is not known; did you mean "channels"\?'),
        ([{"kind": "delay", "channel": "chassis.z"}], r"^s: step\[0\]: a delay is either given"),
        (
            [{"kind": "angles", "angle": "roll", "crossover_hz": 0}],
            "crossover_hz is 0, below which",
        ),
        ([{"kind": "angles", "angle": "yaw"}], r'angle is "yaw", but must be "pitch" or "roll"'),
        ([{"kind": "rest"}] * 101, "has 101 steps, more than 100"),
    ],
)
def test_steps_that_cannot_be_read_are_refused_with_their_place(data, sentence):
    with pytest.raises(ConditioningError, match=sentence):
        steps_from_json(data, "s")


def test_each_step_leaves_a_record_and_the_run_is_not_changed():
    done = condition(RUN, [Scale("chassis.pitch", gain=2.0), Scale("chassis.pitch", gain=0.5)])
    assert_array_equal(done["chassis.pitch"], RUN["chassis.pitch"])
    assert [record.step["gain"] for record in done.conditioning] == [2.0, 0.5]
    assert RUN.conditioning == ()
    assert condition(done, [Cut(1.0, 2.0)]).conditioning[2].channels == tuple(RUN.columns)


def test_an_error_names_the_step_that_it_stops_at():
    with pytest.raises(ConditioningError, match="^Run r, step 2, scale: the run lacks chassis.z"):
        condition(RUN, [Scale("chassis.pitch"), Scale("chassis.z")])


def test_numbers_beyond_all_bounds_stop_it():
    with pytest.raises(ConditioningError, match="chassis.pitch grows beyond all bounds"):
        condition(RUN, [Scale("chassis.pitch", gain=1e-6)] * 3)


def test_a_record_goes_to_json_and_back():
    [record] = condition(RUN, [Cut(1.0, 2.0)]).conditioning
    record = replace(record, warnings=("It drifts.",))
    kept = step_record_to_json(record)
    assert step_records_from_json([kept], "s") == (record,)
    # Notes of before there were warnings.
    del kept["warnings"]
    assert step_records_from_json([kept], "s") == (replace(record, warnings=()),)


@pytest.mark.parametrize("data", [3, [3], [{}], [{"step": {}, "channels": []}]])
def test_what_is_no_record_is_refused(data):
    with pytest.raises(MeasurementError, match="^s: conditioning must be a list of what was done"):
        step_records_from_json(data, "s")
