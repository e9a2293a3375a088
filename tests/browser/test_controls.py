"""Number fields, messages and how things look: what is typed, told and seen on the page."""

import pytest
from ridetune.app.viewer.scene import EDGES, GHOST

pytestmark = pytest.mark.browser

STIFFNESS = "front.suspension.stiffness"


def add_message(visitor, title, kind="info"):
    visitor.page.evaluate(
        """async ([kind, title]) => {
            const { notice } = await import("/static/common/notices.js");
            notice(kind, title, "More. ".repeat(12));
        }""",
        [kind, title],
    )


def test_a_number_no_car_can_have_is_refused_in_place(visitor):
    """The value from before the typing stays, whatever the first digits would have been."""
    before = visitor.value(STIFFNESS)
    field = visitor.element("#value-front-suspension-stiffness")
    field.click()
    visitor.page.keyboard.press("Control+A")
    visitor.page.keyboard.type("50000000")
    visitor.page.keyboard.press("Tab")
    notice = visitor.element(".notice.warning")
    assert "50000000 N/mm is not accepted; give 0.1 to 10000 N/mm" in notice.inner_text()
    assert visitor.value(STIFFNESS) == before
    assert float(field.input_value()) == before / 1000
    visitor.page.keyboard.press("Escape")
    assert not notice.is_visible()


@pytest.mark.parametrize(
    ("field", "text", "said"),
    [
        ("front-suspension-stiffness", "50000000", "give 0.1 to 10000 N/mm"),
        ("front-suspension-stiffness", "1e999", "What was typed is no number; give 0.1 to"),
        ("front-pivot-distance", "0", "give 0.1 to 100 m or -100 to -0.1 m"),
        # Every number is accepted by itself; it is the car's arm that cannot be.
        ("front-pivot-angle", "85", "cannot carry the wheel up and down"),
    ],
)
def test_enter_leaves_no_refused_number_in_its_box(visitor, field, text, said):
    """Twice: the second refusal is told like the first. The value in force stays saved."""
    visitor.expect("status of 422")
    box = visitor.element(f"#value-{field}")
    name, before = field.replace("-", "."), box.input_value()
    value = visitor.value(name)
    for _ in range(2):
        box.click()
        visitor.page.keyboard.press("Control+A")
        visitor.page.keyboard.type(text)
        visitor.page.keyboard.press("Enter")
        notice = visitor.element(".notice.warning")
        visitor.wait(notice.is_visible, "the refusal is told")
        assert said in notice.inner_text()
        assert box.input_value() == before
        assert visitor.value(name) == value
        notice.locator(".dismiss").click()
        visitor.settled()
    assert not visitor.element("#chart-note").is_visible()
    visitor.wait(lambda: not visitor.look("ridetune.unsaved()"), "the value in force is saved")


def test_a_number_beyond_the_slider_is_taken_with_a_word(visitor):
    field = visitor.element("#value-front-suspension-stiffness")
    field.fill("5000")
    field.press("Enter")
    said = visitor.element(".notice.warning").inner_text()
    assert "Front spring stiffness is now 5000 N/mm" in said
    assert "beyond its slider, 5 to 100 N/mm" in said
    assert visitor.value(STIFFNESS) == 5e6
    visitor.settled()


@pytest.mark.parametrize(("width", "height"), [(1366, 768), (1440, 900), (1920, 1080)])
def test_messages_hide_neither_controls_nor_the_car(visitor, width, height):
    """Oracle: the browser's own answer to what lies under the middle of each control."""
    visitor.page.set_viewport_size({"width": width, "height": height})
    for k in range(4):
        add_message(visitor, f"A_file_whose_name_has_no_space_and_is_longer_than_the_box_{k}.csv")
    dismiss = visitor.element(".notice .dismiss").first.bounding_box()
    hidden = visitor.page.evaluate(
        """() => [...document.querySelectorAll("button, select, input, [role=separator]")]
            .filter((e) => e.checkVisibility({ visibilityProperty: true, opacityProperty: true }))
            .filter((e) => !e.closest("#notices, #parameters, .scrolls, [role=tabpanel]"))
            .filter((e) => {
                const box = e.getBoundingClientRect();
                const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
                const top = document.elementFromPoint(x, y);
                return top?.closest("#notices");
            }).map((e) => e.outerHTML)"""
    )
    assert hidden == []
    messages, view, time = (
        visitor.element(selector).bounding_box() for selector in ("#notices", "#view", "#transport")
    )
    assert view["height"] >= 150
    assert view["y"] + view["height"] <= messages["y"]
    assert messages["y"] + messages["height"] <= time["y"]
    assert (messages["x"], messages["width"]) == (view["x"], view["width"])
    assert dismiss["x"] + dismiss["width"] <= messages["x"] + messages["width"]


def test_messages_leave_by_themselves_unless_they_are_being_read(visitor):
    visitor.page.clock.install()
    add_message(visitor, "Read me")
    message = visitor.element(".notice")
    message.locator(".dismiss").focus()
    visitor.page.clock.run_for(60_000)
    assert message.is_visible()
    message.locator(".dismiss").blur()
    visitor.page.clock.run_for(60_000)
    assert not message.is_visible()


