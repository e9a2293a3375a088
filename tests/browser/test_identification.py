"""From a measured ride to an identified car, on the page."""

import numpy as np
import pytest

from .conftest import add_file, free_only, short_run

pytestmark = pytest.mark.browser


def fit_of(visitor, channel):
    return visitor.look(f"ridetune.state('now').head.fit_percent['{channel}']")


def test_a_fit_is_followed_again_after_the_service_could_not_answer(visitor):
    """As while it ends or its database is away: its events are refused, and so is the next look."""
    visitor.expect("status of 503")
    refused = []

    def away(route):
        if len(refused) < 2 and route.request.method == "GET":
            refused.append(route.request.url.rsplit("/", 1)[-1])
            route.fulfill(status=503, content_type="application/problem+json", body="{}")
        else:
            route.continue_()

    visitor.page.route("**/identifications/**", away)
    visitor.click("#identify")
    visitor.until("ridetune.state('fit') !== null", 120)
    assert len(refused) == 2
    assert refused[0] == "events" != refused[1]


def test_a_fit_that_has_just_begun_says_one_thing(visitor):
    """Until it tells how far it is, neither a fit that goes on nor one that has not started."""

    def begun(route):
        reply = route.fetch()
        told = reply.json() | {"state": "running", "progress": {}}
        route.fulfill(response=reply, json=told)

    visitor.page.route("**/identifications", begun)
    visitor.page.route("**/events", lambda route: None)
    pressed = visitor.page.evaluate("""() => {
        document.querySelector("#identify").click();
        const [button, below] = ["#identify", "#start"].map((one) => document.querySelector(one));
        return [button.textContent, button.disabled, below.disabled];
    }""")
    assert pressed == ["Identifying …", True, True], "before the service has answered"
    visitor.until("ridetune.job() !== null")
    assert visitor.element("#outcome").inner_text() == "Starting the fit …"
    assert visitor.element("#cost-now").inner_text() == ""
    assert "not started" not in visitor.element("#identification").inner_text().lower()


def test_a_newcomer_identifies_the_sample_car_and_applies_it(visitor):
    """Open, press Identify, apply: the charts move towards the measurement."""
    before, worse = visitor.line("chassis.pitch"), fit_of(visitor, "chassis.pitch")
    visitor.click("#identify")
    visitor.until("ridetune.state('fit') !== null", 150)
    assert visitor.element("#identification").is_visible()
    rows = "[...document.querySelectorAll('.estimates tbody tr')]"
    bottoms = visitor.look(f"{rows}.map((row) => row.getBoundingClientRect().bottom)")
    assert len(bottoms) == 12
    assert max(bottoms) <= 768, "all twelve rows are in sight"
    # Warnings speak of symbols and of the sliders' units.
    warnings = visitor.element(".warnings").inner_text()
    assert "front stabilizer bar stiffness is at its upper bound, 2094 N m/deg" in warnings
    assert "stabilizer_bar" not in warnings
    # A value at a bound says so, and every row between which values it was searched.
    bar = visitor.page.locator(".estimates tr", has_text="KtorF")
    assert "at upper" in bar.inner_text()
    assert "Searched between 13.1 … 2094 N m/deg" in bar.get_attribute("title")
    visitor.click(".to-warnings")
    last = visitor.element("#identification .warnings li").last.bounding_box()
    assert last["y"] + last["height"] <= 768

    visitor.click("#apply")
    visitor.settled()
    identified = visitor.look("ridetune.job().result.vehicle.front.suspension.stiffness")
    assert visitor.value("front.suspension.stiffness") == identified
    assert np.abs(visitor.line("chassis.pitch") - before).max() > 0.01
    assert fit_of(visitor, "chassis.pitch") > worse
    np.testing.assert_array_equal(visitor.line("chassis.pitch", "reference"), before)

    # Error bars beside the sliders, and a score on the run that was held out.
    assert visitor.element("#parameters .spread").first.inner_text().startswith("±")
    visitor.until("document.querySelectorAll('.held-out td').length > 0")
    visitor.wait(
        lambda: "…" not in visitor.element(".held-out").inner_text(), "the held-out run is scored"
    )

    # Only a slider that holds the fit has its error beside it.
    field = visitor.element("#value-front-suspension-stiffness")
    field.fill("30")
    field.blur()
    spread = visitor.element("[data-name='front.suspension.stiffness'] .spread")
    assert spread.inner_text() == f"fit {identified / 1000:.1f}"
    visitor.click("#apply")
    assert spread.inner_text().startswith("±")
    assert visitor.value("front.suspension.stiffness") == identified

    visitor.click("#identification >> text=Set-up")
    # What ended at a bound starts the next fit between the same bounds; the others follow.
    visitor.until("ridetune.state('defaultBounds').start === ridetune.state('values')")
    for name, expected in (
        ("Front stabilizer bar stiffness", [13.09, 2094.4]),
        ("Front spring stiffness", [0.05e-3 * identified, 8e-3 * identified]),
    ):
        fields = (
            visitor.page.get_by_label(f"{word} bound of {name}") for word in ("Lower", "Upper")
        )
        shown = [float(field.input_value()) for field in fields]
        assert shown == pytest.approx(expected, rel=1e-4)
    assert "yellow: bounds of the applied fit" in visitor.element("#free-note").inner_text()

    # What was found is still there when the page is opened again.
    visitor.wait(lambda: not visitor.look("ridetune.unsaved()"), "the sliders are saved")
    visitor.page.reload()
    visitor.wait_until_drawn()
    assert visitor.value("front.suspension.stiffness") == identified
    visitor.until("ridetune.state('fit') !== null")


