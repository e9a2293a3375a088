"""A visitor's projects: begin one, name it, go back to another, and delete what is done with."""

import pytest

from .conftest import Visitor
from .cut_off import cut_off
from .test_keeping import opened, saved
from .test_page import STIFFNESS, press
from .test_preparation import change

pytestmark = pytest.mark.browser

LONG = "Wagen 7 mit Winterreifen und einem Namen, der in keine Kopfzeile der Seite passt."


def listed(visitor: Visitor) -> list[str]:
    """The names in the dialog, from the top."""
    visitor.click("#project")
    visitor.element("#projects").wait_for()
    names = visitor.element("#projects li bdi").all_inner_texts()
    visitor.page.keyboard.press("Escape")
    return names


def led(visitor: Visitor, selector: str) -> str:
    """Click what leads to another project; its id, once it is drawn."""
    with visitor.page.expect_navigation():
        visitor.click(selector)
    visitor.wait_until_drawn()
    return visitor.look("ridetune.state('session')")


def begin(visitor: Visitor, name: str = "") -> str:
    """Begin a project; its id."""
    visitor.click("#project")
    visitor.page.fill("#new-name", name)
    return led(visitor, "#new-project")


def test_a_project_is_begun_and_named_and_the_former_is_found_as_it_was(visitor):
    """Also what was set right before it was left."""
    first = visitor.look("ridetune.state('session')")
    assert visitor.page.title() == "Project · ridetune"
    assert visitor.element("#project").inner_text() == "Project"
    press(visitor, "#slider-front-suspension-stiffness", "PageUp")
    changed = visitor.value(STIFFNESS)
    assert changed > 22e3
    second = begin(visitor, " Wagen 7 ")
    assert second != first
    assert visitor.page.title() == "Wagen 7 · ridetune"
    assert visitor.value(STIFFNESS) == 22e3
    assert visitor.look("ridetune.state('measurements').length") == 2

    visitor.click("#project")
    visitor.click("#rename")
    visitor.page.keyboard.type("Wagen 8")
    visitor.page.keyboard.press("Enter")
    visitor.wait(lambda: visitor.page.title() == "Wagen 8 · ridetune", "it has its new name")
    assert visitor.page.evaluate("document.activeElement.id") == "rename"
    assert visitor.element("#projects li").all_inner_texts()[0].startswith("Wagen 8")
    assert "2 recordings" in visitor.element("#projects li").all_inner_texts()[1]
    assert led(visitor, "[aria-label='Open Project']") == first
    assert visitor.value(STIFFNESS) == pytest.approx(changed)
    assert listed(visitor) == ["Project", "Wagen 8"]
    visitor.page.goto(visitor.page.url.split("/s/")[0])
    visitor.wait_until_drawn()
    assert visitor.look("ridetune.state('session')") == first


def test_deleting_asks_once_and_leads_on(spectator):
    """From the open one to the next, at last to a new one; the 3D view does not complain."""
    first = spectator.look("ridetune.state('session')")
    second = begin(spectator)
    third = begin(spectator, "Third")
    spectator.click("#project")
    spectator.click("[aria-label='Delete Project 2']")
    assert "2 recordings" in spectator.element("#projects .going").inner_text()
    assert "for good" in spectator.element("#projects .going").inner_text()
    spectator.click("[aria-label='Keep Project 2']")
    assert spectator.page.evaluate("document.activeElement.ariaLabel") == "Open Project 2"
    spectator.click("[aria-label='Delete Project 2']")
    spectator.click("[aria-label='Delete for good Project 2']")
    names = spectator.element("#projects li bdi")
    spectator.wait(lambda: names.all_inner_texts() == ["Third", "Project"], "it is gone")
    assert spectator.page.evaluate("document.activeElement.id") == "rename"

    spectator.click("[aria-label='Delete Third']")
    assert led(spectator, "[aria-label='Delete for good Third']") == first
    spectator.click("#project")
    spectator.click("[aria-label='Delete Project']")
    assert led(spectator, "[aria-label='Delete for good Project']") not in (first, second, third)
    assert listed(spectator) == ["Project"]


