from pathlib import Path

import numpy as np
from numpy.testing import assert_allclose
from ridetune.engine.measurement import read_run
from ridetune.engine.run import Run
from ridetune.engine.validation.squat import squat_window

MANOEUVRE_2 = Path(__file__).parents[3] / "sample_runs/twin/manoeuvre_2.csv"


def test_the_squat_is_read_late_in_the_push_and_long_before_it():
    """Oracle: Manoeuvre 2 pushes from 5 to 10 s; a_x is read below 1 Hz, hence 0.2 s."""
    window = squat_window(read_run(MANOEUVRE_2))
    assert_allclose(window.late, (7.5, 10.0), atol=0.2)
    assert_allclose(window.rest, (2.5, 4.5), atol=0.2)
    still = Run("still", np.arange(100) * 0.01, {"chassis.pitch": np.zeros(100)})
    assert squat_window(still) is None


def test_the_squat_of_two_pushes_is_that_of_the_longer():
    """Oracle: 2 m/s2 from 5 to 9 s, and again from 20 to 22 s; read below 1 Hz, hence 0.2 s."""
    time = np.arange(3000) * 0.01
    push = 2.0 * (((time > 5.0) & (time < 9.0)) | ((time > 20.0) & (time < 22.0)))
    run = Run("two", time, {"chassis.a_x": push, "chassis.pitch": np.zeros(3000)})
    window = squat_window(run)
    assert_allclose(window.late, (7.0, 9.0), atol=0.2)
    assert_allclose(window.rest, (2.5, 4.5), atol=0.2)
