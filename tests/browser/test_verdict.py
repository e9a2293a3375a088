"""What a fit is worth, on the page: verdict, correlation, profile, next run, error band, search."""

import re

import numpy as np
import pytest

from .conftest import SAMPLES, add_file

pytestmark = pytest.mark.browser

TWIN = SAMPLES / "twin"


@pytest.fixture
def analyst(visitor):
    """With the twin's car and its manoeuvre 2 as the only run that is fitted."""
    visitor.click("#tab-measurements")
    add_file(visitor, "vehicle.json", (TWIN / "vehicle.json").read_bytes())
    visitor.until("ridetune.state('vehicle').name === ridetune.state('baseline').name")
    add_file(visitor, "twin.csv", (TWIN / "manoeuvre_2.csv").read_bytes())
    visitor.until("ridetune.state('measurements').length === 3")
    visitor.page.get_by_role("button", name="Use as ride").click()
    visitor.click("#tab-identification")
    for name in ("detailed_manoeuvre_1.csv", "detailed_manoeuvre_2.csv"):
        visitor.page.get_by_label(f"Use of {name}").select_option("leave_out")
    return visitor


def fitted(visitor):
    visitor.click("#start")
    visitor.until("ridetune.state('fit') !== null", 150)
    return visitor.look("ridetune.state('fit')")


def as_kept_earlier(route):
    """A profile without sentences, which tells that a side is at a bound, but not of what."""
    job = route.fetch().json()
    profile = job["result"]
    del profile["sentences"]
    for side in ("lower_at_bound", "upper_at_bound"):
        profile[side] = bool(profile[side])
    route.fulfill(json=job)


def test_a_fit_tells_what_its_run_determines_and_what_to_drive_next(analyst):
    """Truth: a bar acts on the wheels as K_tor/d^2, so that the run holds that and not the two."""
    visitor, page = analyst, analyst.page
    assert visitor.element("#to-fit").inner_text() == "Fits twin.csv"
    fit = fitted(visitor)

    # The verdict names the combination; the table has it in N/mm.
    page.locator("#fit-verdict").click()
    said = visitor.element(".verdict-said").inner_text().replace("\n", "")
    assert "KtorF and dF are determined only together, as KtorF/dF²" in said
    [rate] = [one for one in fit["verdict"]["combinations"] if one["name"] == "front.bar_rate"]
    assert f"{rate['value'] / 1000:.4g} N/mm" in said
    assert visitor.element(".direction").first.inner_text()

    # Of a single start there are no minima to compare, and it is told how to get some.
    page.locator("#fit-minima").click()
    assert "from one start" in visitor.element("#identification").inner_text()

    # The pair is marked by more than its colour, and read by the keyboard.
    page.locator("#fit-correlation").click()
    names = [one["name"] for one in fit["parameters"]]
    row, column = names.index("front.stabilizer_bar.stiffness"), names.index("front.pivot.distance")
    cell = page.locator(".correlation tbody tr").nth(row).locator("td").nth(column)
    assert fit["correlation"][row][column] > 0.9
    assert cell.inner_text() == "+"
    page.locator(".correlation tbody tr").nth(row).locator("td").nth(column - 1).focus()
    page.keyboard.press("ArrowRight")
    told = visitor.element(".correlation-said").inner_text().replace("\n", "")
    assert f"KtorF and dF: {fit['correlation'][row][column]:.3f}" in told

    # A profile is drawn through the fit, to both sides of it.
    page.locator("#fit-parameters").click()
    page.get_by_label("Profile of Front spring stiffness").click()
    visitor.until("ridetune.profile()?.state === 'done'", 120)
    page.locator(".profile-plot canvas").wait_for()
    profile = visitor.look("ridetune.profile().result")
    low, high = profile["confidence_interval"]
    assert (
        f"{low / 1000:.1f} … {high / 1000:.1f} N/mm"
        in visitor.element(".profile-said").inner_text()
    )
    steps = page.get_by_label("Held at, N/mm")
    steps.focus()
    page.keyboard.press("End")
    last = profile["points"][-1]["value"] / 1000
    assert f"held at {last:.2f} N/mm" in visitor.element(".profile-others").inner_text()

    # One that an earlier service kept is drawn, too.
    page.route(f"**/profiles/{visitor.look('ridetune.profile().id')}", as_kept_earlier)
    page.reload()
    visitor.wait_until_drawn()
    page.locator("#tab-identification").click()
    page.locator("#fit-profile").click()
    page.locator(".profile-plot canvas").wait_for()
    page.locator("#fit-parameters").click()

    # Braking comes first, is seen as a ride, and is chosen in the campaign form.
    page.locator("#fit-advice").click()
    visitor.until("ridetune.advice() !== null", 120)
    best = visitor.look("ridetune.advice().candidates[0]")
    assert best["key"].startswith("brake")
    assert visitor.element(".before-after tbody tr").count() == 12
    least, most = (one.bounding_box() for one in visitor.element(".before-after .axis span").all())
    assert least["x"] + least["width"] < most["x"]
    visitor.click("#see-candidate")
    visitor.until("ridetune.state('now')?.head.mode === 'road'")
    assert visitor.look("ridetune.state('now').head.duration") == pytest.approx(best["duration"])
    visitor.click("#drive-candidate")
    chosen = page.locator(".campaign-manoeuvres input:checked")
    assert chosen.count() == 1
    assert chosen.get_attribute("value") == best["key"]
    assert f"1 drive, {best['duration']:g} s" in visitor.element("#campaign-state").inner_text()
    # What was advised of the fitted car is driven by it, though the sliders hold the start values.
    assert "The fitted car, " in visitor.element("#campaign-driver").inner_text()
    visitor.click("#drive")
    visitor.until("ridetune.state('measurements').length === 4", 120)
    assert visitor.look("ridetune.campaign().vehicle") == fit["vehicle"]
    stiffness = "front.suspension.stiffness"
    assert visitor.value(stiffness) != fit["vehicle"]["front"]["suspension"]["stiffness"]

    # What the fit was made of is deleted: a further question names it, and is of no use again.
    page.locator(".pick button", has_text="twin.csv").click()
    visitor.element(".measurement-detail .danger").click()
    visitor.element(".measurement-detail .danger").click()
    visitor.until("ridetune.state('measurements').length === 3")
    visitor.settled()
    visitor.expect("410")
    visitor.click("#tab-identification")
    page.locator("#fit-parameters").click()
    page.get_by_label("Profile of Rear spring stiffness").click()
    problem = visitor.element("#identification .problem")
    visitor.wait(lambda: problem.count() == 1, "a sentence")
    assert problem.inner_text().startswith("twin.csv, to which this car was fitted, was deleted")
    assert page.get_by_role("button", name="Try again").count() == 0