def test_the_projects_are_worked_by_keyboard(visitor):
    keyboard = visitor.page.keyboard
    focused = lambda: visitor.page.evaluate(  # noqa: E731
        "document.activeElement.id || document.activeElement.ariaLabel"
    )
    press(visitor, "#project", "Enter")
    dialog = visitor.element("#projects")
    visitor.wait(dialog.is_visible, "the dialog is open")
    seen = []
    for _ in range(5):
        seen.append(focused())
        keyboard.press("Tab")
    assert seen == ["rename", "Delete Project", "new-name", "new-project", "projects-close"]
    press(visitor, "#rename", "Enter")
    assert focused() == "Name of this project"
    keyboard.type("x")
    keyboard.press("Escape")
    assert dialog.is_visible()
    assert focused() == "rename"
    keyboard.press("Escape")
    assert not dialog.is_visible()
    assert focused() == "project"
    assert visitor.page.title() == "Project · ridetune"


def test_a_name_that_is_refused_is_told_where_it_was_written(visitor):
    visitor.expect("status of 422")
    visitor.click("#project")
    visitor.click("#rename")
    visitor.page.keyboard.type("   ")
    visitor.page.keyboard.press("Enter")
    told = visitor.element("#projects .refusal")
    visitor.wait(told.is_visible, "it is told")
    assert "1 to 80 characters" in told.inner_text()
    visitor.page.get_by_label("Name of this project").fill("Wagen 9")
    visitor.page.keyboard.press("Enter")
    visitor.wait(lambda: visitor.page.title() == "Wagen 9 · ridetune", "it is taken")
    assert not told.is_visible()


def test_what_cannot_be_kept_is_given_up_only_when_asked_twice(visitor):
    visitor.expect("status of 422")
    opened(visitor)
    change(visitor, "Lower bound of Front spring stiffness", "30")
    saved(visitor)
    change(visitor, "Upper bound of Front spring stiffness", "20")
    visitor.click("#project")
    visitor.click("#new-project")
    told = visitor.element("#projects .refusal")
    visitor.wait(told.is_visible, "it is told")
    visitor.expect("ERR_FAILED")
    visitor.page.route("**/healthz", lambda route: route.abort())
    visitor.click("#new-project")
    visitor.wait(lambda: "does not answer" in told.inner_text(), "nothing leads away now")
    visitor.page.unroute("**/healthz")
    visitor.click("#projects-close")
    visitor.click("#project")
    assert not told.is_visible()
    visitor.click("#new-project")
    visitor.wait(told.is_visible, "it is told again")
    assert "Not all that was set is kept" in told.inner_text()
    assert led(visitor, "#new-project")
    assert visitor.page.title() == "Project 2 · ridetune"


def test_a_long_name_has_its_place_in_header_and_list(visitor):
    """Beside the widest of the other fields, which it cuts off nowhere."""
    begin(visitor, LONG[:80])
    visitor.page.select_option("#ride", "manoeuvre 2")
    visitor.settled()
    for width in (800, 1000, 1100, 1301, 1440, 1920):
        visitor.page.set_viewport_size({"width": width, "height": 800})
        visitor.page.wait_for_timeout(100)
        assert visitor.page.evaluate("document.documentElement.scrollWidth") == width
        bar = visitor.element("header.bar").first
        assert bar.evaluate("(bar) => bar.scrollWidth - bar.clientWidth") == 0
    in_header = [what for _, what in cut_off(visitor)]
    assert [what for what in in_header if not what.startswith("BDI")] == []
    visitor.click("#project")
    visitor.click("[aria-label^='Delete Wagen']")
    in_dialog = [what for _, what in cut_off(visitor) if what not in in_header]
    assert in_dialog == []
