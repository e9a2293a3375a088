"""The page's modules, read as text: which imports which."""

import posixpath
import re

from ridetune.app.package_files import package_folder

ENTRIES = ("main.js", "validation/report.js", "ride/bridge.js")
"""What a document loads: the page, the report, and the 3D view's."""
LAYERS = (
    {"main.js"},
    {"campaign", "project", "validation"},
    {"fit"},
    {"recordings"},
    {"ride"},
    {"car"},
    {"common"},
)
"""From the top down; a folder imports only from those below it, and within itself."""


def modules() -> dict[str, set[str]]:
    """What each module imports, by paths within static/."""
    static = package_folder("static")
    found = {}
    for file in static.rglob("*.js"):
        name = file.relative_to(static).as_posix()
        if not name.startswith("vendor/"):
            text = file.read_text(encoding="utf-8")
            found[name] = {
                posixpath.normpath(posixpath.join(posixpath.dirname(name), other))
                for other in re.findall(r'(?:from|import) "(\.[./\w]+\.js)"', text)
            }
    return found


def test_folders_import_one_way():
    level = {folder: k for k, row in enumerate(LAYERS) for folder in row}
    against = [
        f"{name} imports {other}"
        for name, others in modules().items()
        for other in others
        if (one := name.split("/")[0]) != (another := other.split("/")[0])
        and level[one] >= level[another]
    ]
    assert against == []


def test_every_module_is_loaded_by_some_document():
    found, waiting = modules(), list(ENTRIES)
    reached: set[str] = set()
    while waiting:
        name = waiting.pop()
        if name not in reached:
            reached.add(name)
            waiting += found[name]
    assert reached == found.keys()
