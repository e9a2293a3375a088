"""A campaign on the page: driven, cancelled, refused, and taken over as measurements."""

import json
import signal

import pytest
from ridetune.engine.extras import how_to_install

from .conftest import AWAY, Service

pytestmark = pytest.mark.browser

DRIVEN = 120.0
BOX = ".campaign-manoeuvres input[value='{}']"


@pytest.fixture
def driver(visitor):
    """With the form open, by the keyboard."""
    visitor.click("#tab-measurements")
    visitor.page.locator("summary", has_text="Drive a campaign").press("Enter")
    return visitor


def test_the_recordings_of_a_campaign_become_measurements(driver):
    """Of the sliders' car, by Enter in a field; the seed draws the noise that is stated."""
    page = driver.page
    assert driver.element("#campaign-state").inner_text() == "2 drives, 40 s"
    page.uncheck(BOX.format("1"))
    page.uncheck(BOX.format("2"))
    assert driver.element("#drive").is_disabled()
    assert driver.element("#campaign-state").inner_text() == "Choose a manoeuvre at least."
    page.check(BOX.format("bump"))
    page.select_option("#campaign-noise", "5 × usual")
    page.fill("#campaign-seed", "7")
    page.press("#campaign-seed", "Enter")
    driver.until("ridetune.state('measurements').length === 3", DRIVEN)
    taken = driver.look("ridetune.state('measurements')[2]")
    assert taken["name"] == "manoeuvre_bump.csv"
    assert taken["noise"]["chassis.z"] == pytest.approx(2.5e-3)
    job = driver.look("ridetune.campaign()")
    assert (job["seed"], job["vehicle"]["name"]) == (
        7,
        driver.look("ridetune.state('vehicle').name"),
    )
    driver.wait(lambda: driver.element("#campaign-zip").count() == 1, "a link to the files")
    with page.expect_download() as loading:
        driver.click("#campaign-zip")
    assert loading.value.suggested_filename == "campaign.zip"
    # A recording that was deleted can be added again.
    page.locator(".pick button", has_text="manoeuvre_bump").click()
    drawn = page.locator(".measurement-detail canvas")
    driver.wait(lambda: drawn.count() > 0, "its histories to be drawn")
    driver.element(".measurement-detail .danger").click()
    driver.element(".measurement-detail .danger").click()
    driver.click("#take-over")
    driver.until("ridetune.state('measurements').length === 3")
    driver.wait(lambda: driver.element("#take-over").count() == 0, "all are there")


def test_a_run_that_came_in_is_fitted_too_at_a_press(driver):
    """Those of the car that is fitted: the sample was driven by another, which its notes name."""
    page = driver.page
    fits = driver.element("#identify")

    def drive(key, count):
        for other in ("1", "2", "bump", "brake-54"):
            page.set_checked(BOX.format(other), other == key)
        driver.click("#drive")
        driver.until(f"ridetune.state('measurements').length === {count}", DRIVEN)
        driver.wait(lambda: driver.element("#drive").count() == 1, "the form is free again")

    assert "The car on the sliders, “" in driver.element("#campaign-driver").inner_text()
    drive("bump", 3)
    notice = driver.element(".notice", has_text="recording is in")
    assert "another car than that of detailed_manoeuvre_1.csv" in notice.inner_text()
    assert notice.get_by_role("button", name="Fit it too").count() == 0
    page.locator(".pick button", has_text="manoeuvre_bump").click()
    assert "Driven by the concept car" in driver.element(".measurement-detail").inner_text()
    page.get_by_role("button", name="Use as ride").click()
    drive("brake-54", 4)
    assert fits.get_attribute("title").startswith("Fits manoeuvre_bump.csv: ")
    page.get_by_role("button", name="Fit it too").click()
    both = "Fits manoeuvre_bump.csv, manoeuvre_brake-54.csv: "
    assert fits.get_attribute("title").startswith(both)


@pytest.fixture
def unfolded(driver):
    """With what is rarely used in sight, and the constant speed on a random road chosen."""
    page = driver.page
    page.locator("summary", has_text="Roads, sensors, format: as usual").click()
    for key in ("1", "2", "constant-speed-c"):
        page.set_checked(BOX.format(key), key not in "12")
    return driver


def give_sensors(driver, text):
    file = {"name": "s.toml", "mimeType": "application/toml", "buffer": text}
    driver.page.set_input_files("#campaign-sensors", [file])


