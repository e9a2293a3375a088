"""What is set on the page is kept with the session, part by part, whatever else happens."""

import json

import pytest
from ridetune.app.schemas import SearchForm
from ridetune.engine.simulation.rims_settings import (
    HIGHEST_HIGHPASS,
    LOWEST_CUTOFF,
    LOWEST_HIGHPASS,
)

from .conftest import Visitor, add_file, short_run
from .test_preparation import change

pytestmark = pytest.mark.browser


def saved(visitor: Visitor) -> None:
    visitor.wait(lambda: not visitor.look("ridetune.unsaved()"), "what was set is saved")


def kept(visitor: Visitor):
    """The set-up as the service has it."""
    session = visitor.look("ridetune.state('session')")
    address = visitor.page.url.split("/s/")[0]
    reply = visitor.page.request.get(f"{address}/api/sessions/{session}/setup")
    return reply.json()


def opened(visitor: Visitor, *summaries: str) -> None:
    visitor.click("#tab-identification")
    for summary in summaries:
        visitor.page.locator("summary", has_text=summary).click()


def test_two_pages_of_a_session_keep_what_each_of_them_changed(visit, visitor):
    """Oracle: the service has the changes of both, also of a run that one of them does not know."""
    other = visit(beside=visitor)
    other.page.goto(visitor.page.url)
    other.wait_until_drawn()
    add_file(visitor, "lap.csv", short_run())
    visitor.until("ridetune.state('measurements').length === 3")
    added = visitor.look("ridetune.state('measurements')[2].id")
    visitor.click("#tab-identification")
    visitor.page.get_by_label("Use of lap.csv").select_option("fit")
    opened(visitor, "Noise:", "Known before:")
    visitor.page.get_by_role("spinbutton", name="Noise of z,").fill("0.7")
    change(visitor, "Lower bound of Front spring stiffness", "12")
    change(visitor, "Mean of Rear damping known before", "1500")
    change(visitor, "Standard deviation of Rear damping known before", "70")
    saved(visitor)

    second = other.look("ridetune.state('measurements')[1].id")
    other.page.select_option("#ride", label="detailed_manoeuvre_2.csv")
    opened(other)
    other.page.get_by_label("Use of detailed_manoeuvre_1.csv").select_option("leave_out")
    saved(other)
    found = kept(visitor)
    first = visitor.look("ridetune.state('measurements')[0].id")
    assert found["ride"]["id"] == second
    assert found["use"] == {added: "fit", first: "leave_out"}
    assert found["noise"] == {"chassis.z": pytest.approx(7e-4)}
    assert found["bounds"] == {"front.suspension.stiffness": [12e3, None]}
    assert found["priors"] == {"rear.suspension.damping": [1500, 70]}


def test_a_refused_part_is_told_and_holds_no_other_back(visitor):
    """Bounds that are crossed on the way are told until they are mended."""
    visitor.expect("status of 422")
    opened(visitor, "Noise:")
    change(visitor, "Lower bound of Front spring stiffness", "30")
    saved(visitor)
    change(visitor, "Upper bound of Front spring stiffness", "20")
    message = visitor.element(".notice.error")
    visitor.wait(lambda: message.is_visible(), "it is told")
    assert "The range of front spring stiffness is not kept" in message.inner_text()
    assert "give a lower bound below the upper one" in message.inner_text()
    visitor.page.get_by_role("spinbutton", name="Noise of z,").fill("0.7")
    change(visitor, "Upper bound of Rear spring stiffness", "40")
    visitor.wait(
        lambda: len(kept(visitor)["bounds"]) == 2 and kept(visitor)["noise"],
        "what is right is kept",
    )
    found = kept(visitor)
    assert found["bounds"] == {
        "front.suspension.stiffness": [30e3, None],
        "rear.suspension.stiffness": [None, 40e3],
    }
    assert found["noise"] == {"chassis.z": pytest.approx(7e-4)}
    assert visitor.look("ridetune.unsaved()")
    change(visitor, "Upper bound of Front spring stiffness", "50")
    saved(visitor)
    assert kept(visitor)["bounds"]["front.suspension.stiffness"] == [30e3, 50e3]
    assert not message.is_visible()
    change(visitor, "Upper bound of Front spring stiffness", "20")
    visitor.wait(lambda: message.is_visible(), "it is told again")
    change(visitor, "Upper bound of Front spring stiffness", "50")
    visitor.wait(lambda: not message.is_visible(), "what the service has already is no news")


def test_fields_have_the_limits_of_the_service(visitor):
    """Oracle: the limits of requests; what is beyond is told in its field and does not go out."""
    schema = SearchForm.model_json_schema()["properties"]
    opened(visitor, "How recordings drive", "Search:")

    def ends(field):
        return [
            field.get_attribute(end) and float(field.get_attribute(end)) for end in ("min", "max")
        ]

    for name in ("starts", "seed", "loss_scale"):
        stated = [float(schema[name][end]) for end in ("minimum", "maximum")]
        assert ends(visitor.element(f"#search-{name}")) == stated
    fields = visitor.element(".frequency").all()
    assert list(map(ends, fields)) == [[LOWEST_CUTOFF, None]] * 3 + [
        [LOWEST_HIGHPASS, HIGHEST_HIGHPASS]
    ]
    change(visitor, "Low-pass of the wheel centres", "0.2")
    assert not fields[1].evaluate("(field) => field.validity.valid")
    assert visitor.look("ridetune.state('rimsSettings').rim_cutoff_hz") == 50
    visitor.click("#start")
    assert visitor.look("ridetune.job()") is None


def test_what_is_kept_last_is_what_was_set_last(visitor):
    """While one save is under way, the next one waits for its end."""
    opened(visitor, "Search:")
    held, bodies = [], []

    def hold(route):
        bodies.append(json.loads(route.request.post_data))
        held.append(route) if len(bodies) == 1 else route.continue_()

    visitor.page.route("**/setup", hold)
    change(visitor, "Seed of the starts", "5")
    visitor.wait(lambda: held, "the first save is under way")
    change(visitor, "Seed of the starts", "6")
    visitor.page.wait_for_timeout(800)
    assert bodies == [{"seed": 5}]
    assert visitor.look("ridetune.unsaved()")
    held[0].continue_()
    saved(visitor)
    assert bodies == [{"seed": 5}, {"seed": 6}]
    assert kept(visitor)["seed"] == 6


def test_leaving_the_page_keeps_the_last_change(visitor):
    opened(visitor, "Search:")
    visitor.element("#search-seed").fill("7")
    visitor.page.evaluate(
        "document.querySelector('#search-seed').dispatchEvent(new Event('change'))"
    )
    visitor.page.reload()
    visitor.wait_until_drawn()
    assert visitor.look("ridetune.state('search').seed") == 7
