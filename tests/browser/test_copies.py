"""Recordings of one name are told apart on the page; the same data twice is told, and left out."""

import pytest

from .conftest import SAMPLES, add_file, free_only, short_run

pytestmark = pytest.mark.browser


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
