"""The validation on the page and its report: from a file, from the service, and on paper."""

import math
import re

import pytest
from ridetune.app.cli import main

from .conftest import SAMPLES, add_file
from .cut_off import cut_off

pytestmark = pytest.mark.browser

PRESSED = 120.0


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """A report by the command line, of a recording whose name is markup."""
    folder = tmp_path_factory.mktemp("report")
    name = "<img src=x onerror=alert(1)>.csv"
    (folder / name).write_bytes((SAMPLES / "twin/manoeuvre_1.csv").read_bytes())
    command = ["validate", str(folder / name), "--vehicle", "paper"]
    command += ["--free", "K_F", "front.suspension.rebound_ratio"]
    command += [
        "--hold-out",
        str(SAMPLES / "twin/manoeuvre_2.csv"),
        "-o",
        str(folder / "report.html"),
    ]
    command += ["--manoeuvre", "manoeuvre_2.csv=2"]
    assert main(command) == 0
    return folder / "report.html"


def inked(page):
    """How many of the page's canvases have anything drawn on them."""
    return page.evaluate(
        """[...document.querySelectorAll("canvas")].filter((canvas) =>
        canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data
            .some((value) => value !== 0)).length"""
    )


def pages(pdf):
    return len(re.findall(rb"/Type\s*/Page\b", pdf))


def give_pivot(visitor, label, text):
    visitor.page.get_by_label(f"{label} by geometry").fill(text)


def test_a_report_opens_from_a_file_and_prints(visit, file):
    """6 figures of a run on rims alone; 4 more, road and three outputs, where the road is known."""
    page = visit().page
    asked = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(file.as_uri())
    page.wait_for_selector("html[data-drawn=yes]", state="attached")
    page.wait_for_timeout(300)
    assert not [url for url in asked if not url.startswith(("file:", "data:"))]
    figures = page.locator(".figure").count()
    assert figures == inked(page) == 6 + 10
    assert page.locator("img").count() == 0
    assert "onerror" in page.locator("h2", has_text="fitted").first.inner_text()
    text = page.locator("main").inner_text()
    for words in ("Identified parameters", "held out", "SHA-256", "8-DOF", "7-DOF"):
        assert words in text
    # Tables, and 16 figures of which a page takes six.
    assert pages(page.pdf(prefer_css_page_size=True)) >= 3


def test_the_fitted_car_is_validated_on_the_page(visitor):
    """The fit's own runs and the sample it has not seen; the report opens in a tab of its own."""
    visitor.click("#tab-validation")
    assert "No fit yet" in visitor.element("#validation").inner_text()
    visitor.click("#identify")
    visitor.until("ridetune.state('fitJob') !== null", PRESSED)
    visitor.click("#tab-validation")
    give_pivot(visitor, "Rear pivot distance", "1.1")
    visitor.click("#validate")
    missing = visitor.page.get_by_label("Rear pivot angle by geometry")
    said = missing.evaluate("(field) => field.validationMessage")
    assert said == "Give distance and angle of the rear pivot, or neither."
    assert visitor.look("ridetune.validation()") is None
    give_pivot(visitor, "Rear pivot angle", "10")
    visitor.click("#validate")
    visitor.until("ridetune.validation() && ridetune.validation().state === 'done'", PRESSED)
    geometry = visitor.look("ridetune.validation().geometry")
    assert geometry == {"rear": {"distance": 1.1, "angle": pytest.approx(math.radians(10))}}
    visitor.wait(lambda: visitor.element("#report").count() == 1, "a link to the report")
    visitor.page.wait_for_timeout(300)
    assert visitor.element("#validation .figure").count() >= 12
    estimates = visitor.element("#validation .validation-estimates")
    assert "By geometry" in estimates.locator("thead").inner_text()
    assert (
        estimates.locator("tr", has_text="Rear pivot angle").locator("td").nth(3).inner_text()
        == "10.00"
    )
    assert visitor.element("#validation .validation-scores tbody").count() == 2
    # Both samples' roads are known: each is predicted from its rims and over its road.
    assert visitor.element("#validation .coverage tbody tr").count() == 2 * 2
    figures = visitor.element("#validation figcaption")
    assert figures.filter(has_text="95 % error band").count() == 2 * 2 * 3
    assert cut_off(visitor) == []
    with visitor.page.context.expect_page() as opened:
        visitor.click("#report")
    report = opened.value
    complaints = []
    report.on("console", lambda said: complaints.append(said.text))
    report.wait_for_selector("html[data-drawn=yes]", state="attached")
    assert report.locator(".figure").count() == inked(report)
    assert complaints == []


def test_only_runs_of_the_fitted_car_that_are_not_left_out_are_held_out(visitor):
    """Oracle: the cars that the samples' notes and the fit name, and the use that was chosen."""
    visitor.click("#tab-measurements")
    add_file(visitor, "paper.json", (SAMPLES / "twin/vehicle.json").read_bytes())
    visitor.until("ridetune.state('vehicle').name === 'Reference car of the paper'")
    for count, number in ((3, 1), (4, 2)):
        name = f"manoeuvre_{number}.csv"
        add_file(visitor, name, (SAMPLES / "twin" / name).read_bytes())
        visitor.until(f"ridetune.state('measurements').length === {count}")
    visitor.click("#tab-identification")
    use = visitor.page.get_by_label
    use("Use of manoeuvre_1.csv").select_option("fit")
    use("Use of detailed_manoeuvre_1.csv").select_option("leave out")  # the ride on show
    visitor.click("#start")
    visitor.until("ridetune.state('fitJob') !== null", PRESSED)
    visitor.click("#tab-validation")
    panel = visitor.element("#validation")
    assert panel.inner_text().count("Recorded with another car: compact rear-drive car.") == 2

    def held():
        rows = panel.get_by_role("checkbox").all()
        return [row.get_attribute("aria-label") for row in rows if row.is_checked()]

    assert held() == ["Hold out manoeuvre_2.csv"]
    visitor.click("#tab-identification")
    visitor.page.get_by_role("button", name="Set-up").click()
    use("Use of manoeuvre_2.csv").select_option("leave out")
    visitor.click("#tab-validation")
    assert held() == []
    visitor.page.get_by_label("Hold out detailed_manoeuvre_1.csv").check()
    visitor.click("#validate")
    visitor.until("ridetune.validation() && ridetune.validation().state === 'done'", PRESSED)
    visitor.wait(lambda: visitor.element("#report").count() == 1, "a link to the report")
    said = "Neither fitted nor held out: detailed_manoeuvre_2.csv, manoeuvre_2.csv."
    assert said in panel.inner_text()
    finding = panel.locator(".validation-scores .doubt").inner_text()
    assert "was recorded with another car, compact rear-drive car, than the one" in finding
