"""Columns of the wheels exchanged on purpose: the oracle is always the exchange that was made."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from ridetune.engine.campaign import drive_campaign
from ridetune.engine.channels import WHEEL_CHANNELS
from ridetune.engine.wheel_order import exchanged_wheels
from scipy.integrate import cumulative_trapezoid

from ..factories import paper_vehicle

CAR = paper_vehicle()
MIRRORED = (1, 0, 3, 2)
EXCHANGES = sorted(set(permutations(range(4))) - {(0, 1, 2, 3), MIRRORED})
SENSOR_NOISE = 0.5e-3


@pytest.fixture(scope="module")
def drive():
    """Manoeuvre 2 with noise on the wheels, and the distance travelled."""
    [_, run] = drive_campaign(CAR)
    rng = np.random.default_rng(4)
    noisy = {
        name: run[name] + SENSOR_NOISE * rng.normal(size=run.time.size) for name in WHEEL_CHANNELS
    }
    distance = cumulative_trapezoid(run["chassis.v_x"], run.time, initial=0.0)
    return replace(run, channels={**run.channels, **noisy}), distance


def exchanged(run, columns):
    """The run whose column k holds the heights of wheel columns[k]."""
    moved = {
        name: run[WHEEL_CHANNELS[wheel]]
        for name, wheel in zip(WHEEL_CHANNELS, columns, strict=True)
    }
    return replace(run, channels={**run.channels, **moved})


def without(run, channel):
    return replace(run, channels={k: v for k, v in run.channels.items() if k != channel})


@pytest.mark.parametrize("columns", EXCHANGES)
def test_every_exchange_of_columns_is_named(drive, columns):
    run, distance = drive
    [sentence] = exchanged_wheels(exchanged(run, columns), distance, CAR.wheelbase)
    for column, wheel in enumerate(columns):
        read = f"{WHEEL_CHANNELS[wheel]} in column {WHEEL_CHANNELS[column]}"
        assert (read in sentence) == (wheel != column)


def test_columns_in_their_places_are_left_alone(drive):
    run, distance = drive
    assert exchanged_wheels(run, distance, CAR.wheelbase) == []


def test_a_mirrored_car_is_left_to_the_sign_of_its_roll(drive):
    """Symmetry: left and right change places, and the tracks follow each other as before."""
    run, distance = drive
    assert exchanged_wheels(exchanged(run, MIRRORED), distance, CAR.wheelbase) == []


def test_without_roll_one_of_the_two_mirror_images_is_named(drive):
    run, distance = drive
    given = without(exchanged(run, (2, 3, 0, 1)), "chassis.roll")
    assert len(exchanged_wheels(given, distance, CAR.wheelbase)) == 1


def test_nothing_is_said_of_a_car_that_hardly_moves(drive):
    run, distance = drive
    given = exchanged(run, (2, 3, 0, 1))
    assert exchanged_wheels(given, 0.1 * distance, CAR.wheelbase) == []
    assert exchanged_wheels(given, -distance, CAR.wheelbase) == []


def test_dead_wheels_are_not_taken_for_exchanged_ones(drive):
    run, distance = drive
    dead = replace(run, channels={**run.channels, "wheel.fl.z": np.zeros_like(run.time)})
    assert exchanged_wheels(dead, distance, CAR.wheelbase) == []


def test_a_road_alike_on_both_sides_tells_left_from_right_no_more(drive):
    """One track for both sides: exchanging left and right changes nothing."""
    run, distance = drive
    same = {"wheel.fr.z": run["wheel.fl.z"], "wheel.rr.z": run["wheel.rl.z"]}
    given = exchanged(replace(run, channels={**run.channels, **same}), (1, 0, 2, 3))
    assert exchanged_wheels(given, distance, CAR.wheelbase) == []
