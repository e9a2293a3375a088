"""The description of the REST interface, for people and for generators of clients.

FastAPI knows the paths and the forms of requests. Added here is what it cannot know: which problems
a route tells of, what a job and a measurement look like, which files come back, who may call.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from fastapi.routing import APIRoute

from .interface_shapes import (
    EXAMPLES,
    FILES,
    JOB,
    JOB_KINDS,
    MEASUREMENT,
    OWN_SESSION,
    PROBLEM,
    SHOWN,
    TEXT,
)
from .problems import MEDIA_TYPE

PROBLEMS = {
    400: "The body cannot be read.",
    401: "The bearer has the form of an API key, but no such key is known (any more).",
    403: "The request comes from another host or page, or from who was not let in.",
    404: "There is nothing by that name, or it is not the caller's.",
    406: "The reply cannot be had in the form asked for.",
    409: "What is asked for contradicts what is under way, or comes before its result is there.",
    410: "A recording that is still needed has been deleted.",
    413: "The body is over the limit.",
    415: "The body is not sent as JSON.",
    422: "A field is missing, unknown or out of range, or the engine refuses what is said.",
    429: "Too much of a session or caller is under way, or kept; Retry-After may say till when.",
    503: "The service cannot do this just now; Retry-After says when to try again.",
    507: "The disk of the service is full; nothing was kept.",
}

METHODS = ("get", "put", "post", "patch", "delete")
SESSIONS = "/api/sessions"
SESSION = f"{SESSIONS}/{{sid}}"
READING = (409, 410, 429)

ALSO: dict[str, tuple[int, ...]] = {
    "simulations_simulate": (406, *READING),
    "advice_advise": READING,
    "measurements_upload": (429,),
    "measurements_histories": (406, *READING),
    "measurements_as_csv": READING,
    "measurements_its_notes": READING,
    "measurements_set_notes": READING,
    "measurements_set_manoeuvre": (429,),
    "measurements_delete": (409,),
    "measurements_conditioning": READING,
    "measurements_set_conditioning": READING,
    "mappings_columns": READING,
    "mappings_candidate": READING,
    "mappings_columns_preview": READING,
    "mappings_set_mapping": READING,
    "mappings_forget_mapping": READING,
    "mappings_keep_mapping": (429,),
    "sessions_create": (429,),
    "sessions_change_setup": (429,),
    "sweeps_cars": (409,),
    "validations_result": (409,),
    "validations_as_report": (409,),
    "campaigns_files": (409,),
    "campaigns_one_file": (409,),
    "campaigns_archive": (409,),
    "campaigns_take_over": READING,
    **{f"{jobs}_submit": READING for jobs in JOB_KINDS},
    **{f"{jobs}_events": (429,) for jobs in JOB_KINDS},
}
"""Problems of a route beyond those of its form."""

DESCRIPTION = (
    "Everything is SI, angles in radians. Open a session with `POST /api/sessions`; with every "
    "request below it send what opens it as a bearer: the API key that made it, else its token. "
    "Errors are problem details (RFC 9457)."
)


def operation_id(route: APIRoute) -> str:
    """What a generated client calls a route: its part of the interface and what it does."""
    return f"{str(route.tags[0]).replace('-', '_')}_{route.name}" if route.tags else route.name


def describe(app: FastAPI) -> Callable[[], dict[str, Any]]:
    """What gives the description, made when it is first asked for."""

    def described() -> dict[str, Any]:
        if app.openapi_schema is None:
            document = get_openapi(
                title=app.title,
                version=app.version,
                summary=app.summary,
                description=DESCRIPTION,
                routes=app.routes,
            )
            app.openapi_schema = _completed(document)
        return app.openapi_schema

    return described


def _completed(document: dict[str, Any]) -> dict[str, Any]:
    components = document["components"]
    for unused in ("HTTPValidationError", "ValidationError"):
        components["schemas"].pop(unused, None)
    components["schemas"] |= {
        "Problem": PROBLEM,
        "Job": JOB,
        "Measurement": MEASUREMENT,
        "OwnSession": OWN_SESSION,
    }
    components["responses"] = {
        f"Problem{status}": {"description": said, "content": {MEDIA_TYPE: _reference("Problem")}}
        for status, said in PROBLEMS.items()
    }
    components["responses"]["Problem401"]["headers"] = {"WWW-Authenticate": {"schema": TEXT}}
    components["securitySchemes"] = {
        "session": {
            "type": "http",
            "scheme": "bearer",
            "description": "The API key that made the session, else the token that `POST "
            "/api/sessions` gave; a browser has that as a cookie.",
        },
        "service": {
            "type": "http",
            "scheme": "bearer",
            "description": "A key of `ridetune keys add`, or RIDETUNE_TOKEN where there is one.",
        },
    }
    for path, method, operation in _operations(document):
        _complete(path, method, operation)
    return document


def _operations(document: Mapping[str, Any]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    for path, methods in document["paths"].items():
        for method in METHODS:
            if method in methods:
                yield path, method, methods[method]


def _complete(path: str, method: str, operation: dict[str, Any]) -> None:
    name, replies = operation["operationId"], operation["responses"]
    replies.pop("422", None)
    [done] = [status for status in replies if status.startswith("2")]
    if name in FILES:
        replies[done]["content"] = {media: {"schema": _file(media)} for media in FILES[name]}
    if name in SHOWN:
        shape, many = SHOWN[name]
        one = {"$ref": f"#/components/schemas/{shape}"}
        replies[done]["content"]["application/json"] = {
            "schema": {"type": "array", "items": one} if many else one
        }
    for status in sorted(_problems(path, method, operation)):
        replies[str(status)] = {"$ref": f"#/components/responses/Problem{status}"}
    body = operation.get("requestBody", {}).get("content", {}).get("application/json")
    if body is not None and name in EXAMPLES:
        body["examples"] = {key: {"value": example} for key, example in EXAMPLES[name].items()}
    if path.startswith(SESSION):
        operation["security"] = [{"session": []}]
    elif path.startswith("/api/"):
        operation["security"] = [{}, {"service": []}]


def _problems(path: str, method: str, operation: Mapping[str, Any]) -> set[int]:
    """Statuses of problems that a route may answer with."""
    found = {403, *ALSO.get(operation["operationId"], ())}
    if path.startswith("/api/"):
        found.add(401)
    if path.startswith(SESSIONS):
        # The database may be out of reach.
        found |= {503} if method == "get" else {503, 507}
    if "{" in path:
        found.add(404)
    if operation.get("parameters"):
        found.add(422)
    if "requestBody" in operation:
        found |= {400, 413, 422}
        if "multipart/form-data" not in operation["requestBody"]["content"]:
            found.add(415)
    return found


def _file(media_type: str) -> dict[str, Any]:
    if media_type == "application/json":
        return {"type": "object"}
    bare: dict[str, Any] = {"type": "string"}
    return bare if media_type.startswith("text/") else bare | {"format": "binary"}


def _reference(shape: str) -> dict[str, Any]:
    return {"schema": {"$ref": f"#/components/schemas/{shape}"}}