def test_the_error_band_of_an_applied_fit_holds_its_curve_and_follows_no_other(analyst):
    """Truth: a symmetrical band holds the curve about which it is taken."""
    visitor, page = analyst, analyst.page
    fitted(visitor)
    assert not page.get_by_label("Error band").is_checked()
    visitor.click("#apply")
    visitor.until("ridetune.state('bands') !== null")
    for channel in ("chassis.z", "chassis.pitch", "chassis.roll"):
        low, curve, high = (visitor.line(channel, one) for one in ("lower", "now", "upper"))
        assert np.all(low <= curve + 1e-6)
        assert np.all(curve <= high + 1e-6)
        assert np.nanmax(high - low) > 0.0
    visitor.click("#tab-comfort")
    assert "±" in visitor.element(".metrics:not(.fits) tbody").inner_text()

    # However long it takes it stays wanted, also of another fit; until it is there it follows.
    visitor.element("#slider-rear-suspension-stiffness").press("PageUp")
    assert visitor.look("ridetune.state('bands')") is None
    assert page.get_by_label("Error band").is_checked()
    assert visitor.element("#band-word").inner_text() == "follows …"
    visitor.until("ridetune.state('bands') !== null")
    assert page.get_by_label("Error band").is_checked()
    assert visitor.element("#band-word").inner_text() == "Error band"
    first = visitor.look("ridetune.state('fitJob').id")
    visitor.click("#identify")
    visitor.until(f"ridetune.state('fitJob').id !== '{first}'", 150)
    visitor.until("ridetune.state('bands') !== null")

    # A slider that moves takes the band away at once; wanted, it comes again when the slider rests.
    page.get_by_label("Error band").uncheck()
    assert visitor.look("ridetune.state('bands')") is None
    page.get_by_label("Error band").check()
    visitor.until("ridetune.state('bands') !== null")
    before = visitor.line("chassis.pitch", "upper")
    visitor.element("#slider-front-suspension-stiffness").press("PageUp")
    assert visitor.look("ridetune.state('bands')") is None
    visitor.until("ridetune.state('bands') !== null")
    low, curve, high = (visitor.line("chassis.pitch", one) for one in ("lower", "now", "upper"))
    assert np.abs(high - before).max() > 1e-4
    assert np.all((low <= curve + 1e-6) & (curve <= high + 1e-6))