def test_messages_are_read_and_dismissed_by_keyboard(visitor):
    """The focus goes from message to message, then back to where it came from."""
    for title in ("First", "Second"):
        add_message(visitor, title)
    keyboard = visitor.page.keyboard
    visitor.element("#ghost").focus()
    while not visitor.page.evaluate("document.activeElement.closest('.notice') !== null"):
        keyboard.press("Tab")
    came_from = visitor.element("#magnification")
    assert "Second" in visitor.page.evaluate("document.activeElement.closest('.notice').innerText")
    keyboard.press("Enter")
    assert "First" in visitor.page.evaluate("document.activeElement.closest('.notice').innerText")
    keyboard.press("Escape")
    assert visitor.element(".notice").count() == 0
    assert came_from.evaluate("(slider) => slider === document.activeElement")


def test_messages_are_counted_stacked_and_all_in_reach(visitor):
    """Two are in sight; what is said again is counted; errors stay until they are dismissed."""
    visitor.page.clock.install()
    for title, kind in (
        ("A", "error"),
        ("B", "error"),
        ("C", "info"),
        ("D", "info"),
        ("B", "error"),
    ):
        add_message(visitor, title, kind)
    in_sight = visitor.element(".notice:visible strong")
    assert in_sight.all_inner_texts() == ["B.", "D."]
    assert visitor.element(".notice .badge").all_inner_texts() == ["× 2"]
    older = visitor.element("#notices-older")
    assert older.inner_text() == "2 older messages, errors among them"
    older.focus()
    visitor.page.keyboard.press("Enter")
    assert in_sight.all_inner_texts() == ["B.", "D.", "C.", "A."]
    visitor.page.clock.run_for(600_000)
    assert in_sight.all_inner_texts() == ["B.", "A."]
    assert not older.is_visible()
    for title in ("E", "F"):
        add_message(visitor, title)
    visitor.click("#notices-dismiss")
    assert visitor.element(".notice").count() == 0
    assert not older.is_visible()


def test_what_a_select_shows_is_not_cut_off(visitor):
    """Oracle: the text's own width in the select's font; 20 px hold the arrow."""
    visitor.page.select_option("#ride", "manoeuvre 1")
    visitor.page.select_option("#compare", "7dof")
    visitor.settled()
    cut = visitor.page.evaluate(
        """() => ["#ride", "#road", "#compare"].filter((selector) => {
            const select = document.querySelector(selector);
            const pen = document.createElement("canvas").getContext("2d");
            const style = getComputedStyle(select);
            pen.font = style.font;
            const { text } = select.selectedOptions[0];
            const room = select.clientWidth - 2 * parseFloat(style.paddingLeft) - 20;
            return pen.measureText(text).width > room || !select.title.startsWith(text);
        })"""
    )
    assert cut == []


def test_angles_have_one_unit(visitor):
    visitor.settled()
    text = visitor.element("body").inner_text()
    assert "Pitch, rms" in text
    assert "°" not in text


def test_a_number_field_steps_by_the_slider_and_gives_up_with_escape(visitor):
    field = visitor.element("#value-front-pivot-distance")
    field.click()
    visitor.page.keyboard.press("ArrowUp")
    assert visitor.value("front.pivot.distance") == pytest.approx(1.81)
    assert field.input_value() == "1.81"
    visitor.page.keyboard.press("Control+A")
    visitor.page.keyboard.type("3.5")
    assert visitor.value("front.pivot.distance") == 3.5
    visitor.page.keyboard.press("Escape")
    assert visitor.value("front.pivot.distance") == pytest.approx(1.8)
    assert field.input_value() == "1.8"
    visitor.settled()


def test_runs_have_one_colour_everywhere(visitor):
    """Legend, lines, numbers and the body in 3D; the eye tells their lightness apart as well."""
    legend, readings = (
        visitor.page.evaluate(
            f"""() => ["measured", "reference", "now"].map((run) =>
                getComputedStyle(document.querySelector(`{selector}`), `{pseudo}`).{style})"""
        )
        for selector, pseudo, style in (
            ("#legend .key.${run}", "::before", "borderTopColor"),
            (".reading.${run}", "", "color"),
        )
    )
    lines = visitor.page.evaluate(
        """async () => {
            const { COLOURS } = await import("/static/common/plots.js");
            const box = document.createElement("i");
            return ["measured", "reference", "now"].map((run) => {
                box.style.color = COLOURS[run];
                return box.style.color;
            });
        }"""
    )
    assert legend == readings == lines
    assert lines[1] == f"rgb{GHOST}"
    assert lines[2] == f"rgb{EDGES}"


def test_a_known_number_keeps_the_hand_in_its_field(visitor):
    visitor.click("#tab-car")
    mass, next_one = visitor.element("[title='chassis.mass'] input"), ".known input >> nth=1"
    mass.fill("1100")
    mass.press("Tab")
    visitor.until("ridetune.state('vehicle').chassis.mass === 1100")
    visitor.settled()
    assert visitor.element(next_one).evaluate("(field) => field === document.activeElement")
    # An empty field is no zero.
    mass.fill("")
    mass.press("Tab")
    assert mass.input_value() == "1100"
