"""A validation's report: one HTML file with its data, styles and scripts in it, and no network.

The page's own modules draw it. A module that is inlined has no place that "../common/dom.js" could
be relative to, so each is named `ridetune/common/dom.js` and an import map leads there.
"""

import base64
import hashlib
import json
import posixpath
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from ...engine.channels import CHANNELS
from ...engine.parameters import ALL_PARAMETERS
from ..package_files import package_folder

ENTRY = "validation/report.js"
STYLES = ("vendor/uplot/uPlot.min.css", "validation/report.css")
PLOTS = "vendor/uplot/uPlot.iife.min.js"

SHARP = (
    "Object.defineProperty(window, 'devicePixelRatio',"
    " {value: Math.max(2, window.devicePixelRatio || 1)});"
)
"""Plots are drawn for paper, twice as fine as most screens."""

SERVED_POLICY = (
    "sandbox allow-scripts allow-modals; default-src 'none'; script-src 'unsafe-inline' data:; "
    "style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Content security policy of a report that the service sends: it is no page of ours there. Which
scripts may run is told by the policy in the file itself."""

CHANNEL_FIELDS = ("name", "label", "quantity", "unit", "display_unit", "display_factor", "sign")
MADE_WITH = ("ridetune", "numpy", "scipy", "numba")

_IMPORT = re.compile(r'((?:from|import) )"(\.\.?/[\w/]+\.js)"')


def report(document: Mapping[str, Any]) -> str:
    """The report of a validation's document (engine.validation.validation_file) as HTML."""
    static = package_folder("static")
    data = {"validation": document, "tables": _tables()}
    modules = _modules(static, ENTRY)
    plots = (static / PLOTS).read_text(encoding="utf-8").strip()
    entry = f'import "{_named(ENTRY)}";'
    imports = json.dumps({"imports": {_named(name): _data_url(text) for name, text in modules}})
    scripts = (SHARP, plots, imports, entry)
    style = "\n".join((static / name).read_text(encoding="utf-8") for name in STYLES)
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{_policy(scripts)}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Validation</title>
<style>{style}</style>
<script type="application/json" id="data">{_in_script(data)}</script>
<script>{SHARP}</script>
<script>{plots}</script>
<script type="importmap">{imports}</script>
</head>
<body>
<main><noscript>This report draws itself by a script; open it in a browser that runs scripts.\
</noscript></main>
<script type="module">{entry}</script>
</body>
</html>
"""


def made(recordings: Sequence[Mapping[str, str]], left_out: Sequence[str] = ()) -> dict[str, Any]:
    """How a document comes about now: date, versions, name and SHA-256 of each recording, and the
    names of those that could have been predicted and were left out.
    """
    return {
        "date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "versions": {name: version(name) for name in MADE_WITH},
        "recordings": [dict(one) for one in recordings],
        "left_out": list(left_out),
    }


def _tables() -> dict[str, Any]:
    """How channels and parameters are called and shown."""
    return {
        "channels": [
            {field: getattr(info, field) for field in CHANNEL_FIELDS} for info in CHANNELS.values()
        ],
        "parameters": [asdict(row) for row in ALL_PARAMETERS],
    }


def _modules(static: Path, entry: str) -> list[tuple[str, str]]:
    """The entry and all that it imports, directly or not, with their imports by name."""
    found: dict[str, str] = {}
    waiting = [entry]
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        text = (static / name).read_text(encoding="utf-8")
        found[name], others = _by_name(text, posixpath.dirname(name))
        waiting += others
    return sorted(found.items())


def _by_name(text: str, folder: str) -> tuple[str, list[str]]:
    """A module in a folder of static/ with its imports by name, and what these are in static/."""
    others: list[str] = []

    def named(match: re.Match[str]) -> str:
        others.append(posixpath.normpath(posixpath.join(folder, match[2])))
        return f'{match[1]}"{_named(others[-1])}"'

    return _IMPORT.sub(named, text), others


def _named(module: str) -> str:
    return f"ridetune/{module}"


def _data_url(text: str) -> str:
    return f"data:text/javascript;base64,{base64.b64encode(text.encode()).decode()}"


def _in_script(data: Any) -> str:
    """JSON that cannot end the script element it stands in, whatever the texts in it."""
    text = json.dumps(data, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def _policy(scripts: Iterable[str]) -> str:
    """Of scripts in the text only these run, with the modules they import; no network is asked."""
    hashes = " ".join(
        f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
        for text in scripts
    )
    return (
        f"default-src 'none'; script-src data: {hashes}; style-src 'unsafe-inline';"
        " base-uri 'none'; form-action 'none'"
    )
