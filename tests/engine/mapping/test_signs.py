"""Channels that are turned over. Oracle: simulated drives whose signs are right."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from ridetune.engine.channels import WHEEL_CHANNELS
from ridetune.engine.manoeuvre import reference_manoeuvres
from ridetune.engine.mapping.signs import check_signs
from ridetune.engine.simulation.excitation import FreeExcitation

from ...factories import paper_vehicle

JUDGED = ("chassis.z", "chassis.pitch", "chassis.roll", "chassis.a_x", *WHEEL_CHANNELS)


@cache
def drive(name):
    """To 15 m/s on class A, then class C ("2"); or a rig."""
    return FreeExcitation(reference_manoeuvres()[name]).simulate(paper_vehicle(), "8dof").run


def turned(run, *names):
    return replace(run, channels={**run.channels, **{name: -run[name] for name in names}})


def offered(run):
    return [one.channel for one in check_signs(run)]


@pytest.mark.parametrize("name", ["2", "heave", "pitch", "roll", "warp"])
def test_right_signs_are_left_alone(name):
    assert offered(drive(name)) == []


@pytest.mark.parametrize("name", JUDGED)
def test_each_channel_turned_over_is_offered_to_be_turned_back(name):
    [one] = check_signs(turned(drive("2"), name))
    assert (one.channel, one.flip) == (name, True)
    assert -1.0 <= one.correlation < -0.5
    assert one.sentence.startswith(f"{name} runs against ")
    assert f"(correlation {one.correlation:.2f})" in one.sentence
    assert name not in [one.channel for one in check_signs(turned(drive("2"), name), [name])]


@pytest.mark.parametrize(
    "names",
    [
        ("chassis.z", "chassis.pitch"),
        ("chassis.pitch", "chassis.a_x"),
        ("wheel.fl.z", "chassis.roll"),
        ("wheel.fr.z", "wheel.rr.z"),
    ],
)
def test_two_channels_turned_over_are_both_found(names):
    assert set(offered(turned(drive("2"), *names))) == set(names)


def test_without_the_wheels_the_dive_tells_pitch_from_a_x():
    """The change of speed says that a_x is right, so that pitch is turned over."""
    run = turned(drive("2"), "chassis.pitch")
    kept = ("chassis.pitch", "chassis.a_x", "chassis.v_x")
    assert offered(replace(run, channels={name: run[name] for name in kept})) == ["chassis.pitch"]


@pytest.mark.parametrize("name", WHEEL_CHANNELS)
def test_a_rig_s_wheels_are_not_judged(name):
    """They go against each other as the rig was told."""
    assert not set(offered(turned(drive("warp"), name))) & set(WHEEL_CHANNELS)


def test_what_does_not_move_slowly_is_not_judged():
    """A smooth road at 8 Hz, and a record of one second."""
    run = drive("2")
    fast = {name: 1e-3 * np.sin(50.0 * run.time) for name in JUDGED}
    fast["chassis.pitch"] = -fast["chassis.pitch"]
    assert offered(replace(run, channels=fast)) == []
    short = run.time <= 1.0
    cut = replace(
        run, time=run.time[short], channels={name: run[name][short] for name in run.columns}
    )
    assert offered(turned(cut, "chassis.z")) == []
    assert offered(replace(run, channels={"chassis.v_x": run["chassis.v_x"]})) == []
