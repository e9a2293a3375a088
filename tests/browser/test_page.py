"""Tuning on the page: sliders, charts, 3D, keys, and what happens when things go away."""

import re
import signal

import numpy as np
import pytest

from .conftest import (
    AWAY,
    SAMPLES,
    Service,
    add_file,
    changed_pixels,
    take_car_without_brakes,
)

pytestmark = pytest.mark.browser

STIFFNESS = "front.suspension.stiffness"


def press(visitor, selector, *keys):
    visitor.element(selector).focus()
    for key in keys:
        visitor.page.keyboard.press(key)


def position(visitor, node):
    """Where the last pose put a node."""
    found = visitor.look(
        f"ridetune.scene.last.find((m) => m.name === '{node}' && m.position)?.position"
    )
    return np.array(found)


def seek(visitor, time):
    visitor.page.evaluate(
        """(time) => { const slider = document.querySelector("#time"); slider.value = time;
            slider.dispatchEvent(new Event("input")); }""",
        time,
    )


def test_a_slider_moves_charts_and_car(spectator):
    seek(spectator, 6.0)
    before, body = spectator.line("chassis.pitch"), position(spectator, "/car/body")
    press(spectator, "#slider-rear-suspension-stiffness", *["PageUp"] * 4)
    spectator.settled()
    assert spectator.value("rear.suspension.stiffness") == pytest.approx(28e3)
    assert np.abs(spectator.line("chassis.pitch") - before).max() > 0.01
    assert np.abs(position(spectator, "/car/body") - body).max() > 1e-5
    # The compared car stays where it was, and one press brings the slider back to it.
    np.testing.assert_array_equal(spectator.line("chassis.pitch", "reference"), before)
    spectator.click("#reset-all")
    spectator.settled()
    np.testing.assert_array_equal(spectator.line("chassis.pitch"), before)


def test_a_ride_is_never_shown_with_the_road_of_another(spectator):
    """A recording with its wheels in m instead of mm is refused and looked at in between.

    Oracle: the picture of the ride before. A road that cannot be driven leaves the car at rest.
    """
    spectator.expect("status of 422")
    wheels, rest = (SAMPLES / "detailed/manoeuvre_1.csv").read_bytes().split(b"\n", 1)
    wrong = re.sub(rb"(wheel\.\w+\.z) \[mm\]", rb"\1 [m]", wheels) + b"\n" + rest
    add_file(spectator, "in_metres.csv", wrong)
    spectator.until("ridetune.state('measurements').length === 3")
    seek(spectator, 16.0)
    before = spectator.picture()
    spectator.page.select_option("#ride", label="in_metres.csv")
    spectator.until("ridetune.state('trouble') !== null")
    spectator.settled()
    assert changed_pixels(spectator.picture(), before) > 0.1
    spectator.page.select_option("#ride", label="detailed_manoeuvre_1.csv")
    spectator.wait_until_drawn()
    spectator.settled()
    assert changed_pixels(spectator.picture(), before) < 1e-3

    spectator.page.select_option("#ride", "manoeuvre 2")
    spectator.page.select_option("#road", label="ISO 8608 class H")
    spectator.until("ridetune.state('trouble') !== null")
    height = spectator.look("ridetune.state('vehicle').chassis.cg_height")
    np.testing.assert_array_equal(position(spectator, "/car/body"), [0, 0, height])


def test_a_pivot_is_dragged_in_3d(spectator):
    """The handle's green square moves the pivot along the car and up."""
    spectator.click("[data-camera=side]")
    plain = spectator.picture().astype(int)
    spectator.click("#grips")
    picture = spectator.picture().astype(int)
    green = (picture[..., 1] > picture[..., 0] + 40) & (picture[..., 1] > picture[..., 2] + 20)
    rows, columns = np.nonzero(green & (np.abs(picture - plain).max(axis=2) > 60))
    assert rows.size > 10
    first = columns < columns.min() + 12
    box, mouse = spectator.element("#view iframe").bounding_box(), spectator.page.mouse
    x, y = box["x"] + columns[first].mean(), box["y"] + rows[first].mean()
    before = [spectator.value(f"front.pivot.{what}") for what in ("distance", "angle")]
    mouse.move(x, y)
    spectator.page.wait_for_timeout(200)
    mouse.down()
    for step in range(6):
        mouse.move(x - 6 * step, y - 3 * step)
        spectator.page.wait_for_timeout(60)
    mouse.up()
    spectator.until(f"ridetune.state('values')['front.pivot.distance'] > {before[0]} + 0.05")
    assert spectator.value("front.pivot.angle") > before[1]
    spectator.settled()


