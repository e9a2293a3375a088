"""Steps, lengths of time and cutoffs that nothing can be computed with, wherever a body has some.

A step of 5e-324 s makes an infinite number of steps, and its inverse no number at all.
"""

from typing import Any

import pytest
from ridetune.app.settings import Settings
from ridetune.engine.manoeuvre import manoeuvre_to_json, reference_manoeuvres
from ridetune.engine.simulation.step_limits import LONGEST_STEP, SHORTEST_STEP

from ..conftest import Visitor, open_client, short_recording

EXTREMES = (5e-324, 1e-300, 0.0, -1.0, 1e308)
BUMP = manoeuvre_to_json(reference_manoeuvres()["bump"])
ROAD = {"kind": "iso8608", "sections": [{"class": "A"}]}
DESIGN = {"kind": "full-factorial", "levels": {"K_F": [15e3, 20e3]}}
FILTERS = ("a_x_cutoff_hz", "rim_cutoff_hz", "output_cutoff_hz", "output_highpass_hz", "step")
RUN = "the id of a measurement"


def in_settings(number: float, name: str) -> dict[str, Any]:
    return {"measurement": RUN, "settings": {name: number}}


def driven(number: float) -> dict[str, Any]:
    return {"named": {**BUMP, "duration": number}}


FIELDS = {
    **{
        f"simulations: {name}": (
            "/simulations",
            lambda x, name=name: {"manoeuvre": "bump", name: x},
        )
        for name in ("step", "sample_step", "duration")
    },
    **{
        f"simulations: posts, {name}": (
            "/simulations",
            lambda x, name=name: {"posts": {"measurement": RUN}, name: x},
        )
        for name in ("step", "sample_step")
    },
    **{
        f"simulations: rims.settings.{name}": (
            "/simulations",
            lambda x, name=name: {"rims": in_settings(x, name)},
        )
        for name in FILTERS
    },
    "simulations: manoeuvre.duration": (
        "/simulations",
        lambda x: {"manoeuvre": {**BUMP, "duration": x}},
    ),
    "simulations: road.class_factor": (
        "/simulations",
        lambda x: {"manoeuvre": "2", "road": {**ROAD, "class_factor": x}},
    ),
    **{
        f"sweeps: {name}": (
            "/sweeps",
            lambda x, name=name: {"manoeuvre": "bump", "design": DESIGN, name: x},
        )
        for name in ("step", "sample_step", "duration")
    },
    **{
        f"sweeps: rims.settings.{name}": (
            "/sweeps",
            lambda x, name=name: {"rims": in_settings(x, name), "design": DESIGN},
        )
        for name in FILTERS
    },
    "sweeps: levels": (
        "/sweeps",
        lambda x: {"manoeuvre": "bump", "design": {**DESIGN, "levels": {"K_F": [x]}}},
    ),
    "campaigns: manoeuvres.duration": ("/campaigns", lambda x: {"manoeuvres": driven(x)}),
    "campaigns: class_factor": (
        "/campaigns",
        lambda x: {"manoeuvres": ["bump"], "class_factor": x},
    ),
    "campaigns: band.0": ("/campaigns", lambda x: {"manoeuvres": ["bump"], "band": [x, 10.0]}),
    "campaigns: band.1": ("/campaigns", lambda x: {"manoeuvres": ["bump"], "band": [0.01, x]}),
    "campaigns: sensors.rate_hz": (
        "/campaigns",
        lambda x: {"manoeuvres": ["bump"], "sensors": {"rate_hz": x}},
    ),
    "advice: candidates.duration": ("/advice", lambda x: {"candidates": driven(x)}),
    **{
        f"identifications: settings.{name}": (
            "/identifications",
            lambda x, name=name: {"runs": [RUN], "settings": {name: x}},
        )
        for name in FILTERS
    },
    "identifications: loss_scale": (
        "/identifications",
        lambda x: {"runs": [RUN], "loss_scale": x},
    ),
    "conditioning: resample.rate_hz": (
        "/measurements/{run}/conditioning",
        lambda x: {"steps": [{"kind": "resample", "rate_hz": x}]},
    ),
    **{
        f"setup: settings.{name}": ("/setup", lambda x, name=name: {"settings": {name: x}})
        for name in FILTERS
    },
    **{
        f"roads: {name}": ("/api/roads/preview", lambda x, name=name: {"road": ROAD, name: x})
        for name in ("length", "points")
    },
    "roads: road.class_factor": (
        "/api/roads/preview",
        lambda x: {"road": {**ROAD, "class_factor": x}},
    ),
    "mappings: step": (
        "/measurements/{raw}/mapping",
        lambda x: {"columns": [{"index": 1, "channel": "chassis.z", "unit": "m"}], "step": x},
    ),
}
"""By field, where it is sent and in what."""


@pytest.fixture(scope="module")
def visitor(tmp_path_factory):
    """Of a service whose unexpected errors come back as 500 instead of stopping the test."""
    settings = Settings(data=tmp_path_factory.mktemp("extreme"))
    with open_client(settings, raise_server_exceptions=False) as client:
        yield Visitor(client)


@pytest.fixture(scope="module")
def runs(visitor):
    """Ids of a run that can be fitted and of an upload."""
    raw = visitor.upload(short_recording()).json()["id"]
    return {"run": visitor.get("/measurements").json()[0]["id"], "raw": raw}


def with_id(asked: Any, run: str) -> Any:
    """A request in which the run is named."""
    if isinstance(asked, dict):
        return {key: with_id(value, run) for key, value in asked.items()}
    if isinstance(asked, list):
        return [with_id(value, run) for value in asked]
    return run if asked == RUN else asked


@pytest.mark.parametrize("field", FIELDS)
def test_a_number_that_nothing_can_be_done_with_is_a_sentence(visitor, runs, field):
    """And none of them is a failure of the service, or work that does not end. A low-pass above
    every frequency does nothing, and may.
    """
    path, body = FIELDS[field]
    method = {"/setup": "PATCH", "conditioning": "PUT", "mapping": "PUT"}.get(
        path.rpartition("/")[2] if path.startswith("/measurements") else path, "POST"
    )
    headers = {"Authorization": f"Bearer {visitor.token}"}
    place = path if path.startswith("/api") else f"/api/sessions/{visitor.id}{path.format(**runs)}"
    for number in EXTREMES[:-1] if field.endswith("cutoff_hz") else EXTREMES:
        asked = with_id(body(number), runs["run"])
        reply = visitor.client.request(method, place, json=asked, headers=headers)
        assert reply.status_code == 422, (number, reply.text)
        assert reply.json()["detail"].endswith(".")


@pytest.mark.parametrize("step", [SHORTEST_STEP, LONGEST_STEP])
def test_the_steps_at_the_limits_are_taken(visitor, step):
    """Oracle of the refusals: they are of the number, not of the rest of the request."""
    asked = {"manoeuvre": "bump", "duration": 0.5, "step": step}
    assert visitor.post("/simulations", json=asked).status_code == 200