def test_roads_and_sensors_are_those_of_the_fields(unfolded):
    """By one press on the button, which ends the typing in the last field."""
    driver, page = unfolded, unfolded.page
    give_sensors(driver, b'rate_hz = 100\n[sensors."wheel.{corner}.z"]\nnoise = 0.001\n')
    hint = driver.element(".campaign-sensors .hint")
    driver.wait(lambda: hint.inner_text() == "s.toml: 4 channels at 100 Hz", "the file is read")
    assert driver.element("#campaign-noise").is_disabled()
    page.fill("#campaign-class_factor", "0.5")
    page.fill("#campaign-band_low", "0.03")
    page.fill("#campaign-band_high", "2.5")
    page.fill("#campaign-road_seed", "9")
    driver.click("#drive")
    driver.until("ridetune.state('measurements').length === 3", DRIVEN)
    job = driver.look("ridetune.campaign()")
    asked = [job[name] for name in ("class_factor", "band", "road_seed", "noise")]
    assert asked == [0.5, [0.03, 2.5], 9, {}]
    road = job["manoeuvres"]["constant-speed-c"]["road"]
    assert (road["class_factor"], road["band"]) == (0.5, [0.03, 2.5])
    taken = driver.look("ridetune.state('measurements')[2]")
    channels = [one["name"] for one in taken["channels"]]
    assert channels == [f"wheel.{corner}.z" for corner in ("fl", "fr", "rl", "rr")]
    assert taken["sample_step"] == pytest.approx(0.01)
    summary = page.locator("summary", has_text="Roads, sensors, format").inner_text()
    assert summary.endswith("0.03 to 2.5 cycle/m, road seed 9, s.toml")
    page.get_by_role("button", name="Usual sensors").click()
    assert driver.element("#campaign-noise").is_enabled()


def test_what_cannot_be_driven_is_said_at_its_field(unfolded):
    """Half a band, though the fold is closed, and a file of sensors that is none."""
    driver, page = unfolded, unfolded.page
    page.fill("#campaign-band_low", "0.03")
    page.locator("summary", has_text="Roads, sensors, format").click()
    driver.click("#drive")
    high = driver.element("#campaign-band_high")
    driver.wait(high.is_visible, "the fold is open")
    assert high.evaluate("(e) => e.validationMessage") == "Give both ends of the band, or neither."
    assert driver.look("ridetune.campaign() === null")
    driver.expected.append("422")
    give_sensors(driver, b"[sensors.chassis.zz]")
    problem = driver.element(".campaign-sensors [role=alert]")
    driver.wait(lambda: problem.count() == 1, "a sentence")
    assert problem.inner_text().startswith("s.toml: sensors.chassis.zz is not known")


def test_mdf4_is_downloaded_and_not_taken_over(unfolded):
    driver, page = unfolded, unfolded.page
    page.select_option("#campaign-format", "mf4")
    driver.click("#drive")
    link = page.get_by_role("link", name="manoeuvre_constant-speed-c.mf4")
    driver.wait(lambda: link.count() == 1, "a link to the file", DRIVEN)
    assert driver.element("#take-over").count() == 0
    assert len(driver.look("ridetune.state('measurements')")) == 2


def test_the_detailed_car_drives_and_becomes_the_session_s_car(driver):
    """Half a second of it, by a request that is cut short on its way; also after a reload."""
    page = driver.page

    def cut(route):
        if route.request.method != "POST":
            route.continue_()
            return
        asked = json.loads(route.request.post_data)
        assert (asked["plant"], asked["vehicle"], asked["manoeuvres"]) == ("detailed", None, ["1"])
        asked["manoeuvres"] = {"1": {"name": "wait", "kind": "road", "duration": 0.5}}
        route.continue_(post_data=json.dumps(asked))

    sample = driver.look("ridetune.state('vehicle')")
    driver.click("#tab-car")
    page.select_option("#car [aria-label='Reference cars']", "paper")
    driver.wait(lambda: driver.look("ridetune.state('vehicle')") != sample, "another car")
    driver.click("#tab-measurements")
    page.route("**/campaigns", cut)
    page.uncheck(BOX.format("2"))
    page.select_option("#campaign-car", "detailed")
    assert driver.element("#campaign-state").inner_text() == "1 drive, 20 s, about 50 s to compute"
    driver.click("#drive")
    driver.until("ridetune.state('measurements').length === 3", DRIVEN)
    before = driver.look("ridetune.state('vehicle')")
    page.reload()
    driver.wait_until_drawn()
    driver.click("#tab-measurements")
    page.locator("summary", has_text="Drive a campaign").click()
    driver.wait(lambda: driver.element("#use-car").count() == 1, "a button")
    driver.click("#use-car")
    driver.wait(lambda: driver.look("ridetune.state('vehicle')") != before, "another car")
    file = page.evaluate(
        "async (at) => (await fetch(`/api/sessions/${at}/files/vehicle.json`)).json()",
        driver.look("`${ridetune.state('session')}/campaigns/${ridetune.campaign().id}`"),
    )
    assert driver.look("ridetune.state('vehicle')") == file
    assert driver.look("ridetune.state('baseline')") == file


