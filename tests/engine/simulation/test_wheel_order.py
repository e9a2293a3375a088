"""Columns of the wheels exchanged on purpose: the oracle is always the exchange that was made."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from ridetune.engine.campaign import drive_table_2
from ridetune.engine.channels import WHEEL_CHANNELS as WHEELS
from ridetune.engine.simulation.wheel_order import exchanged_wheels, wheel_rises
from scipy.integrate import cumulative_trapezoid

from ...factories import paper_vehicle

CAR = paper_vehicle()
MIRRORED = (1, 0, 3, 2)
EXCHANGES = sorted(set(permutations(range(4))) - {(0, 1, 2, 3), MIRRORED})
SENSOR_NOISE = 0.5e-3


@pytest.fixture(scope="module")
def drive():
    """Manoeuvre 2 with noise on the wheels."""
    [_, run] = drive_table_2(CAR)
    rng = np.random.default_rng(4)
    return having(
        run, {name: run[name] + SENSOR_NOISE * rng.normal(size=run.time.size) for name in WHEELS}
    )


def having(run, changed):
    return replace(run, channels={**run.channels, **changed})


def without(run, channel):
    return replace(run, channels={k: v for k, v in run.channels.items() if k != channel})


def exchanged(run, columns):
    """The run whose column k holds the heights of wheel columns[k]."""
    return having(run, {WHEELS[k]: run[WHEELS[wheel]] for k, wheel in enumerate(columns)})


def told(run):
    rises = wheel_rises(run)
    return [] if rises is None else exchanged_wheels(run, rises, CAR.wheelbase)


def names(sentence, columns):
    """Whether a sentence names all wheels in wrong columns and no other."""
    return all(
        (f"{WHEELS[wheel]} in column {WHEELS[column]}" in sentence) == (wheel != column)
        for column, wheel in enumerate(columns)
    )


@pytest.mark.parametrize("columns", EXCHANGES)
def test_every_exchange_of_columns_is_named(drive, columns):
    [sentence] = told(exchanged(drive, columns))
    assert names(sentence, columns)


def test_columns_in_their_places_are_left_alone(drive):
    assert told(drive) == []


@pytest.mark.parametrize("factor", [0.85, 1.15])
def test_a_speed_that_is_somewhat_off_is_no_exchange(drive, factor):
    assert told(having(drive, {"chassis.v_x": factor * drive["chassis.v_x"]})) == []


def test_a_mirrored_car_is_left_to_the_sign_of_its_roll(drive):
    """Symmetry: left and right change places, and the tracks follow each other as before."""
    assert told(exchanged(drive, MIRRORED)) == []


def test_without_roll_one_of_the_two_mirror_images_is_named(drive):
    [sentence] = told(without(exchanged(drive, (2, 3, 0, 1)), "chassis.roll"))
    assert names(sentence, (2, 3, 0, 1)) or names(sentence, (3, 2, 1, 0))


@pytest.mark.parametrize("factor", [0.1, -1.0])
def test_nothing_is_said_of_a_car_that_hardly_drives_forwards(drive, factor):
    given = exchanged(drive, (2, 3, 0, 1))
    assert told(having(given, {"chassis.v_x": factor * drive["chassis.v_x"]})) == []
    assert told(without(given, "chassis.v_x")) == []


def test_dead_wheels_are_not_taken_for_exchanged_ones(drive):
    assert told(having(drive, {"wheel.fl.z": np.zeros_like(drive.time)})) == []


def test_a_sine_road_is_alike_everywhere(drive):
    """Oracle: on a sine the wheels of an axle follow each other at any distance; waves of 3 m seen
    with a speed 10 % off the car's."""
    travelled = cumulative_trapezoid(drive["chassis.v_x"], drive.time, initial=0.0)
    waves = {
        name: 0.01 * np.sin(2 * np.pi * (1.1 * travelled - behind) / 3.0)
        for name, behind in zip(WHEELS, (0.0, 0.0, CAR.wheelbase, CAR.wheelbase), strict=True)
    }
    assert told(having(drive, waves)) == []


def test_on_one_track_for_both_sides_the_fewest_columns_are_moved(drive):
    """Left and right cannot be told apart there, front and rear can."""
    one_track = {"wheel.fr.z": drive["wheel.fl.z"], "wheel.rr.z": drive["wheel.rl.z"]}
    same = without(having(drive, one_track), "chassis.roll")
    assert told(exchanged(same, (1, 0, 2, 3))) == []
    [sentence] = told(exchanged(same, (2, 1, 0, 3)))
    assert names(sentence, (2, 1, 0, 3))