def test_playing_moves_the_picture_and_pausing_holds_it(spectator):
    spectator.page.select_option("#ride", "manoeuvre 2")
    spectator.until("ridetune.state('now') && ridetune.state('now').head.mode === 'road'")
    seek(spectator, 12.0)
    here = spectator.picture()
    seek(spectator, 12.6)
    assert changed_pixels(spectator.picture(), here) > 5e-4
    spectator.click("#play")
    spectator.until("ridetune.clock.time > 12.8")
    spectator.click("#play")
    stopped = spectator.look("ridetune.clock.time")
    spectator.page.wait_for_timeout(300)
    assert spectator.look("ridetune.clock.time") == stopped


def test_charts_zoom_together_and_show_all_again(visitor):
    box = visitor.element(".chart .u-over").first.bounding_box()
    mouse, middle = visitor.page.mouse, box["y"] + box["height"] / 2
    mouse.move(box["x"] + 0.5 * box["width"], middle)
    mouse.down()
    mouse.move(box["x"] + 0.75 * box["width"], middle, steps=5)
    mouse.up()
    visitor.until("ridetune.zoomed() !== null")
    low, high = visitor.look("ridetune.zoomed()")
    assert low == pytest.approx(10.0, abs=0.3)
    assert high == pytest.approx(15.0, abs=0.3)
    press(visitor, f"#slider-{STIFFNESS.replace('.', '-')}", "ArrowRight")
    visitor.settled()
    assert visitor.look("ridetune.zoomed()") == [low, high]
    mouse.click(box["x"] + 0.5 * box["width"], middle)
    assert visitor.look("ridetune.clock.time") == pytest.approx(12.5, abs=0.2)
    mouse.dblclick(box["x"] + 0.3 * box["width"], middle)
    visitor.until("ridetune.zoomed() === null")


def test_a_manoeuvre_on_another_road_has_tyre_loads_and_numbers(visitor):
    visitor.page.select_option("#ride", "manoeuvre constant-speed-c")
    visitor.click("#charts-tyre")
    visitor.settled()
    rough = visitor.line("tyre.fl.load")
    assert np.isfinite(rough).all()
    visitor.page.select_option("#road", label="ISO 8608 class A")
    visitor.settled()
    smooth = visitor.line("tyre.fl.load")
    assert smooth.std() < 0.5 * rough.std()
    assert "Baseline" in visitor.element(".metrics").inner_text()


def test_the_simulated_ride_is_saved_as_a_measurement_file(visitor):
    with visitor.page.expect_download() as saved:
        visitor.click("#save-run")
    lines = saved.value.path().read_text().splitlines()
    assert lines[0].startswith("time [s],chassis.z [m]")
    assert len(lines) == 1 + 4001


def test_a_tyre_that_pulls_is_told_and_may_lift_off(visitor):
    visitor.page.select_option("#ride", "manoeuvre constant-speed-c")
    visitor.page.select_option("#road", label="ISO 8608 class F")
    visitor.settled()
    assert "A tyre pulls on the road" in visitor.element("#comfort").inner_text()
    visitor.click("#lift-off")
    visitor.settled()
    visitor.click("#charts-tyre")
    visitor.settled()
    assert visitor.line("tyre.fl.load").min() == 0.0


def test_the_seven_dof_model_shows_what_the_arms_add(visitor):
    """Without trailing arms and longitudinal coupling the car does not squat."""
    visitor.page.select_option("#ride", "manoeuvre 2")
    visitor.page.select_option("#compare", "7dof")
    visitor.settled()
    squat = slice(700, 1000)
    assert visitor.line("chassis.pitch")[squat].mean() < -0.3
    assert abs(visitor.line("chassis.pitch", "reference")[squat].mean()) < 0.1


def test_keys_play_scrub_and_leave_fields_alone(spectator):
    keyboard = spectator.page.keyboard
    spectator.element("body").press("ArrowRight")
    assert spectator.look("ridetune.clock.time") == pytest.approx(0.1)
    keyboard.press("Shift+ArrowRight")
    assert spectator.look("ridetune.clock.time") == pytest.approx(1.1)
    keyboard.press("End")
    assert spectator.look("ridetune.clock.time") == pytest.approx(20.0, abs=0.01)
    keyboard.press("Home")
    keyboard.press("Space")
    spectator.until("ridetune.clock.playing && ridetune.clock.time > 0")
    keyboard.press("Space")
    assert not spectator.look("ridetune.clock.playing")
    # A slider's arrows are its own, a field's keys too.
    time = spectator.look("ridetune.clock.time")
    before = spectator.value(STIFFNESS)
    press(spectator, "#slider-front-suspension-stiffness", "ArrowRight")
    assert spectator.value(STIFFNESS) == pytest.approx(before + 100.0)
    press(spectator, "#value-front-suspension-stiffness", "ArrowLeft", "Home")
    assert spectator.look("ridetune.clock.time") == time
    # The 3D view hands the keys on.
    spectator.element("#view iframe").click(position={"x": 200, "y": 100})
    keyboard.press("Space")
    spectator.until("ridetune.clock.playing")
    spectator.settled()


