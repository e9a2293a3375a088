"""Files that are brought to the page or taken away: what it says of them, and where it leads."""

import pytest

from .conftest import add_file, short_run

pytestmark = pytest.mark.browser


def test_a_file_that_is_no_measurement_is_explained_and_nothing_is_lost(visitor):
    visitor.expect("status of 422")
    visitor.click("#tab-measurements")
    add_file(visitor, "picture.csv", bytes(range(256)) * 40)
    visitor.wait(lambda: visitor.element(".problem").is_visible(), "the refusal is shown")
    text = visitor.element(".problem").inner_text()
    assert "picture.csv" in text
    assert "export the recording as CSV" in text
    assert visitor.look("ridetune.state('measurements').length") == 2


def test_a_dropped_file_is_taken_anywhere_on_the_page(visitor):
    visitor.page.evaluate(
        """(text) => {
            const data = new DataTransfer();
            data.items.add(new File([text], "dropped.csv", { type: "text/csv" }));
            const target = document.querySelector("#charts");
            for (const kind of ["dragenter", "dragover", "drop"]) {
                const event = new DragEvent(kind, { dataTransfer: data, bubbles: true,
                    cancelable: true });
                target.dispatchEvent(event);
            }
        }""",
        short_run(60).decode(),
    )
    visitor.until("ridetune.state('measurements').some(({ name }) => name === 'dropped.csv')")
    assert visitor.element("#measurements").is_visible()


def test_an_upload_with_warnings_leads_to_them(visitor):
    """Millimetres taken for metres: the file has all channels, and three doubts about them."""
    visitor.click("#tab-measurements")
    header, rest = short_run().split(b"\n", 1)
    wrong = header.replace(b"[mm]", b"[m]", 3)
    add_file(visitor, "doubtful.csv", wrong + b"\n" + rest)
    notice = visitor.element(".notice.warning")
    visitor.wait(notice.is_visible, "it is told")
    assert "ready" not in notice.inner_text()
    visitor.click("#tab-car")
    notice.get_by_role("button", name="See 3 warnings").click()
    warnings = visitor.element("#measurements .warnings")
    assert warnings.evaluate("(list) => list === document.activeElement")
    assert warnings.locator("li").count() == 3
    box = warnings.bounding_box()
    assert box["y"] + box["height"] <= 768


def test_without_a_measurement_the_page_says_what_to_do(visitor):
    visitor.click("#tab-measurements")
    for left in (1, 0):
        visitor.click(".measurement-detail button.danger")
        visitor.click(".measurement-detail button.danger")
        visitor.until(f"ridetune.state('measurements').length === {left}")
        where = visitor.page.evaluate(
            "document.activeElement.closest('.measurement-list') !== null"
        )
        assert where, "the focus stays with the list"
    assert "Add a recording: CSV" in visitor.element("#measurements").inner_text()
    visitor.until("ridetune.state('ride').kind === 'manoeuvre' && ridetune.state('now') !== null")
    visitor.click("#identify")
    assert "at least one measured run" in visitor.element("#notices").inner_text()
