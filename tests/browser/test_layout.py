"""Nothing that is to be read is cut off, in the windows that people have.

Oracle: the browser's own measure of each text against the box that holds or hides it.
"""

from itertools import pairwise

import pytest

pytestmark = pytest.mark.browser

WIDTHS = {1440: 900, 1366: 768, 1024: 768}


@pytest.mark.parametrize("count", [12, 16, 24])
def test_a_correlation_map_has_room_for_its_heads(visitor, count):
    """Side by side without touching, in sight without scrolling sideways, and named in full."""
    visitor.click("#tab-identification")
    visitor.page.evaluate(
        """async (count) => {
            const { view } = await import("/static/correlation.js");
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
        heads = visitor.element(".correlation thead th").evaluate_all(
            """(all) => all.map((head) => {
                const { left, right, top } = head.querySelector(".symbol").getBoundingClientRect();
                return { left, right, top, title: head.title };
            })"""
        )
        box = visitor.element(".correlation-view .fit-main").bounding_box()
        assert len(heads) == count
        assert all(one["right"] <= other["left"] for one, other in pairwise(heads))
        assert heads[-1]["right"] <= box["x"] + box["width"]
        assert min(one["top"] for one in heads) >= box["y"]
        assert heads[0]["title"] == "Front spring stiffness"
