"""From a measured ride to an identified car, on the page."""

import json

import numpy as np
import pytest
from ridetune.engine.parameters import ALL_NAMES, PARAMETER_NAMES
from ridetune.engine.vehicle_file import vehicle_to_json

from ..factories import paper_vehicle
from .conftest import SAMPLES, add_file, short_run

pytestmark = pytest.mark.browser


def free_only(visitor, *symbols):
    """Leave these parameters free and fix the others."""
    visitor.click("#identification >> text=Set-up")
    for row in visitor.element(".free tbody tr").all():
        symbol = row.locator(".symbol").inner_text().replace("\n", "")
        if symbol not in symbols:
            row.locator("input[type=checkbox]").uncheck()


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
    begun = visitor.page.evaluate(
        "async (sid) => (await fetch(`/api/sessions/${sid}/identifications`)).json()",
        visitor.look("ridetune.state('session')"),
    )
    assert len(begun) == 1, "two clicks are one press"
    assert visitor.page.evaluate("document.activeElement.id") == "start"
    assert visitor.element("#outcome").inner_text() == "Cancelled"
    assert visitor.element("#identify").is_enabled()
    assert visitor.look("ridetune.state('fit')") is None


def test_a_file_that_is_no_measurement_is_explained_and_nothing_is_lost(visitor):
    visitor.expect("status of 422")
    visitor.click("#tab-measurements")
    add_file(visitor, "picture.csv", bytes(range(256)) * 40)
    visitor.wait(lambda: visitor.element(".problem").is_visible(), "the refusal is shown")
    text = visitor.element(".problem").inner_text()
    assert "picture.csv" in text
    assert "export the recording as CSV" in text
    assert visitor.look("ridetune.state('measurements').length") == 2


def test_a_dropped_file_is_taken_anywhere_on_the_page(visitor):
    visitor.page.evaluate(
        """(text) => {
            const data = new DataTransfer();
            data.items.add(new File([text], "dropped.csv", { type: "text/csv" }));
            const target = document.querySelector("#charts");
            for (const kind of ["dragenter", "dragover", "drop"]) {
                const event = new DragEvent(kind, { dataTransfer: data, bubbles: true,
                    cancelable: true });
                target.dispatchEvent(event);
            }
        }""",
        short_run(60).decode(),
    )
    visitor.until("ridetune.state('measurements').some(({ name }) => name === 'dropped.csv')")
    assert visitor.element("#measurements").is_visible()


def test_without_a_measurement_the_page_says_what_to_do(visitor):
    visitor.click("#tab-measurements")
    for left in (1, 0):
        visitor.click(".measurement-detail button.danger")
        visitor.click(".measurement-detail button.danger")
        visitor.until(f"ridetune.state('measurements').length === {left}")
        where = visitor.page.evaluate(
            "document.activeElement.closest('.measurement-list') !== null"
        )
        assert where, "the focus stays with the list"
    assert "Add a recording: CSV" in visitor.element("#measurements").inner_text()
    visitor.until("ridetune.state('ride').kind === 'manoeuvre' && ridetune.state('now') !== null")
    visitor.click("#identify")
    assert "at least one measured run" in visitor.element("#notices").inner_text()


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


def test_files_of_one_name_are_told_apart(visitor):
    visitor.click("#tab-measurements")
    add_file(visitor, "detailed_manoeuvre_1.csv", short_run())
    visitor.until("ridetune.state('measurements').length === 3")
    rides = visitor.element("#ride optgroup >> nth=0").locator("option").all_inner_texts()
    assert rides == [
        "detailed_manoeuvre_1.csv",
        "detailed_manoeuvre_2.csv",
        "detailed_manoeuvre_1.csv (2)",
    ]
    visitor.click("#tab-identification")
    for name in rides:
        use = visitor.page.get_by_label(f"Use of {name}", exact=True)
        use.select_option("hold_out" if name == rides[1] else "fit")
    free_only(visitor, "KF")
    visitor.click("#start")
    visitor.until("ridetune.state('fit') !== null", 120)
    fits = visitor.look("ridetune.job().result.fit_percent")
    rows = visitor.element(".scores tbody").all_inner_texts()
    for name, row in zip((rides[0], rides[2]), rows, strict=False):
        assert name.replace(".csv", "") in row.replace("\n", "")
        assert f"{fits[name]['chassis.z']:.1f}" in row.replace("−", "-")


def test_the_same_data_is_kept_once_and_never_scored_as_unseen(visitor):
    """The second copy comes by REST, which keeps what it is sent."""
    visitor.click("#tab-measurements")
    data = (SAMPLES / "detailed/manoeuvre_1.csv").read_bytes()
    add_file(visitor, "monday.csv", data)
    notice = visitor.element(".notice")
    visitor.wait(notice.is_visible, "it is told")
    assert "monday.csv is already here" in notice.inner_text()
    assert "the same data as detailed_manoeuvre_1.csv" in notice.inner_text()
    assert visitor.look("ridetune.state('measurements').length") == 2

    visitor.page.evaluate(
        """async ([sid, text]) => fetch(`/api/sessions/${sid}/measurements?name=copy.csv`,
            { method: "POST", headers: { "Content-Type": "text/csv" }, body: text })""",
        [visitor.look("ridetune.state('session')"), data.decode()],
    )
    visitor.page.reload()
    visitor.wait_until_drawn()
    visitor.click("#tab-identification")
    assert "the same data as detailed_manoeuvre_1.csv" in visitor.element(".runs").inner_text()
    use = visitor.page.get_by_label("Use of copy.csv")
    assert use.input_value() == "leave_out"
    use.select_option("hold_out")
    free_only(visitor, "KF")
    visitor.click("#start")
    visitor.until("ridetune.state('fit') !== null", 120)
    scored = visitor.element(".held-out").all_inner_texts()
    assert len(scored) == 1
    assert "detailed_manoeuvre_2" in scored[0].replace("\n", "")