def test_every_control_is_reached_by_tab_and_has_a_name(visitor):
    keyboard, seen = visitor.page.keyboard, []
    visitor.element("body").press("Tab")
    for _ in range(60):
        seen.append(visitor.page.evaluate("document.activeElement.id"))
        keyboard.press("Tab")
    for control in ("ride", "compare", "identify", "help", f"slider-{STIFFNESS.replace('.', '-')}"):
        assert control in seen
    assert seen.index("ride") < seen.index("slider-front-suspension-stiffness")
    nameless = visitor.page.evaluate(
        """() => [...document.querySelectorAll("button, select, input, iframe")].filter((e) =>
            !(e.labels?.length || e.getAttribute("aria-label") || e.title || e.textContent.trim()))
            .map((e) => e.outerHTML)"""
    )
    assert nameless == []


def test_tabs_and_help_work_by_keyboard(visitor):
    press(visitor, "#tab-comfort", "ArrowRight")
    assert visitor.element("#measurements").is_visible()
    assert not visitor.element("#comfort").is_visible()
    visitor.page.keyboard.press("ArrowRight")
    assert visitor.element("#identification").is_visible()
    press(visitor, "#help", "Enter")
    assert visitor.element("#help-dialog").is_visible()
    visitor.page.keyboard.press("Escape")
    assert not visitor.element("#help-dialog").is_visible()


def test_the_page_is_whole_from_800_to_1920_pixels(visitor):
    """No sideways scrolling; tabs and legend of the charts in one row where there are columns."""
    for width in (800, 1000, 1440, 1920):
        visitor.page.set_viewport_size({"width": width, "height": 800})
        visitor.page.wait_for_timeout(100)
        assert visitor.page.evaluate("document.documentElement.scrollWidth") == width
        main = visitor.page.evaluate(
            "(({ scrollWidth: w, clientWidth: c }) => [w, c])(document.querySelector('main'))"
        )
        assert main[0] == main[1]
        if width >= 1440:
            assert visitor.element("#chart-tabs").bounding_box()["height"] < 40


def test_two_browsers_do_not_see_each_other(visit, service):
    one, other = visit().open(service.address), visit().open(service.address)
    press(one, "#slider-front-suspension-stiffness", "PageUp")
    one.settled()
    one.wait(lambda: not one.look("ridetune.unsaved()"), "the slider is saved")
    assert one.look("ridetune.state('session')") != other.look("ridetune.state('session')")
    other.page.reload()
    other.wait_until_drawn()
    assert other.value(STIFFNESS) == 22e3
    other.expect("status of 404")
    reply = other.page.goto(one.page.url)
    assert reply.status == 404
    assert other.element("a[href='/']").is_visible()


def test_another_car_changes_sliders_and_scene(spectator):
    spectator.click("#tab-car")
    before = spectator.picture()
    spectator.page.get_by_label("Reference cars").select_option("vw-vanagon")
    spectator.until("ridetune.state('vehicle').name.includes('Vanagon')")
    spectator.settled()
    assert changed_pixels(spectator.picture(), before) > 5e-3
    track = spectator.look("ridetune.state('vehicle').front.track")
    assert position(spectator, "/car/wheel_fl")[1] == pytest.approx(track / 2, abs=0.02)


def test_brakes_and_drive_are_chosen_on_the_page(visitor):
    """A car comes without brakes and with its rear axle driven; a car must be driven."""
    take_car_without_brakes(visitor)
    visitor.click("#tab-car")
    visitor.page.get_by_role("button", name="Add brakes").click()
    visitor.until("ridetune.state('vehicle').brakes?.front_share === 0.65")
    visitor.page.locator("[title='brakes.reaction'] select").select_option("chassis")
    visitor.until("ridetune.state('vehicle').brakes.reaction === 'chassis'")
    visitor.page.locator("[title='front.driven'] select").select_option("yes")
    visitor.until("ridetune.state('vehicle').front.driven")
    visitor.page.reload()
    visitor.wait_until_drawn()
    assert visitor.look("ridetune.state('vehicle').front.driven")
    assert visitor.look("ridetune.state('baseline').brakes.reaction") == "chassis"

    visitor.expect("status of 422")
    visitor.click("#tab-car")
    for axle in ("front", "rear"):
        visitor.page.locator(f"[title='{axle}.driven'] select").select_option("no")
    visitor.wait(lambda: visitor.element(".notice.error").is_visible(), "the refusal is shown")
    rear = visitor.page.locator("[title='rear.driven'] select")
    assert rear.input_value() == "yes"


