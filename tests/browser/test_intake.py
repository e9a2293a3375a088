"""From a file of another house to a run that can be fitted, as a visitor of the page does it."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from ridetune.engine.measurement import read_run, run_to_csv
from ridetune.engine.run import Run

from ..factories import paper_vehicle
from ..files_of_kinds import mdf, parquet, tdms
from ..raw_sensors import drive, recorded
from .conftest import SAMPLES, add_file

pytestmark = pytest.mark.browser

NATIVE = SAMPLES / "twin/manoeuvre_2.csv"
DEGREES = 180.0 / np.pi
TITLES = {
    "time": ("Zeit [ms]", 1e3),
    "chassis.z": ("Aufbauhub [mm]", 1e3),
    "chassis.pitch": ("Nickwinkel [deg]", -DEGREES),
    "chassis.a_x": ("Laengsbeschleunigung [m/s^2]", 1.0),
    **{
        f"wheel.{corner}.z": (f"Radweg {word} [{unit}]", factor)
        for corner, word, unit, factor in (
            ("fl", "VL", "m", 1e3),
            ("fr", "VR", "mm", 1e3),
            ("rl", "HL", "mm", 1e3),
            ("rr", "HR", "mm", 1e3),
        )
    },
}
"""By channel another title, and what its numbers are multiplied by: the first wheel's unit lies,
pitch is turned over.
"""


def foreign(step=10):
    """The sample run as a German test bench writes it, with decimal commas and an oil pressure."""
    run = read_run(NATIVE)
    columns = [(run.time if name == "time" else run[name]) * f for name, (_, f) in TITLES.items()]
    columns.append(np.full_like(columns[0], 3.0))
    rows = np.transpose(columns)[::step]
    titles = ";".join([*(title for title, _ in TITLES.values()), "Öldruck [bar]"])
    lines = [";".join(f"{x:.9f}".replace(".", ",") for x in row) for row in rows]
    return "\n".join([titles, *lines]).encode()


def newest(visitor):
    return visitor.look("ridetune.state('measurements').at(-1)")


def said(visitor):
    return visitor.element(".intake-said").inner_text()


def add(visitor, name, data):
    """Add a file and wait until it is there."""
    count = visitor.look("ridetune.state('measurements').length")
    add_file(visitor, name, data)
    visitor.until(f"ridetune.state('measurements').length === {count + 1}")


def open_next(visitor, view):
    """Go on by the button of the next stage."""
    visitor.click("#next-stage")
    visitor.wait(visitor.element(view).is_visible, f"{view} is open")


def test_a_foreign_csv_is_mapped_corrected_flipped_and_its_mapping_kept(visitor):
    """Oracle: the native run under the same car; its pitch and wheels are what the file holds."""
    page = visitor.page
    visitor.click("#tab-measurements")
    add(visitor, "fahrt.csv", foreign())
    assert "needs mapping" in visitor.element(".pick").inner_text()
    open_next(visitor, ".mapping-table")
    row = page.locator(".mapping-table tr", has_text="Radweg VL")
    assert "unit doubted" in row.inner_text()
    assert page.get_by_label("Channel of Radweg VL").input_value() == "wheel.fl.z"
    unit = page.get_by_label("Unit of Radweg VL")
    assert unit.input_value() == "mm"
    # What a person says is taken, and told as theirs; the preview's axis follows.
    unit.fill("cm")
    unit.press("Tab")
    assert page.evaluate("document.activeElement.ariaLabel") == "Turn Radweg VL over"
    assert "set by hand" in row.inner_text()
    unit.fill("mm")
    # A channel is not taken away from another column in passing.
    spare = page.get_by_label("Channel of Öldruck")
    spare.focus()
    spare.select_option("chassis.z")
    assert "Aufbauhub is chassis.z, too" in said(visitor)
    assert page.locator(".doubted", has_text="taken twice").count() == 2
    spare.select_option("")
    assert page.locator(".doubted", has_text="taken twice").count() == 0

    visitor.click("#apply-mapping")
    keep = page.get_by_role("button", name="Keep chassis.pitch")
    visitor.wait(keep.is_visible, "the sign is offered")
    # One that is kept is done with; turning it by hand asks about it anew.
    keep.click()
    visitor.until("ridetune.state('measurements').at(-1).sign_suggestions.length === 0")
    assert page.evaluate("document.activeElement.id") == "apply-mapping"
    assert "confirmed" in page.get_by_label("Turn Nickwinkel over").get_attribute("title")
    for _ in range(2):
        page.get_by_label("Turn Nickwinkel over").click()
    visitor.click("#apply-mapping")
    flip = page.get_by_role("button", name="Flip chassis.pitch")
    visitor.wait(flip.is_visible, "the sign is offered again")
    page.keyboard.press("Escape")
    # It is still there when the stage is opened once more.
    assert page.locator("#next-stage").inner_text() == "Check signs"
    page.click("#next-stage")
    flip.click()
    visitor.until("ridetune.state('measurements').at(-1).sign_suggestions.length === 0")
    kept = newest(visitor)
    assert kept["usable_for_identification"]
    run = read_run(NATIVE)
    found = {one["name"]: (one["minimum"], one["maximum"]) for one in kept["channels"]}
    for name in ("chassis.pitch", "wheel.fl.z"):
        values = run[name][::10]
        assert found[name] == pytest.approx((values.min(), values.max()), abs=1e-6)

    with page.expect_download() as saved:
        page.locator("#intake").get_by_text("Download mapping").click()
    assert saved.value.suggested_filename == "fahrt-mapping.json"
    assert json.loads(Path(saved.value.path()).read_text()) == kept["mapping"]

    page.fill("#template-name", "test bench 7")
    visitor.click("#save-template")
    visitor.wait(lambda: "Kept as test bench 7" in said(visitor), "the mapping is kept")
    visitor.click("#intake-ride")
    visitor.until(f"ridetune.state('ride').id === '{kept['id']}'")

    add(visitor, "fahrt 2.csv", foreign(9))
    open_next(visitor, ".mapping-table")
    assert "proposed: test bench 7" in page.locator("#template").inner_text()
    visitor.click("#apply-mapping")
    visitor.until("ridetune.state('measurements').at(-1).usable_for_identification")
    assert newest(visitor)["sign_suggestions"] == []
    visitor.click("text=Forget mapping")
    visitor.until("ridetune.state('measurements').at(-1).needs_mapping")
    visitor.wait(lambda: "names of its columns again" in said(visitor), "it is told")
    # What is not applied is given up only when asked twice.
    page.get_by_label("Turn Nickwinkel over").click()
    page.keyboard.press("Escape")
    assert "not applied" in said(visitor)
    page.keyboard.press("Escape")
    assert not visitor.element("#intake").is_visible()
    visitor.settled()


def test_a_column_without_a_unit_takes_it_from_its_numbers_when_chosen_by_hand(visitor):
    """Oracle: the wheel's heights, which the file holds in m; in mm it would hardly move."""
    page = visitor.page
    visitor.click("#tab-measurements")
    run = read_run(NATIVE)
    in_m = foreign().decode().replace("Radweg VL [m]", "Kanal 7")
    head, *lines = in_m.split("\n")
    place = head.split(";").index("Kanal 7")
    rows = [line.split(";") for line in lines]
    for row, value in zip(rows, run["wheel.fl.z"][::10], strict=True):
        row[place] = f"{value:.9f}".replace(".", ",")
    add(visitor, "kanal.csv", "\n".join([head, *map(";".join, rows)]).encode())
    open_next(visitor, ".mapping-table")
    page.get_by_label("Channel of Kanal 7").focus()
    page.get_by_label("Channel of Kanal 7").select_option("wheel.fl.z")
    row = page.locator(".mapping-table tr", has_text="Kanal 7")
    visitor.wait(lambda: "unit guessed" in row.inner_text(), "the service has told the unit")
    assert page.get_by_label("Unit of Kanal 7").input_value() == "m"
    assert "by hand" in row.inner_text()
    # In the wrong one its doubt is in sight, not folded away.
    page.get_by_label("Unit of Kanal 7").fill("mm")
    page.get_by_label("Unit of Kanal 7").press("Tab")
    visitor.click("#apply-mapping")
    doubt = page.locator(".mapping-head .warnings li", has_text="wheel.fl.z stays within")
    visitor.wait(doubt.is_visible, "the doubt is told")
    assert "is it in m?" in doubt.inner_text()
    visitor.settled()


