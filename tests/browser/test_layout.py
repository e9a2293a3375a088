"""Nothing that is to be read is cut off, in the windows that people have."""

from itertools import pairwise

import pytest

from .conftest import add_file, short_run
from .cut_off import CUT, WIDTHS, cut_off

pytestmark = pytest.mark.browser


def test_the_detector_sees_what_is_cut_off(visitor):
    visitor.page.set_viewport_size({"width": 1440, "height": 900})
    visitor.page.evaluate(
        """() => {
            const narrow = { "#compare": 60, "#value-front-pivot-distance": 14,
                "label[for=value-front-suspension-stiffness]": 60 };
            for (const [selector, width] of Object.entries(narrow)) {
                document.querySelector(selector).style.width = `${width}px`;
            }
        }"""
    )
    assert len(visitor.page.evaluate(CUT)) == 3


@pytest.mark.parametrize("tab", ["comfort", "measurements", "identification", "car"])
def test_no_tab_cuts_off_what_it_says(visitor, tab):
    """Nor does anything in it make the page as a whole scroll."""
    visitor.click(f"#tab-{tab}")
    for part in visitor.element(f"#{tab} details").all():
        part.evaluate("(part) => { part.open = true; }")
    for role in visitor.element(f"#{tab}").get_by_label("Use of").all():
        role.select_option("leave_out")
    visitor.settled()
    assert cut_off(visitor) == []
    assert visitor.page.evaluate("document.documentElement.scrollHeight - innerHeight") == 0


def test_no_stage_of_a_recording_cuts_off_what_it_says(visitor):
    """The table of columns and the steps of conditioning, each in the dialog of a sample."""
    visitor.click("#tab-measurements")
    visitor.page.get_by_role("button", name="Mapping").click()
    visitor.element(".mapping-table tbody tr").first.wait_for()
    channel = visitor.page.get_by_label("Channel of suspension.fl.travel")
    channel.focus()
    assert cut_off(visitor) == []
    # The chosen channel is its name; the others are told at length.
    shown = channel.evaluate("(select) => select.selectedOptions[0].text")
    others = channel.evaluate("(select) => [...select.options].map(({ text }) => text)")
    assert shown == "suspension.fl.travel"
    assert "chassis.z · Chassis vertical displacement" in others
    visitor.page.keyboard.press("Escape")
    visitor.page.get_by_role("button", name="Conditioning").first.click()
    visitor.element(".conditioning-plot canvas").wait_for()
    assert cut_off(visitor) == []


@pytest.mark.slow
def test_no_view_of_a_fit_cuts_off_what_it_says(visitor):
    """A fit from two starts, with a profile, so that every view is there; all in one row."""
    page = visitor.page
    visitor.click("#tab-measurements")
    add_file(visitor, "ride.csv", short_run())
    visitor.until("ridetune.state('measurements').length === 3")
    page.get_by_role("button", name="Use as ride").click()
    visitor.click("#tab-identification")
    for name in ("detailed_manoeuvre_1.csv", "detailed_manoeuvre_2.csv"):
        page.get_by_label(f"Use of {name}").select_option("leave_out")
    for row in visitor.element(".free tbody tr").all()[4:]:
        row.locator("input[type=checkbox]").uncheck()
    visitor.click("summary:has-text('Search')")
    page.fill("#search-starts", "2")
    visitor.click("#start")
    visitor.until("ridetune.state('fit') !== null", 120)
    page.locator(".profile-of").first.click()
    visitor.until("ridetune.profile()?.state === 'done'", 120)
    views = visitor.element(".sub").evaluate_all("(all) => all.map(({ id }) => id)")
    assert len(views) == 7
    for view in views:
        visitor.click(f"#{view}")
        if view == "fit-advice":
            visitor.until("ridetune.advice() !== null", 120)
        assert (view, cut_off(visitor)) == (view, [])
        tops = visitor.element(".sub").evaluate_all("(all) => all.map((e) => e.offsetTop)")
        assert len(set(tops)) == 1


@pytest.mark.parametrize("count", [12, 16, 24])
def test_a_correlation_map_has_room_for_its_heads(visitor, count):
    """Side by side without touching, in sight without scrolling sideways, and named in full."""
    visitor.click("#tab-identification")
    visitor.page.evaluate(
        """async (count) => {
            const { view } = await import("/static/fit/correlation.js");
            const all = ridetune.state("parameters");
            const parameters = Array.from({ length: count }, (_, i) => all[i % all.length]);
            const correlation = parameters.map((_, i) => parameters.map((_, j) => Math.cos(i - j)));
            document.querySelector("#identification > :last-child")
                .replaceWith(view({ parameters, correlation, verdict: { combinations: [] } }));
        }""",
        count,
    )
    for width, height in WIDTHS.items():
        visitor.page.set_viewport_size({"width": width, "height": height})
        heads, box = visitor.page.evaluate(  # both at once, once the page has its new size
            """async () => {
                for (const _ of [1, 2]) await new Promise(requestAnimationFrame);
                const place = (one) => one.getBoundingClientRect();
                const all = [...document.querySelectorAll(".correlation thead th")];
                const heads = all.map((head) => {
                    const { left, right, top } = place(head.querySelector(".symbol"));
                    return { left, right, top, title: head.title };
                });
                const { right, top } = place(document.querySelector(".correlation-view .fit-main"));
                return [heads, { right, top }];
            }"""
        )
        assert len(heads) == count
        assert all(one["right"] <= other["left"] for one, other in pairwise(heads))
        assert heads[-1]["right"] <= box["right"]
        assert min(one["top"] for one in heads) >= box["top"]
        assert heads[0]["title"] == "Front spring stiffness"
