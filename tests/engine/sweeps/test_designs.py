"""Designs of a sweep: which cars, whatever the blocks; and what cannot be swept."""

import itertools
import warnings

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from ridetune.engine.errors import ParameterError, RideError, SweepError
from ridetune.engine.sweeps.designs import FullFactorial, LatinHypercube, Sobol, Spaced
from scipy.stats import qmc

RANGES = {
    "K_F": (1e4, 4e4),
    "chassis.mass": (900.0, 1400.0),
    "rear.tyre.stiffness": (1.5e5, 2.5e5),
}
PATHS = ("front.suspension.stiffness", "chassis.mass", "rear.tyre.stiffness")
LOW, HIGH = np.array(list(RANGES.values())).T


def blocks(design, size):
    """The whole design, drawn in blocks of one size."""
    return np.concatenate([design.block(k, size) for k in range(0, design.cars, size)])


def test_a_full_factorial_has_every_combination_once_the_last_parameter_fastest():
    """Oracle: itertools."""
    levels = {"K_F": Spaced(1e4, 3e4, 5), "C_R": [900.0, 2000.0], "chassis.mass": [1e3]}
    design = FullFactorial(levels)
    expected = itertools.product(np.linspace(1e4, 3e4, 5), [900.0, 2000.0], [1e3])
    assert design.names == ("front.suspension.stiffness", "rear.suspension.damping", "chassis.mass")
    assert design.cars == 10
    assert_array_equal(design.block(0, 100), np.array(list(expected)))
    assert_array_equal(blocks(design, 3), design.block(0, 10))


def test_levels_are_not_held_so_that_any_number_of_them_can_be_counted():
    design = FullFactorial({"K_F": Spaced(1e4, 3e4, 10**6), "K_R": Spaced(1e4, 3e4, 10**6)})
    assert design.cars == 10**12
    assert_array_equal(design.block(10**12 - 1, 5), [[3e4, 3e4]])


@pytest.mark.parametrize("cars", [1, 7, 64])
def test_a_latin_hypercube_has_one_car_in_each_stratum_of_each_parameter(cars):
    values = LatinHypercube(RANGES, cars, seed=3).block(0, cars)
    strata = np.floor((values - LOW) / (HIGH - LOW) * cars)
    assert_array_equal(np.sort(strata, axis=0), np.tile(np.arange(cars)[:, np.newaxis], 3))


@pytest.mark.parametrize("cars", [1, 2, 100, 128])
def test_a_sobol_sweep_is_scipys_sequence(cars):
    """Oracle: scipy, drawn in one go as a power of two."""
    expected = qmc.scale(qmc.Sobol(3, rng=11).random(128)[:cars], LOW, HIGH)
    np.testing.assert_allclose(Sobol(RANGES, cars, seed=11).block(0, cars), expected, rtol=1e-15)


@pytest.mark.parametrize("kind", [LatinHypercube, Sobol])
def test_a_car_is_the_same_whatever_the_blocks(kind):
    whole = kind(RANGES, 100, seed=5).block(0, 100)
    for size in (1, 7, 64):
        assert_array_equal(blocks(kind(RANGES, 100, seed=5), size), whole)
    backwards = kind(RANGES, 100, seed=5)
    for first in (90, 40, 0):
        assert_array_equal(backwards.block(first, 10), whole[first : first + 10])
    assert not np.array_equal(kind(RANGES, 100, seed=6).block(0, 100), whole)


def test_any_number_of_cars_is_drawn_without_a_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert Sobol(RANGES, 1000).block(0, 999).shape == (999, 3)


def test_cars_lie_in_the_box_and_names_are_paths():
    for design in (LatinHypercube(RANGES, 50), Sobol(RANGES, 50)):
        values = design.block(0, 50)
        assert design.names == PATHS
        assert np.all((values >= LOW) & (values <= HIGH))
        assert_array_equal((design.low, design.high), (LOW, HIGH))


@pytest.mark.parametrize(
    ("ranges", "told"),
    [
        ({}, "varies nothing"),
        ({"front.suspension.stifness": (1e4, 2e4)}, "did you mean front.suspension.stiffness?"),
        ({"chassis.mas": (1e3, 2e3)}, "did you mean chassis.mass?"),
        ({"colour": (1, 2)}, "No number of a vehicle is called 'colour'"),
        ({"K_G": (1, 2)}, "did you mean K_R?"),
        ({"K_F": (1e4, 2e4), PATHS[0]: (1e4, 2e4)}, f"{PATHS[0]} is swept twice, as K_F and as"),
        ({"K_F": (2e4, 1e4)}, "20000 to 10000 N/m, are crossed or leave no room"),
        ({"K_F": (2e4, 2e4)}, "crossed or leave no room"),
        ({"K_F": (1.0, 2e4)}, "reach 1, but it must lie between 100 and 1e+07 N/m"),
        ({"K_F": (1e4, float("inf"))}, "hold inf; give finite numbers"),
        ({"K_F": (float("nan"), 1e4)}, "hold nan; give finite numbers"),
        ({"d_F": (-1.0, 1.0)}, "span zero"),
    ],
)
def test_a_box_that_cannot_be_swept_is_refused_in_one_sentence(ranges, told):
    for make in (Sobol, LatinHypercube):
        with pytest.raises((SweepError, ParameterError)) as refused:
            make(ranges, 8)
        assert told in str(refused.value)


@pytest.mark.parametrize(
    ("levels", "told"),
    [
        ({}, "varies nothing"),
        ({"K_F": []}, "has no levels"),
        ({"K_F": [1e4, 2e4, 1e4]}, "has the level 10000 more than once"),
        ({"K_F": [1e4, 1.0]}, "must lie between"),
        ({"K_F": Spaced(3e4, 1e4, 3)}, "crossed"),
        ({"K_F": Spaced(1e4, 3e4, 1)}, "levels is 1; give a whole number from 2 on"),
        ({"d_F": Spaced(-1.0, 1.0, 4)}, "span zero"),
    ],
)
def test_levels_that_cannot_be_swept_are_refused_in_one_sentence(levels, told):
    with pytest.raises(SweepError) as refused:
        FullFactorial(levels)
    assert told in str(refused.value)


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: Sobol(RANGES, 0), "cars is 0; give a whole number from 1 on"),
        (lambda: Sobol(RANGES, 2.5), "cars is 2.5"),
        (lambda: LatinHypercube(RANGES, 4, seed=-1), "seed is -1"),
        (lambda: LatinHypercube(RANGES, 10**12), "at most 1e+06 cars, not 1e+12; take a Sobol"),
    ],
)
def test_a_number_of_cars_or_a_seed_that_is_none_is_refused(make, told):
    with pytest.raises(RideError) as refused:
        make()
    assert told in str(refused.value)
