"""How recordings drive the model, chosen on the page."""

import json
from math import radians

import numpy as np
import pytest
from ridetune.engine.manoeuvre import manoeuvre_to_json, reference_manoeuvres

from .conftest import Visitor, add_file, free_only, take_car_without_brakes

pytestmark = pytest.mark.browser


def change(visitor: Visitor, label: str, text: str) -> None:
    field = visitor.page.get_by_label(label)
    field.fill(text)
    field.blur()
    visitor.settled()


def test_filters_and_initial_state_act_on_the_ride_and_on_the_fit(visitor):
    """Oracle: the line moves with each choice and comes back with it; the fit keeps them."""
    visitor.click("#tab-identification")
    visitor.click("text=How recordings drive the model: as usual")
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
    change(visitor, "High-pass of the compared channels", "0.3")
    visitor.page.select_option("#traction", "paper")
    driven = visitor.page.locator("summary", has_text="How recordings drive the model")
    driven.click()
    assert driven.inner_text() == (
        "How recordings drive the model: aₓ unfiltered; z, pitch, roll above 0.3 Hz; "
        "paper's traction"
    )
    driven.click()
    change(visitor, "High-pass of the compared channels", "")
    visitor.page.select_option("#traction", "exact")
    assert driven.inner_text() == "How recordings drive the model: aₓ unfiltered"
    free_only(visitor, "KF")
    visitor.click("#start")
    visitor.until("ridetune.state('fit') !== null", 120)
    settings = visitor.look("ridetune.job().result.settings")
    assert (settings["a_x_cutoff_hz"], settings["rim_cutoff_hz"]) == (None, 50)


def test_what_decides_a_fit_survives_a_reload(visitor):
    """Oracle: after a reload, Identify asks for the very fit that was set up before."""
    visitor.page.select_option("#ride", label="detailed_manoeuvre_2.csv")
    visitor.click("#tab-identification")
    visitor.page.get_by_label("Use of detailed_manoeuvre_1.csv").select_option("fit")
    visitor.page.get_by_label("Use of detailed_manoeuvre_2.csv").select_option("leave_out")
    change(visitor, "When detailed_manoeuvre_1.csv brakes", "none")
    for summary in ("How recordings drive", "Noise:", "Search:", "Sensors:", "Known before:"):
        visitor.page.locator("summary", has_text=summary).click()
    visitor.page.select_option("#traction", "paper")
    visitor.page.select_option("#initial-state", "measured")
    change(visitor, "High-pass of the compared channels", "0.3")
    visitor.page.get_by_role("spinbutton", name="Noise of z,").fill("0.7")
    visitor.element("#search-starts").fill("2")
    visitor.element("#search-seed").fill("5")
    visitor.page.select_option("#loss", "huber")
    visitor.page.get_by_label("Find the noise of z, pitch and roll").check()
    change(visitor, "Delay of Chassis roll, ms, or fit", "fit")
    change(visitor, "Mean of Rear damping known before", "1500")
    change(visitor, "Standard deviation of Rear damping known before", "70")
    change(visitor, "Lower bound of Front spring stiffness", "12")
    visitor.page.get_by_label("Front pivot angle is free").uncheck()

    def asked():
        with visitor.page.expect_request("**/identifications") as sent:
            visitor.click("#start")
        visitor.until("ridetune.job() !== null")
        visitor.page.evaluate("document.querySelector('#cancel')?.click()")  # unless it is done
        visitor.until("['cancelled', 'done'].includes(ridetune.job().state)")
        told = sent.value.post_data_json
        del told["key"]
        return told

    before = asked()
    first, second = (one["id"] for one in visitor.look("ridetune.state('measurements')"))
    assert before["runs"] == [first]
    assert before["settings"]["output_highpass_hz"] == 0.3
    assert before["sensors"] == {"chassis.roll": {"delay": "fit"}}
    assert before["priors"] == {"rear.suspension.damping": [1500, 70]}
    assert before["bounds"]["front.suspension.stiffness"][0] == 12e3
    assert (before["starts"], before["seed"], before["loss"]) == (2, 5, "huber")
    visitor.wait(lambda: not visitor.look("ridetune.unsaved()"), "the set-up is saved")
    visitor.page.reload()
    visitor.wait_until_drawn()
    assert visitor.look("ridetune.state('ride').id") == second
    visitor.click("#tab-identification")
    assert asked() == before


def test_braking_is_marked_run_by_run(visitor):
    """A car has no brakes, which a mark that asks for them is told."""
    take_car_without_brakes(visitor)
    visitor.expect("status of 422")
    visitor.click("#tab-identification")
    when = "When detailed_manoeuvre_1.csv brakes"
    change(visitor, when, "soon")
    field = visitor.page.get_by_label(when)
    assert "begin-end in seconds" in field.evaluate("(field) => field.validationMessage")
    assert visitor.look("ridetune.state('braking')") == {}
    visitor.click("#start")
    assert field.input_value() == "soon"
    assert visitor.look("ridetune.job()") is None
    change(visitor, when, "6.2-9.8, 12 to 14")
    visitor.wait(
        lambda: "has no brakes" in visitor.element("#chart-note").inner_text(), "it is told"
    )
    [marked] = visitor.look("Object.values(ridetune.state('braking'))")
    assert marked == [[6.2, 9.8], [12, 14]]
    change(visitor, when, "none")
    visitor.wait(lambda: not visitor.element("#chart-note").is_visible(), "it goes on")