def test_the_signs_of_a_file_with_our_names_are_looked_at_when_it_is_added(visitor):
    """Oracle: the sample with its pitch turned over, and what it is turned back to."""
    page, run = visitor.page, read_run(NATIVE)
    over = {name: (-1 if name == "chassis.pitch" else 1) * run[name][::10] for name in run.columns}
    visitor.click("#tab-measurements")
    add(visitor, "lap.csv", run_to_csv(Run("lap", run.time[::10], over)).encode())
    told = page.locator(".notice", has_text="lap.csv is in")
    assert "1 sign may be turned over" in told.inner_text()
    assert "check 1 sign" in visitor.element(".pick").inner_text()
    told.get_by_role("button", name="Check signs").click()
    flip = page.get_by_role("button", name="Flip chassis.pitch")
    visitor.wait(flip.is_visible, "the sign is offered")
    flip.click()
    visitor.until("ridetune.state('measurements').at(-1).sign_suggestions.length === 0")
    found = {one["name"]: one["maximum"] for one in newest(visitor)["channels"]}
    expected = run["chassis.pitch"][::10].max()
    assert found["chassis.pitch"] == pytest.approx(expected, rel=1e-9)
    visitor.settled()


def test_binary_files_are_read_and_damaged_ones_refused_in_a_sentence(visitor, tmp_path):
    visitor.expect("status of 422")
    visitor.click("#tab-measurements")
    for name, write in (("r.mf4", mdf), ("r.tdms", tdms), ("r.parquet", parquet)):
        write(tmp_path / name)
        add(visitor, name, (tmp_path / name).read_bytes())
        assert newest(visitor)["samples"] == 50
    add_file(visitor, "cut.mf4", (tmp_path / "r.mf4").read_bytes()[:700])
    problem = visitor.element(".problem")
    visitor.wait(problem.is_visible, "it is refused")
    assert "cut.mf4: the file cannot be read as MDF4" in problem.inner_text()


