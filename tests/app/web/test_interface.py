"""The description of the REST interface, as whoever generates a client of it reads it."""

import re

import pytest
from ridetune.app import schemas, setup_form
from ridetune.app.settings import Settings
from ridetune.app.web.interface_shapes import EXAMPLES

from tests.fuzz import interface

from ..conftest import open_client


@pytest.fixture(scope="module")
def document(tmp_path_factory):
    with open_client(Settings(data=tmp_path_factory.mktemp("described"))) as client:
        return client.get("/api/openapi.json").json()


@pytest.fixture(scope="module")
def operations(document):
    return {
        operation["operationId"]: (method, path, operation)
        for path, methods in document["paths"].items()
        for method, operation in methods.items()
    }


def test_every_route_has_a_name_that_a_client_can_have(document, operations):
    assert len(operations) == sum(len(methods) for methods in document["paths"].values())
    assert all(re.fullmatch(r"[a-z]+(_[a-z]+)*", name) for name in operations)
    assert all(operation["summary"] for *_, operation in operations.values())


def test_every_refusal_is_described_as_problem_details(document, operations):
    problems = document["components"]["responses"]
    for name, (*_, operation) in operations.items():
        refusals = {status for status in operation["responses"] if status[0] in "45"}
        for status in refusals - ({"503"} if name == "health_readyz" else set()):
            place = operation["responses"][status]["$ref"].rpartition("/")[2]
            assert list(problems[place]["content"]) == ["application/problem+json"]
    assert "HTTPValidationError" not in document["components"]["schemas"]


def test_a_key_that_is_not_known_is_a_refusal_of_every_route_of_the_interface(document, operations):
    for _, path, operation in operations.values():
        assert ("401" in operation["responses"]) == path.startswith("/api/")
    assert "WWW-Authenticate" in document["components"]["responses"]["Problem401"]["headers"]


def test_what_belongs_to_a_session_asks_for_its_token(operations):
    for _, path, operation in operations.values():
        assert ("/{sid}" in path) == (operation.get("security") == [{"session": []}])


def test_only_the_health_is_open_to_everybody(operations):
    """All else may ask for a key or the service's token; without login it does not."""
    for _, path, operation in operations.values():
        if "/{sid}" not in path:
            told = operation.get("security", [{}])
            assert ({"service": []} in told) == path.startswith("/api/")


EVERY = [(name, key) for name, examples in EXAMPLES.items() for key in examples]
IMMEDIATE = [
    (name, key)
    for name, key in EVERY
    if not (name.endswith("_submit") or "<" in str(EXAMPLES[name][key]))
]


def asked(operation, key):
    return operation["requestBody"]["content"]["application/json"]["examples"][key]["value"]


@pytest.mark.parametrize(("name", "key"), EVERY)
def test_an_example_has_the_form_of_its_request(operations, name, key):
    *_, operation = operations[name]
    form = operation["requestBody"]["content"]["application/json"]["schema"]["$ref"]
    module = setup_form if form.endswith("SetupForm") else schemas
    getattr(module, form.rpartition("/")[2]).model_validate(asked(operation, key))


@pytest.mark.parametrize(("name", "key"), IMMEDIATE)
def test_an_example_is_taken_as_it_stands(visitor, operations, name, key):
    """But for jobs and those that need an id."""
    method, path, operation = operations[name]
    place = path.replace("{sid}", visitor.id)
    place = place.replace("{mid}", visitor.get("/measurements").json()[0]["id"])
    headers = {"Authorization": f"Bearer {visitor.token}"}
    reply = visitor.client.request(method, place, json=asked(operation, key), headers=headers)
    assert str(reply.status_code) in operation["responses"], reply.text
    assert reply.status_code < 300, reply.text


@pytest.mark.slow
def test_requests_of_every_shape_are_answered_as_described():
    """Oracle: schemathesis, which reads the description; see `tests/fuzz/interface.py`."""
    assert interface.run(0.0, seed=0, quick=True) == 0