def test_noise_is_typed_or_stated_or_the_default(visitor):
    """Oracle: units by hand; what is typed goes before what a NAME.toml states."""
    noise = {
        name: visitor.page.get_by_role("spinbutton", name=f"Noise of {name},")
        for name in ("z", "pitch", "roll")
    }
    summary = visitor.page.locator("summary", has_text="Noise")
    visitor.click("#tab-identification")
    assert summary.inner_text() == "Noise: stated"
    summary.click()
    shown = {name: field.get_attribute("placeholder") for name, field in noise.items()}
    assert shown == {"z": "0.1", "pitch": "0.005", "roll": "0.005"}

    visitor.click("#tab-measurements")
    add_file(visitor, "detailed_manoeuvre_1.toml", b"noise.chassis.z = 0.002")
    stated = "Noise as stated: z 2 mm. By default: pitch 0.02 deg, roll 0.02 deg."
    visitor.wait(
        lambda: stated in visitor.element(".measurement-detail").inner_text(), "the noise is shown"
    )
    visitor.click("#tab-identification")
    assert summary.inner_text() == "Noise: stated, default"
    assert noise["z"].get_attribute("placeholder") == "2"

    noise["roll"].fill("0.1")
    noise["roll"].press("Enter")
    noise["pitch"].fill("-3")
    noise["pitch"].press("Enter")
    assert noise["pitch"].input_value() == ""
    assert "chassis pitch stays 0.02 deg" in visitor.element(".notice.warning").inner_text()
    assert summary.inner_text() == "Noise: stated, default, typed"
    free_only(visitor, "KF")
    with visitor.page.expect_request("**/identifications") as sent:
        visitor.click("#start")
    assert sent.value.post_data_json["noise"] == {"chassis.roll": pytest.approx(radians(0.1))}
    visitor.until("ridetune.state('fit') !== null", 120)
    visitor.click("#fit-residuals")
    shown = visitor.element(".whiteness .channel .span").all_inner_texts()
    assert shown == ["2 mm, stated", "0.02 deg, default", "0.1 deg, typed"]


def test_what_was_driven_is_told_by_the_file_beside_a_recording(visitor):
    visitor.click("#tab-measurements")
    detail = visitor.element(".measurement-detail")
    assert "Driven: Manoeuvre 1" in detail.inner_text()
    detail.get_by_role("button", name="Forget").click()
    visitor.wait(lambda: "What was driven is not known" in detail.inner_text(), "it is forgotten")
    bump = json.dumps(manoeuvre_to_json(reference_manoeuvres()["bump"])).encode()
    add_file(visitor, "detailed_manoeuvre_2.manoeuvre.json", bump)
    name = reference_manoeuvres()["bump"].name
    visitor.wait(lambda: f"Driven: {name}." in detail.inner_text(), "the file is taken")
    kept = visitor.look("ridetune.state('measurements').map(({ manoeuvre }) => manoeuvre?.name)")
    assert kept == [None, name]


def test_notes_without_their_recording_are_explained(visitor):
    visitor.expect("status of 422")
    visitor.click("#tab-measurements")
    problem = visitor.element(".problem")
    for name, data, said in (
        ("lap.toml", b"noise.chassis.z = 0.002", "No recording here is called lap.csv"),
        ("detailed_manoeuvre_2.toml", b"", "states no noise of chassis.z"),
        ("lap.manoeuvre.json", b"{}", "No recording here is called lap.csv, whose manoeuvre"),
        ("detailed_manoeuvre_2.manoeuvre.json", b"{}", "name is missing"),
    ):
        add_file(visitor, name, data)
        visitor.wait(lambda: problem.is_visible() and name in problem.inner_text(), "it is refused")
        assert said in problem.inner_text()
    assert visitor.look("ridetune.state('measurements').length") == 2


def test_a_seat_s_spectra_share_an_axis_though_they_are_sampled_apart(visitor):
    """Oracle: the baseline is the same car; each line reaches over the whole axis."""
    visitor.page.get_by_role("tab", name="Seat").click()
    name = "spectrum of seat.driver.a_z"
    runs = ("measured", "reference", "now")
    visitor.wait(
        lambda: all(np.isfinite(visitor.line(name, run)).mean() > 0.9 for run in runs),
        "three spectra are drawn",
    )
    np.testing.assert_array_equal(visitor.line(name, "reference"), visitor.line(name, "now"))