ELSEWHERE = {
    "geometry.json": (None, "the geometry of the pivots; type it under Validation"),
    "truth.json": (None, "the truth of a campaign"),
    "sensors.toml": (None, "the sensors of a campaign; choose it under Measurements"),
    "steps.json": (b'[{"kind": "rest"}]', "steps of conditioning; choose them under"),
    "drive.json": (b'{"kind": "road", "duration": 3}', "call it NAME.manoeuvre.json"),
    "other.json": (b'{"a": 1}', "JSON of another program"),
    "broken.json": (b"{", "It is not JSON"),
}
"""By name what a file holds (None: the sample's), and where the page says that it belongs."""


def test_files_that_belong_elsewhere_are_told_where(visitor):
    visitor.click("#tab-measurements")
    problem = visitor.element(".problem")
    for name, (data, told) in ELSEWHERE.items():
        add_file(visitor, name, data or (SAMPLES / "detailed" / name).read_bytes())
        visitor.wait(
            lambda name=name: problem.count() and name in problem.inner_text(), "it is refused"
        )
        assert told in problem.inner_text()
    assert visitor.look("ridetune.state('measurements').length") == 2


def test_a_raw_recording_is_conditioned_until_it_can_be_fitted(visitor):
    """Oracle: the list of what a fit needs; the simulation then runs on what the steps made."""
    car, page = paper_vehicle(), visitor.page
    raw = recorded(car, drive(car, sample_step=0.005), seed=2)
    visitor.click("#tab-measurements")
    add(visitor, "raw.csv", run_to_csv(raw).encode())
    assert not newest(visitor)["usable_for_identification"]
    open_next(visitor, ".conditioning")
    steps = page.locator(".step")
    count = steps.count()
    assert "Why: the car stands from" in steps.first.inner_text()
    # A step that is taken out is put back with the suggestion.
    page.get_by_label("Remove: Count from rest, step 1").click()
    assert steps.count() == count - 1
    visitor.click("#take-suggestion")
    assert steps.count() == count
    visitor.click("#apply-steps")
    visitor.until("ridetune.state('measurements').at(-1).usable_for_identification")
    visitor.wait(lambda: "took off" in steps.first.inner_text(), "what was done is told")
    made = page.locator("#conditioned-channel")
    assert made.input_value() == "chassis.z"
    with page.expect_download() as saved:
        page.locator("#intake").get_by_text("Download CSV").click()
    assert saved.value.suggested_filename == "raw-run.csv"
    titles = Path(saved.value.path()).read_text().partition("\n")[0]
    assert "chassis.z [m]" in titles
    visitor.click("#use-highpass")
    assert visitor.look("ridetune.state('rimsSettings').output_highpass_hz") == pytest.approx(0.6)
    visitor.click("#intake-ride")
    visitor.until("ridetune.state('now')?.head.mode === 'rims' && ridetune.idle()")

    page.get_by_role("button", name="Conditioning", exact=True).first.click()
    visitor.wait(visitor.element("#as-recorded").is_visible, "the steps are shown")
    visitor.click("#as-recorded")
    visitor.until("!ridetune.state('measurements').at(-1).usable_for_identification")
    assert newest(visitor)["conditioning"] is None
    visitor.settled()


