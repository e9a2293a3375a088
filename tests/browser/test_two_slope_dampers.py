"""Dampers of two slopes on the page: switched on, found by a fit, brought along by a car."""

import json

import numpy as np
import pytest
from ridetune.engine.parameters import ALL_NAMES, PARAMETER_NAMES
from ridetune.engine.vehicle_file import vehicle_to_json

from ..factories import paper_vehicle

pytestmark = pytest.mark.browser


def test_the_car_s_two_slope_dampers_are_switched_on_and_off(visitor):
    """Four more sliders and rows; the slopes change the ride, and off is as before."""
    before = visitor.line("chassis.z")
    visitor.click("#tab-identification")
    rows = visitor.element(".free tbody tr")
    assert rows.count() == 12
    visitor.click("#bent")
    visitor.settled()
    assert rows.count() == 16
    assert visitor.value("front.suspension.rebound_ratio") == 1.5
    ratio = visitor.page.locator(".free tbody tr", has_text="ρF")
    assert ratio.locator("td.unit").inner_text() == ""
    assert visitor.element("#value-rear-suspension-knee_speed").input_value() == "0.5"
    assert np.abs(visitor.line("chassis.z") - before).max() > 0.1
    visitor.click("#bent")
    visitor.settled()
    assert rows.count() == 12
    assert not visitor.element("#value-rear-suspension-knee_speed").is_visible()
    np.testing.assert_allclose(visitor.line("chassis.z"), before, atol=1e-9)


def test_finding_two_slope_dampers_leaves_the_car_on_show(visitor):
    """Oracle: the line of before; the fit's own starts, 1.5 and 0.5 m/s, and its bounds."""
    before = visitor.line("chassis.z")
    visitor.click("#tab-identification")
    box, rows = visitor.element("#two-slope"), visitor.element(".free tbody tr")
    box.check()
    assert rows.count() == 16
    assert [*visitor.look("ridetune.state('values')")] == list(PARAMETER_NAMES)
    visitor.settled()
    np.testing.assert_array_equal(visitor.line("chassis.z"), before)
    assert not visitor.element("#bent").is_checked()
    visitor.until("ridetune.state('defaultBounds')?.bounds['rear.suspension.knee_speed']")
    ratio = visitor.page.get_by_label("Lower bound of Front rebound ratio")
    visitor.wait(lambda: ratio.input_value() == "0.2", "the bounds are there")
    for name in ("Front rebound ratio", "Rear rebound ratio", "Rear knee speed"):
        visitor.page.get_by_label(f"{name} is free").uncheck()
    visitor.page.get_by_label("Front knee speed is free").click()
    assert not box.is_checked()
    assert box.evaluate("(box) => box === document.activeElement")
    assert rows.count() == 12
    box.check()
    visitor.click("#start")
    visitor.until("ridetune.state('fit') !== null", 150)
    assert set(visitor.look("ridetune.job().free")) == set(ALL_NAMES)
    starts = visitor.look("ridetune.job().start")
    assert (starts["front.suspension.rebound_ratio"], starts["rear.suspension.knee_speed"]) == (
        1.5,
        0.5,
    )
    np.testing.assert_array_equal(visitor.line("chassis.z", "reference"), before)
    visitor.click("#apply")
    visitor.settled()
    assert visitor.element("#bent").is_checked()
    assert visitor.element("#value-rear-suspension-knee_speed").is_visible()


def test_dampers_that_a_car_brings_along_are_known_until_they_are_freed(visitor):
    """Oracle: what an identification is asked to free, as of REST and the command line."""
    car = vehicle_to_json(paper_vehicle())
    for axle in ("front", "rear"):
        car[axle]["suspension"] |= {"rebound_ratio": 2.0, "knee_speed": 0.4}

    def bring():
        visitor.click("#tab-car")
        visitor.page.get_by_label("Vehicle file").set_input_files(
            [
                {
                    "name": "bent.json",
                    "mimeType": "application/json",
                    "buffer": json.dumps(car).encode(),
                }
            ]
        )
        visitor.until("ridetune.state('baseline').front.suspension.knee_speed === 0.4")
        visitor.settled()
        visitor.click("#tab-identification")

    def freed():
        visitor.click("#start")
        visitor.until("ridetune.job() && ['queued', 'running'].includes(ridetune.job().state)")
        names = set(visitor.look("ridetune.job().free"))
        visitor.click("#cancel")
        visitor.until("ridetune.job().state === 'cancelled'")
        visitor.click("#identification >> text=Set-up")
        return names

    bring()
    rows = visitor.element(".free tbody tr")
    assert rows.count() == 16
    assert not visitor.element("#two-slope").is_checked()
    assert freed() == set(PARAMETER_NAMES)
    visitor.page.get_by_label("Front rebound ratio is free").check()
    assert freed() == {*PARAMETER_NAMES, "front.suspension.rebound_ratio"}
    visitor.click("#two-slope")
    visitor.click("#two-slope")
    assert freed() == set(ALL_NAMES)
    bring()
    assert freed() == set(PARAMETER_NAMES)


def test_a_ratio_is_told_without_a_unit(visitor):
    visitor.click("#bent")
    ratio = visitor.element("#value-front-suspension-rebound_ratio")
    label = visitor.page.get_by_text("Rebound ratio").first
    assert "rebound over that in jounce" in label.get_attribute("title")
    ratio.fill("25")
    ratio.press("Tab")
    said = visitor.element("#notices").inner_text()
    assert "Front rebound ratio stays 1.5. 25 is not accepted; give 0.05 to 20." in said
