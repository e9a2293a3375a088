"""How recordings drive the model, chosen on the page."""

import numpy as np
import pytest

from .conftest import Visitor
from .test_identification import free_only

pytestmark = pytest.mark.browser


def change(visitor: Visitor, label: str, text: str) -> None:
    field = visitor.page.get_by_label(label)
    field.fill(text)
    field.blur()
    visitor.settled()


def test_filters_and_initial_state_act_on_the_ride_and_on_the_fit(visitor):
    """Oracle: the line moves with each choice and comes back with it; the fit keeps them."""
    visitor.click("#tab-identification")
    visitor.click(".preparation summary")
    before = visitor.line("chassis.pitch")
    change(visitor, "Low-pass of the wheel centres", "2")
    filtered = visitor.line("chassis.pitch")
    assert np.abs(filtered - before).max() > 0.005
    visitor.page.select_option("#initial-state", "measured")
    visitor.settled()
    assert np.abs(visitor.line("chassis.pitch") - filtered).max() > 0.0
    visitor.page.select_option("#initial-state", "equilibrium")
    change(visitor, "Low-pass of the wheel centres", "50")
    np.testing.assert_array_equal(visitor.line("chassis.pitch"), before)

    change(visitor, "Low-pass of the longitudinal acceleration", "")
    free_only(visitor, "KF")
    visitor.click("#start")
    visitor.until("ridetune.state('fit') !== null", 120)
    settings = visitor.look("ridetune.job().result.settings")
    assert (settings["a_x_cutoff_hz"], settings["rim_cutoff_hz"]) == (None, 50)


def test_braking_is_marked_run_by_run(visitor):
    """The sample car has no brakes, which a mark that asks for them is told."""
    visitor.expect("status of 422")
    visitor.click("#tab-identification")
    when = "When detailed_manoeuvre_1.csv brakes"
    change(visitor, when, "soon")
    field = visitor.page.get_by_label(when)
    assert "begin-end in seconds" in field.evaluate("(field) => field.validationMessage")
    assert visitor.look("ridetune.state('braking')") == {}
    change(visitor, when, "6.2-9.8, 12 to 14")
    visitor.wait(
        lambda: "has no brakes" in visitor.element("#chart-note").inner_text(), "it is told"
    )
    [marked] = visitor.look("Object.values(ridetune.state('braking'))")
    assert marked == [[6.2, 9.8], [12, 14]]
    change(visitor, when, "none")
    visitor.wait(lambda: not visitor.element("#chart-note").is_visible(), "it goes on")
