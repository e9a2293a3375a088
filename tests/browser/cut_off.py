"""What of the page cannot be read whole, in the windows that people have.

Oracle: the browser's own measure of each text against the box that holds or hides it.
"""

from .conftest import Visitor

WIDTHS = {1440: 900, 1366: 768, 1024: 768}
ROUNDING = 1.0
"""Boxes are told in whole pixels, px."""
ARROW = 18.0
"""What a list's arrow takes of it, px."""

CUT = f"""() => {{
    const pen = document.createElement("canvas").getContext("2d");
    const written = (element, text) => {{
        pen.font = getComputedStyle(element).font;
        return pen.measureText(text).width;
    }};
    const room = (element) => {{
        const {{ paddingLeft: left, paddingRight: right }} = getComputedStyle(element);
        return element.clientWidth - parseFloat(left) - parseFloat(right) + {ROUNDING};
    }};
    const isHidden = (element) => {{
        const own = getComputedStyle(element);
        if (own.display !== "inline" && own.writingMode === "horizontal-tb" &&
            element.scrollWidth > element.clientWidth + {ROUNDING}) return true;
        const range = document.createRange();
        range.selectNodeContents(element);
        const text = range.getBoundingClientRect();
        for (let box = element.parentElement; box; box = box.parentElement) {{
            if (getComputedStyle(box).overflowX === "visible") continue;
            const {{ left, right }} = box.getBoundingClientRect();
            if (text.left < left - {ROUNDING} || text.right > right + {ROUNDING}) return true;
        }}
        return false;
    }};
    return [...document.querySelectorAll("body *")]
        .filter((e) => e.checkVisibility({{ visibilityProperty: true, opacityProperty: true }}))
        .filter((e) => !e.closest(".uplot, .unseen, iframe, dialog:not([open])"))
        .filter((e) => {{
            if (e.tagName === "OPTION" || e.tagName === "OPTGROUP") return false;
            if (e.tagName === "SELECT") {{
                return written(e, e.selectedOptions[0]?.text ?? "") + {ARROW} > room(e);
            }}
            if (e.matches("input:is([type=text], [type=number])")) {{
                return written(e, e.value || e.placeholder) > room(e);
            }}
            const says = [...e.childNodes].some((n) => n.nodeType === 3 && n.data.trim());
            return says && isHidden(e);
        }})
        .map((e) => `${{e.tagName}} ${{e.className}} ${{e.ariaLabel}} ${{e.value ?? e.innerText}}`);
}}"""


def cut_off(visitor: Visitor) -> list[tuple[int, str]]:
    """What is cut off in some window: (width, what)."""
    found = []
    for width, height in WIDTHS.items():
        visitor.page.set_viewport_size({"width": width, "height": height})
        visitor.page.wait_for_timeout(150)
        found += [(width, what) for what in visitor.page.evaluate(CUT)]
    return found