def test_a_late_speed_is_told_and_its_delay_found_by_a_step_that_is_put_where_it_belongs(visitor):
    """Oracle: the speed is made 0.35 s late; what the step finds is some ms short."""
    car, page = paper_vehicle(), visitor.page
    raw = recorded(car, drive(car, sample_step=0.005), seed=2, delay=0.35)
    visitor.click("#tab-measurements")
    add(visitor, "late.csv", run_to_csv(raw).encode())
    open_next(visitor, ".conditioning")
    steps = page.locator(".step")
    first = steps.first
    assert "Why: without it chassis.pitch changes by" in first.inner_text()
    page.get_by_label("Remove: Take off a delay, step 1").click()
    visitor.click("#apply-steps")
    told = page.locator(".step .warnings li")
    visitor.wait(lambda: told.count() == 1, "the pitch is doubtful")
    assert re.search(r"chassis.v_x seems 0\.3[45]\d ± 0.00\d s late", told.inner_text())
    before = steps.count()
    page.select_option("#step-kind", "delay")
    visitor.click("#add-step")
    assert steps.count() == before + 1
    assert "Take off a delay" in first.inner_text()
    band = [page.get_by_label(f"Take off a delay, step 1, in the band, {k}") for k in (1, 2)]
    assert [one.input_value() for one in band] == ["0.2", "2"]
    visitor.click("#apply-steps")
    visitor.wait(lambda: "taken off" in first.inner_text(), "the delay is found")
    assert re.search(r"chassis.v_x was 3[45]\d\.\d+ ms late ± [\d.]+ ms", first.inner_text())
    assert told.count() == 0
    visitor.settled()


def test_many_columns_are_found_by_a_part_of_their_name(visitor):
    """Those that are mapped stand first, whatever their place in the file."""
    time = 0.01 * np.arange(60)
    names = [f"ECU{k}_{what}" for k in range(125) for what in ("Temp", "Press")]
    lines = [",".join([f"{t:.2f}", *["1"] * len(names), f"{20 * np.sin(9 * t):.4f}"]) for t in time]
    data = "\n".join([",".join(["Zeit [s]", *names, "Aufbauhub [mm]"]), *lines]).encode()
    visitor.click("#tab-measurements")
    add(visitor, "can.csv", data)
    open_next(visitor, ".mapping-table")
    rows = visitor.page.locator(".mapping-table tbody tr")
    assert [rows.nth(k).locator("th").inner_text() for k in (0, 1)] == ["Zeit", "Aufbauhub"]
    assert rows.count() == 200
    visitor.page.fill("#column-filter", "ecu7_ press")
    assert rows.count() == 1
    assert rows.locator("th").inner_text() == "ECU7_Press"
    visitor.page.fill("#column-filter", "")
    visitor.page.check("#only-mapped")
    assert rows.count() == 2
    assert visitor.page.locator(".needs .lacks").count() == 5
