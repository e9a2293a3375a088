"""A campaign on the page: driven, cancelled, refused, and taken over as measurements."""

import pytest

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
    driver.element(".measurement-detail .danger").click()
    driver.element(".measurement-detail .danger").click()
    driver.click("#take-over")
    driver.until("ridetune.state('measurements').length === 3")
    driver.wait(lambda: driver.element("#take-over").count() == 0, "all are there")


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