def test_an_uploaded_file_is_identified(visitor):
    visitor.click("#tab-measurements")
    add_file(visitor, "my_ride.csv", short_run())
    visitor.until("ridetune.state('measurements').length === 3")
    assert "my_ride.csv" in visitor.element(".measurement-detail").inner_text()

    visitor.page.get_by_role("button", name="Use as ride").click()

    visitor.click("#tab-identification")
    for name, role in (("detailed_manoeuvre_1.csv", "hold_out"), ("my_ride.csv", "fit")):
        assert visitor.page.get_by_label(f"Use of {name}").input_value() == role
    free_only(visitor, "KF", "CF", "KR", "CR")
    visitor.click("#start")
    visitor.until("ridetune.state('fit') !== null", 120)
    assert visitor.look("ridetune.job().runs.map(({ name }) => name)") == ["my_ride.csv"]
    estimates = visitor.element(".estimates tbody tr").all()
    assert len(estimates) == 4
    assert all("…" in row.inner_text() for row in estimates)

    # Of another car than the sliders' it says so.
    assert not visitor.element("#other-car").is_visible()
    visitor.click("#tab-car")
    visitor.page.get_by_label("Reference cars").select_option("bmw-320i")
    visitor.until("ridetune.state('vehicle').name.includes('BMW')")
    visitor.click("#tab-identification")
    assert "but the sliders belong to “BMW 320i”" in visitor.element("#other-car").inner_text()
    # The fit stays, of its own car, whatever comes in meanwhile.
    visitor.click("#tab-measurements")
    add_file(visitor, "another.csv", short_run(samples=600))
    visitor.until("ridetune.state('measurements').length === 4")
    visitor.settled()
    assert visitor.element("#measurements .problem").count() == 0
    visitor.click("#tab-validation")
    assert "“compact rear-drive car”, predicts" in visitor.element("#predicts").inner_text()
    assert visitor.page.get_by_label("Hold out another.csv").count() == 1


def test_an_identification_is_cancelled(visitor):
    visitor.page.dblclick("#identify")
    visitor.element("#cancel").press("Enter")
    visitor.until("ridetune.job()?.state === 'cancelled'", 30)
    visitor.until("document.activeElement.id === 'start'")
    begun = visitor.page.evaluate(
        "async (sid) => (await fetch(`/api/sessions/${sid}/identifications`)).json()",
        visitor.look("ridetune.state('session')"),
    )
    assert len(begun) == 1, "two clicks are one press"
    assert visitor.element("#outcome").inner_text() == "Cancelled"
    assert visitor.element("#identify").is_enabled()
    assert visitor.look("ridetune.state('fit')") is None


def test_typed_bounds_hold_and_the_others_follow_the_slider(visitor):
    """Oracle: 0.05 to 8 times the start, as docs/identification.md says of the defaults."""
    visitor.click("#tab-identification")
    lower, upper = (
        visitor.page.get_by_label(f"{word} bound of Front spring stiffness")
        for word in ("Lower", "Upper")
    )
    assert (float(lower.input_value()), float(upper.input_value())) == (22 * 0.05, 22 * 8)
    lower.fill("12")
    lower.press("Tab")
    assert upper.evaluate("(field) => field === document.activeElement")
    visitor.element("#value-front-suspension-stiffness").fill("30")
    visitor.element("#value-front-suspension-stiffness").press("Enter")
    visitor.settled()
    assert (float(lower.input_value()), float(upper.input_value())) == (12, 30 * 8)
    free_only(visitor, "KF")
    visitor.click("#start")
    visitor.until("ridetune.state('fit') !== null", 120)
    [found] = visitor.look("ridetune.job().result.parameters")
    assert (found["lower"], found["upper"]) == (12e3, 240e3)

    visitor.click("#identification >> text=Set-up")
    lower.fill("")
    lower.press("Tab")
    assert float(lower.input_value()) == 30 * 0.05


def test_a_choice_keeps_focus_and_place(visitor):
    """By keyboard alone one fixes the last parameters of the list and looks at the fit."""
    visitor.page.set_viewport_size({"width": 1366, "height": 640})
    visitor.click("#tab-identification")
    last = visitor.page.get_by_label("Rear pivot angle is free")
    last.focus()
    top = visitor.element(".setup").evaluate("(box) => box.scrollTop")
    assert top > 0
    visitor.page.keyboard.press("Space")
    assert not last.is_checked()
    assert last.evaluate("(box) => box === document.activeElement")
    assert visitor.element(".setup").evaluate("(box) => box.scrollTop") == top
    visitor.page.get_by_role("button", name="Fit", exact=True).press("Enter")
    assert visitor.page.evaluate("document.activeElement.textContent") == "Fit"