@pytest.mark.slow
def test_a_campaign_is_followed_on_after_the_service_has_been_away(visit, tmp_path):
    """It was killed before a worker could begin."""
    service = Service(tmp_path / "data")
    try:
        visitor = visit().open(service.address)
        visitor.expect(*AWAY)
        visitor.click("#tab-measurements")
        visitor.page.locator("summary", has_text="Drive a campaign").click()
        visitor.click("#drive")
        visitor.until("ridetune.campaign() !== null")
        service.stop(signal.SIGKILL)
        state = visitor.element("#campaign-state")
        assert state.inner_text() == "Waiting for a worker …"
        service = Service(tmp_path / "data", service.port)
        visitor.until("ridetune.campaign().state === 'done'", DRIVEN)
        visitor.wait(lambda: visitor.element("#drive").count() == 1, "the form is free again")
        visitor.until("ridetune.state('measurements').length === 4")
    finally:
        service.stop()


@pytest.mark.slow
def test_a_job_that_waits_for_workers_out_of_reach_says_so(visit, tmp_path):
    """Nothing listens at port 9; the page is there all the same."""
    service = Service(tmp_path / "data", RIDETUNE_CLUSTER="tcp://127.0.0.1:9")
    try:
        visitor = visit().open(service.address)
        visitor.click("#tab-identification")
        visitor.click("#identify")
        outcome = visitor.element("#outcome")
        visitor.wait(lambda: "workers cannot be reached" in outcome.inner_text(), "a reason")
        assert visitor.look("ridetune.state('online')")
    finally:
        service.stop()


def test_a_car_that_cannot_drive_here_is_shown_with_the_reason(visit, service):
    """As the service's list has it where the solver is not installed."""
    visitor = visit()
    how = how_to_install("detailed")
    why = f"The detailed car needs Exudyn; {how}, and start a running service again."

    def lacking(route):
        concept, detailed = route.fetch().json()
        route.fulfill(json=[concept, {**detailed, "missing": why}])

    visitor.page.route("**/api/plants", lacking)
    visitor.open(service.address).click("#tab-measurements")
    visitor.page.locator("summary", has_text="Drive a campaign").click()
    option = visitor.element("#campaign-car option[value=detailed]")
    assert (option.is_disabled(), option.inner_text()) == (True, "Detailed car: not installed")
    assert visitor.page.get_by_text(why).is_visible()


def test_what_the_service_refuses_is_said_beside_the_form(driver):
    """A factor without any random road; the browser refuses a negative one by itself."""
    page = driver.page
    page.fill("#campaign-class_factor", "-1")
    driver.click("#drive")
    assert driver.look("ridetune.campaign() === null")
    page.fill("#campaign-class_factor", "0.5")
    page.uncheck(BOX.format("1"))
    page.uncheck(BOX.format("2"))
    page.check(BOX.format("bump"))
    driver.expected.append("422")
    driver.click("#drive")
    problem = driver.element(".campaign-outcome [role=alert]")
    driver.wait(lambda: problem.count() == 1, "a sentence")
    assert "None of the manoeuvres has a random road" in problem.inner_text()


def test_a_campaign_is_cancelled_on_the_page(driver):
    """Every manoeuvre there is; the focus stays at the button's place."""
    for box in driver.element(".campaign-manoeuvres input").all():
        box.check()
    driver.element("#drive").press("Enter")
    driver.wait(lambda: driver.element("#cancel-campaign").count() == 1, "a way to cancel")
    driver.element("#cancel-campaign").press("Enter")
    driver.until("['cancelled', 'done'].includes(ridetune.campaign().state)", DRIVEN)
    driver.wait(lambda: driver.element("#drive").count() == 1, "the form is free again")
    assert driver.look("ridetune.campaign().state") == "cancelled"