def test_the_same_drive_written_otherwise_is_told_and_left_out(visitor):
    visitor.click("#tab-measurements")
    data = (SAMPLES / "detailed/manoeuvre_1.csv").read_bytes()
    add_file(visitor, "windows.csv", data.replace(b"\n", b"\r\n"))
    notice = visitor.element(".notice")
    visitor.wait(notice.is_visible, "it is told")
    assert "windows.csv is in" in notice.inner_text()
    assert "the same data as detailed_manoeuvre_1.csv" in notice.inner_text()
    assert visitor.look("ridetune.state('measurements').length") == 3
    visitor.click("#tab-identification")
    use = visitor.page.get_by_label("Use of windows.csv")
    assert use.input_value() == "leave_out"
    runs = visitor.element(".runs")
    assert "counts twice" not in runs.inner_text()
    use.focus()
    use.select_option("fit")
    assert "which so counts twice" in runs.inner_text()
    assert use.evaluate("(field) => field === document.activeElement")


def test_a_copy_that_lacks_a_channel_leads_to_its_next_stage(visitor):
    """Twice the same drive without its wheels, written otherwise."""
    visitor.click("#tab-measurements")
    lines = short_run().split(b"\n")
    lacking = b"\n".join(b",".join(line.split(b",")[:3]) for line in lines if line) + b"\n"
    add_file(visitor, "lacking.csv", lacking)
    visitor.until("ridetune.state('measurements').length === 3")
    add_file(visitor, "again.csv", lacking.replace(b"\n", b"\r\n"))
    notice = visitor.page.locator(".notice", has_text="again.csv is in")
    visitor.wait(notice.is_visible, "it is told")
    assert "the same data as lacking.csv" in notice.inner_text()
    assert "It lacks" in notice.inner_text()
    notice.get_by_role("button", name="Condition").click()
    visitor.wait(visitor.element("#intake").is_visible, "the next stage is open")
    assert "again.csv" in visitor.element("#intake-title").inner_text()


def test_the_same_file_under_another_mapping_is_other_data(visitor):
    """The copy keeps the bytes, and the mapping of the first is turned over before it comes."""
    session = visitor.look("ridetune.state('session')")
    first = visitor.look("ridetune.state('measurements')[0].id")
    path = f"/api/sessions/{session}/measurements/{first}"
    visitor.page.evaluate(
        """async (path) => {
            const { proposed } = await (await fetch(`${path}/columns`)).json();
            const turned = proposed.columns.find(({ channel }) => channel === "chassis.pitch");
            turned.sign = -1;
            await fetch(`${path}/mapping`, { method: "PUT", body: JSON.stringify(proposed),
                headers: { "Content-Type": "application/json" } });
        }""",
        path,
    )
    visitor.page.reload()
    visitor.wait_until_drawn()
    visitor.click("#tab-measurements")
    add_file(visitor, "upright.csv", (SAMPLES / "detailed/manoeuvre_1.csv").read_bytes())
    visitor.until("ridetune.state('measurements').length === 3")
    visitor.click("#tab-identification")
    assert "the same data" not in visitor.element(".runs").inner_text()
    assert visitor.page.get_by_label("Use of upright.csv").input_value() == "hold_out"


def test_an_upload_with_warnings_leads_to_them(visitor):
    """Millimetres taken for metres: the file has all channels, and three doubts about them."""
    visitor.click("#tab-measurements")
    header, rest = short_run().split(b"\n", 1)
    wrong = header.replace(b"[mm]", b"[m]", 3)
    add_file(visitor, "doubtful.csv", wrong + b"\n" + rest)
    notice = visitor.element(".notice.warning")
    visitor.wait(notice.is_visible, "it is told")
    assert "ready" not in notice.inner_text()
    visitor.click("#tab-car")
    notice.get_by_role("button", name="See 3 warnings").click()
    warnings = visitor.element("#measurements .warnings")
    assert warnings.evaluate("(list) => list === document.activeElement")
    assert warnings.locator("li").count() == 3
    box = warnings.bounding_box()
    assert box["y"] + box["height"] <= 768


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


def test_a_known_number_keeps_the_hand_in_its_field(visitor):
    visitor.click("#tab-car")
    mass, next_one = visitor.element("[title='chassis.mass'] input"), ".known input >> nth=1"
    mass.fill("1100")
    mass.press("Tab")
    visitor.until("ridetune.state('vehicle').chassis.mass === 1100")
    visitor.settled()
    assert visitor.element(next_one).evaluate("(field) => field === document.activeElement")
    # An empty field is no zero.
    mass.fill("")
    mass.press("Tab")
    assert mass.input_value() == "1100"


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