def test_a_search_is_told_of_starts_outliers_and_priors(analyst):
    """What differs from the usual is told where it is folded away, and is asked of the service."""
    visitor, page = analyst, analyst.page
    summaries = {
        word: page.locator("#identification summary", has_text=word)
        for word in ("Search", "Known before")
    }
    for summary in summaries.values():
        summary.click()
    page.fill("#search-starts", "8")
    page.select_option("#loss", "huber")
    mean = page.get_by_label("Mean of Rear pivot distance known before, m")
    mean.fill("1.1")
    mean.press("Tab")
    assert summaries["Known before"].inner_text() == "Known before: nothing"
    visitor.click("#start")
    assert visitor.look("ridetune.job()") is None, "half a prior is not sent"
    deviation = page.get_by_label("Standard deviation of Rear pivot distance known before, m")
    deviation.fill("0.05")
    deviation.press("Tab")
    assert summaries["Search"].inner_text() == "Search: 8 starts, Huber from 3 noises"
    assert summaries["Known before"].inner_text().replace("\n", "") == "Known before: dR"

    # While it runs, it tells which search it is at and how long the others take.
    visitor.click("#start")
    stage = page.locator("#stage-of-fit")
    told = re.compile(r"Search [3-8] of [3-8], .* best of 8 starts; about \d+ s left\.")
    visitor.wait(
        lambda: any(told.match(text) for text in stage.all_inner_texts()), "the search is told"
    )
    visitor.until("ridetune.state('fit') !== null", 150)
    fit, job = visitor.look("ridetune.state('fit')"), visitor.look("ridetune.job()")
    assert (job["starts"], job["loss"]) == (8, "huber")
    assert job["priors"] == {"rear.pivot.distance": [1.1, 0.05]}
    page.locator("#fit-minima").click()
    assert visitor.element(".minima tbody tr").count() == len(fit["minima"])
    page.locator("#fit-residuals").click()
    rows = visitor.element(".whiteness .channel").all_inner_texts()
    assert len(rows) == len(fit["whiteness"]) == 3
    assert all("white, like noise" in row for row in rows)
    page.locator("#fit-verdict").click()
    assert "1.10 ± 0.050" in visitor.element(".priors-check").inner_text()


def test_an_interval_that_is_open_to_one_side_says_from_where(visitor):
    """The sample car's front bar ends at its upper bound; beyond it the search has not looked."""
    visitor.click("#identify")
    visitor.until("ridetune.state('fit') !== null", 150)
    found = visitor.look("ridetune.state('fit').parameters")
    [bar] = [one for one in found if one["name"] == "front.stabilizer_bar.stiffness"]
    low, high = bar["confidence_interval"]
    assert high is None
    row = visitor.page.locator(".estimates tr", has_text="KtorF")
    expected = "unbounded" if low is None else "from "
    assert expected in row.inner_text()
    outcome = visitor.element("#outcome").inner_text()
    assert "at a bound of the search" in outcome


def test_a_turned_channel_is_offered_to_be_turned_back(visitor):
    """Truth: the twin's roll with the sign turned over in the file, and the rear spring."""
    visitor.click("#tab-measurements")
    add_file(visitor, "vehicle.json", (TWIN / "vehicle.json").read_bytes())
    visitor.until("ridetune.state('vehicle').name === ridetune.state('baseline').name")
    header, *rows = (TWIN / "manoeuvre_2.csv").read_text().splitlines()
    place = [name.split(" ")[0] for name in header.split(",")].index("chassis.roll")
    turned = [row.split(",") for row in rows]
    for row in turned:
        row[place] = str(-float(row[place]))
    text = "\n".join([header, *(",".join(row) for row in turned)]) + "\n"
    add_file(visitor, "turned.csv", text.encode())
    visitor.until("ridetune.state('measurements').length === 3")
    visitor.page.get_by_role("button", name="Use as ride").click()
    visitor.click("#tab-identification")
    visitor.click("#start")
    visitor.until("ridetune.state('fit') !== null", 150)
    [offer] = visitor.look("ridetune.state('fit').offers")
    assert offer["channel"] == "chassis.roll"
    first = visitor.look("ridetune.job().id")
    visitor.page.get_by_role("button", name="Apply and fit again").click()
    visitor.until(f"ridetune.state('fitJob').id !== '{first}'", 150)
    fit = visitor.look("ridetune.state('fit')")
    assert fit["offers"] == []
    assert fit["fixed_sensors"] == {"chassis.roll": {"sign": -1}}
    [spring] = [one for one in fit["parameters"] if one["name"] == "rear.suspension.stiffness"]
    low, high = spring["confidence_interval"]
    assert low < 27000 < high
    visitor.click("#identification >> text=Set-up")
    assert visitor.page.get_by_text("Sensors: roll").is_visible()