def test_an_impossible_car_is_refused_in_words(visitor):
    visitor.expect("status of 422")
    visitor.click("#tab-car")
    field = visitor.element("[title='chassis.mass'] input")
    field.fill("-3")
    field.press("Enter")
    visitor.wait(lambda: visitor.element(".notice.error").is_visible(), "the refusal is shown")
    assert "chassis mass is -3, but must lie" in visitor.element(".notice.error").inner_text()
    assert field.input_value() == "1053.16"


def test_the_page_waits_while_the_service_compiles(visit, service):
    visitor, asked = visit(), []
    visitor.expect("status of 503")

    def compiling(route):
        asked.append(route)
        if len(asked) < 3:
            body = '{"state": "compiling", "message": "Compiling the simulation."}'
            route.fulfill(status=503, content_type="application/json", body=body)
        else:
            route.continue_()

    visitor.page.route("**/readyz", compiling)
    visitor.page.goto(f"{service.address}?fixedDpr=0.4")
    banner = visitor.element("#banner")
    visitor.wait(banner.is_visible, "the page says that it compiles")
    assert "Compiling" in banner.inner_text()
    visitor.wait_until_drawn()
    assert not banner.is_visible()


def test_the_3d_view_comes_back_after_a_lost_connection(spectator):
    seek(spectator, 8.0)
    before = spectator.picture()
    spectator.scene_frame().evaluate("() => window.bridge.retry()")
    spectator.until("ridetune.scene.connections === 2 && ridetune.scene.built")
    assert changed_pixels(spectator.picture(), before) < 1e-3


@pytest.mark.slow
def test_the_page_goes_on_when_the_service_has_been_away(visit, tmp_path):
    service = Service(tmp_path / "data")
    try:
        visitor = visit(in_3d=True).open(service.address)
        visitor.expect(*AWAY)
        service.stop(signal.SIGKILL)
        press(visitor, "#slider-front-suspension-stiffness", "PageUp")
        visitor.wait(visitor.element("#banner").is_visible, "the page says that it is alone")
        service = Service(tmp_path / "data", service.port)
        visitor.wait(lambda: not visitor.element("#banner").is_visible(), "the page goes on")
        visitor.wait_until_drawn()
        visitor.settled()
        visitor.wait(lambda: not visitor.look("ridetune.unsaved()"), "the slider is saved")
        kept = visitor.page.evaluate(
            "async (sid) => (await fetch(`/api/sessions/${sid}`)).json()",
            visitor.look("ridetune.state('session')"),
        )
        assert kept["vehicle"]["front"]["suspension"]["stiffness"] == pytest.approx(23e3)
    finally:
        service.stop()


def test_the_car_compared_with_is_never_another_than_the_legend_says(visitor):
    """On this road the 8-DOF car fails and the 7-DOF car does not."""
    visitor.expect("status of 422")
    visitor.page.select_option("#ride", "manoeuvre 2")
    visitor.page.select_option("#compare", "7dof")
    visitor.page.select_option("#road", label="ISO 8608 class H")
    visitor.settled()
    assert visitor.look("ridetune.state('reference')") is not None
    visitor.page.select_option("#compare", "baseline")
    visitor.settled()
    assert visitor.look("ridetune.state('reference')") is None
    charts = visitor.element("#chart-area").inner_text()
    assert "Not simulated." in charts
    assert not re.search(r"\d", charts)


def test_a_reload_comes_back_to_the_open_tab(visitor):
    """A fit that is under way is followed where it was looked at; a new window begins anew."""
    visitor.click("#tab-identification")
    visitor.page.reload()
    visitor.wait_until_drawn()
    assert visitor.element("#identification").is_visible()
    assert visitor.element("#tab-identification").get_attribute("aria-selected") == "true"
    other = visitor.page.context.new_page()
    other.goto(visitor.page.url)
    assert not other.locator("#identification").is_visible()


@pytest.mark.parametrize("lost", ["the events of a job", "the 3D view"])
def test_the_page_says_at_once_that_the_service_is_away_and_when_it_is_back(visit, tmp_path, lost):
    """Nobody has to move a slider; oracle: the service is killed, then started again."""
    service = Service(tmp_path / "data")
    try:
        visitor = visit(in_3d=lost == "the 3D view").open(service.address)
        visitor.expect(*AWAY)
        if not visitor.in_3d:
            visitor.click("#identify")
            visitor.until("ridetune.job() !== null")
        visitor.settled()
        service.stop(signal.SIGKILL)
        banner = visitor.element("#banner")
        visitor.wait(banner.is_visible, "the page says that it is alone", 8)
        assert "does not answer" in banner.inner_text()
        service = Service(tmp_path / "data", service.port)
        visitor.wait(lambda: not banner.is_visible(), "the page goes on")
    finally:
        service.stop()
