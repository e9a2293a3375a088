"""Every route below a session, from the service's own description, and a request that it takes."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ridetune.engine.manoeuvre import manoeuvre_to_json, reference_manoeuvres

SESSION = "/api/sessions/{sid}"
VALID: dict[str, dict[str, Any]] = {
    "/columns/candidate": {"params": {"index": 2, "channel": "wheel.fl.z"}},
    "/columns/preview": {"params": {"index": 2}},
    "/conditioning": {"json": {"steps": []}},
    "/manoeuvre": {"content": json.dumps(manoeuvre_to_json(reference_manoeuvres()["1"])).encode()},
    "/mapping": {"json": {"columns": [{"index": 0, "channel": "time", "unit": "s"}]}},
    "/notes": {"content": b"[noise]\n"},
}
"""What goes along, by the end of the path; else an empty object, which other bodies are not."""


@dataclass(frozen=True)
class Route:
    """One method of one path; `names` are the path's parameters."""

    method: str
    path: str

    @property
    def names(self) -> list[str]:
        return re.findall(r"{(\w+)}", self.path)

    def filled(self, values: Mapping[str, str]) -> str:
        """The address with these values, which are percent-encoded where need be."""
        return re.sub(r"{(\w+)}", lambda found: values[found[1]], self.path)

    def request(self) -> dict[str, Any]:
        """Query and body that the route takes."""
        for end, told in VALID.items():
            if self.path.endswith(end):
                reading = self.method in ("GET", "DELETE")
                return {name: told[name] for name in told if reading == (name == "params")}
        return {} if self.method in ("GET", "DELETE") else {"json": {}}


def routes(app) -> list[Route]:
    """All of them, as `/api/openapi.json` has them."""
    return [
        Route(method.upper(), path)
        for path, methods in app.openapi()["paths"].items()
        if path.startswith(SESSION)
        for method in methods
    ]
