"""What of a fit hangs on dampers being taken for linear."""

import numpy as np
from numpy.testing import assert_allclose
from ridetune.engine.campaign import drive_table_2
from ridetune.engine.identification.identify import Problem, identify
from ridetune.engine.identification.linear_dampers import freed_ratios
from ridetune.engine.identification.residuals import Residuals
from ridetune.engine.identification.search import Search
from ridetune.engine.run_notes import DEFAULT_NOISE
from ridetune.engine.simulation.simulate import rims_batch

from ...factories import paper_vehicle

CAR = paper_vehicle()
FREE = ["K_F", "C_F", "K_R", "C_R", "d_R", "phi_R"]
FRONT, REAR = "front.suspension.rebound_ratio", "rear.suspension.rebound_ratio"


def searched(problem):
    """The residuals of a problem, and where a search from its start values ends."""
    residuals = Residuals(problem, rims_batch)
    start = np.array([one.variable(one.start) for one in problem.variables])
    return residuals, Search(residuals).refine(start, 50)


def test_the_step_leads_to_the_fit_with_the_ratio_free():
    """Oracle: that fit. The ratio is so near 1 that one Gauss-Newton step is nearly all the way."""
    runs = drive_table_2(CAR.with_values({FRONT: 1.05}))
    problem = Problem.build(CAR, runs, FREE)
    residuals, found = searched(problem)
    steps = freed_ratios(residuals, found, np.zeros(len(FREE), dtype=bool))
    assert steps.keys() == {FRONT, REAR}

    wider, freed = searched(Problem.build(CAR, runs, [*FREE, FRONT]))
    values = wider.problem.values(freed.x)
    went = [one.variable(value) for one, value in zip(problem.free, values, strict=False)] - found.x
    assert np.max(np.abs(went)) > 1e-3
    assert_allclose(steps[FRONT], went, rtol=0.1, atol=0.1 * float(np.max(np.abs(went))))


def test_what_is_at_a_bound_stays_there():
    runs = drive_table_2(CAR.with_values({FRONT: 1.05}))
    residuals, found = searched(Problem.build(CAR, runs, FREE))
    held = np.arange(len(FREE)) == FREE.index("d_R")
    for step in freed_ratios(residuals, found, held).values():
        assert step[held] == 0.0
        assert np.all(step[~held] != 0.0)


def test_a_ratio_that_is_known_or_looked_for_is_not_let_go():
    known = CAR.with_values({FRONT: 2.0})
    problem = Problem.build(known, drive_table_2(known), [*FREE, REAR])
    residuals, found = searched(problem)
    assert freed_ratios(residuals, found, np.zeros(len(FREE) + 1, dtype=bool)) == {}


def test_the_fit_of_a_car_with_linear_dampers_hangs_on_no_damper():
    """Oracle: the car that drove; its residuals are the sensors' noise."""
    runs = drive_table_2(CAR, noise=DEFAULT_NOISE)
    assert identify(Problem.build(CAR, runs, FREE)).verdict.conditions == {}
