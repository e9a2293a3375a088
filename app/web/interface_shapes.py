"""What the description of the REST interface shows: shapes of replies, files, examples."""

from typing import Any

TEXT: dict[str, Any] = {"type": "string"}
INSTANT = {"type": "string", "format": "date-time"}


def _or_null(shape: dict[str, Any]) -> dict[str, Any]:
    return {"anyOf": [shape, {"type": "null"}]}


def _object(required: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"type": "object", "properties": required, "required": list(required), **more}


PROBLEM = _object(
    {"type": TEXT, "title": TEXT, "status": {"type": "integer"}, "detail": TEXT, "code": TEXT},
    description="Problem details (RFC 9457): `detail` is for a person, `code` for a program, "
    "`field` the place in the request where there is one.",
)
PROBLEM["properties"] = PROBLEM["properties"] | {"field": TEXT}

JOB = _object(
    {
        "id": TEXT,
        "kind": TEXT,
        "state": {"enum": ["queued", "running", "done", "failed", "cancelled"]},
        "created": INSTANT,
        "started": _or_null(INSTANT),
        "finished": _or_null(INSTANT),
        "progress": {"type": "object"},
        "error": _or_null(_object({"code": TEXT, "detail": TEXT})),
    },
    description="A job: besides these, what was asked under the names of its request; `GET` of one "
    "has its `result` too, null until it is done.",
)

MEASUREMENT = _object(
    {
        "id": TEXT,
        "name": TEXT,
        "bytes": {"type": "integer"},
        "sha256": TEXT,
        "created": INSTANT,
        "sample": {"type": "boolean"},
        "noise": {"type": "object", "additionalProperties": {"type": "number"}},
        "needs_mapping": {"type": "boolean"},
        "same_data_as": _or_null(TEXT),
        "remarks": {"type": "array", "items": TEXT},
    },
    description="An uploaded recording; what else there is, was found in it or told of it.",
)

OWN_SESSION = _object(
    {
        "id": TEXT,
        "name": TEXT,
        "created": INSTANT,
        "seen": INSTANT,
        "measurement_count": {"type": "integer"},
    },
    description="A session of the caller's; `seen` is when it was used last, to a minute.",
)

JOB_KINDS = ("identifications", "profiles", "sweeps", "validations", "campaigns")

SHOWN: dict[str, tuple[str, bool]] = {
    "sessions_sessions": ("OwnSession", True),
    "sessions_rename": ("OwnSession", False),
    **{f"{jobs}_{name}": ("Job", False) for jobs in JOB_KINDS for name in ("submit", "one")},
    **{f"{jobs}_cancel": ("Job", False) for jobs in JOB_KINDS},
    **{f"{jobs}_all_of_session": ("Job", True) for jobs in JOB_KINDS},
    "measurements_all_of_session": ("Measurement", True),
    "campaigns_take_over": ("Measurement", True),
    **{
        f"measurements_{name}": ("Measurement", False)
        for name in ("one", "upload", "set_notes", "set_manoeuvre", "forget_manoeuvre")
    },
    "mappings_set_mapping": ("Measurement", False),
    "mappings_forget_mapping": ("Measurement", False),
}
"""Shape of a route's reply, and whether there is a list of them."""

FILES = {
    "simulations_simulate": ("application/vnd.ridetune.frames", "application/json", "text/csv"),
    "measurements_histories": ("application/vnd.ridetune.frames", "application/json"),
    "measurements_as_csv": ("text/csv",),
    "measurements_its_notes": ("application/toml",),
    "measurements_original": ("application/octet-stream",),
    "mappings_mapping": ("application/json",),
    "sweeps_cars": (
        "application/vnd.apache.parquet",
        "application/vnd.apache.arrow.file",
        "text/csv",
    ),
    "validations_result": ("application/json",),
    "validations_as_report": ("text/html",),
    "campaigns_one_file": (
        "application/octet-stream",
        "application/json",
        "application/toml",
        "text/csv",
    ),
    "campaigns_archive": ("application/zip",),
}
"""Media types of replies that are files or histories."""

RANGES = {"K_F": [15_000, 40_000], "C_F": [800, 3000]}

ROAD = {"kind": "iso8608", "sections": [{"class": "B"}]}

EXAMPLES: dict[str, dict[str, Any]] = {
    "catalogue_bounds": {"one": {"start": {"front.suspension.stiffness": 30_000}}},
    "catalogue_preview": {"rough": {"road": ROAD, "length": 100}},
    "simulations_simulate": {
        "manoeuvre": {"manoeuvre": "bump", "duration": 3, "max_samples": 500},
        "softer": {"values": {"front.suspension.stiffness": 18_000}, "channels": ["chassis.z"]},
    },
    "identifications_submit": {
        "twelve": {"runs": ["<id of a measurement>"], "key": "my-first-fit"},
        "some": {"runs": ["<id of a measurement>"], "free": ["K_F", "C_F"], "starts": 8},
    },
    "profiles_submit": {"one": {"identification": "<id>", "parameter": "d_F"}},
    "sweeps_submit": {
        "drawn": {
            "design": {"kind": "sobol", "ranges": RANGES, "cars": 64, "seed": 0},
            "manoeuvre": "bump",
            "duration": 2,
        },
        "levels": {
            "design": {
                "kind": "full-factorial",
                "levels": {"K_F": [15_000, 20_000], "C_F": {"low": 800, "high": 3000, "count": 3}},
            },
            "manoeuvre": "bump",
            "duration": 2,
        },
    },
    "validations_submit": {"one": {"identification": "<id>", "hold_out": ["<id>"]}},
    "advice_advise": {"fit": {"identification": "<id>"}, "before any run": {"planned": ["1"]}},
    "campaigns_submit": {"concept": {"manoeuvres": ["bump"], "noise": {"chassis.z": 0.0005}}},
    "measurements_set_conditioning": {"nothing": {"steps": []}},
    "sessions_create": {"named": {"name": "Car 7"}},
    "sessions_rename": {"one": {"name": "Car 7, winter tyres"}},
    "sessions_change_setup": {"search": {"starts": 8, "use": {"<id>": "hold_out"}}},
}
"""Requests by route and name."""
