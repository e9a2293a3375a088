"""Bodies that Python's reader would take and I-JSON does not have, and ones that mean nothing here.

Oracle of the status: RFC 9110, 400 for what cannot be read, 422 for what can but does not serve.
"""

import pytest
from ridetune.app.settings import Settings

from ..conftest import Visitor, open_client

UNREADABLE = {
    "not-a-number": b'{"values": {"front.pivot.angle": NaN}}',
    "infinity": b'{"values": {"front.pivot.angle": -Infinity}}',
    "overflow": b'{"values": {"front.pivot.angle": 1e999}}',
    "negative overflow": b'{"step": -1e400}',
    "huge integer": b'{"seq": ' + b"9" * 5000 + b"}",
    "deep list": b'{"manoeuvre": ' + b"[" * 100_000 + b"]" * 100_000 + b"}",
    "deep object": b'{"manoeuvre": ' + b'{"a":' * 200 + b"1" + b"}" * 200 + b"}",
    "bad UTF-8": b'{"manoeuvre": "\xff\xfe"}',
    "UTF-16": '{"seq": 1}'.encode("utf-16"),
    "half a character": b'{"vehicle": {"name": "\\ud800"}}',
    "more keys than any form has": b"{%s}" % b",".join(b'"k%d": 1' % i for i in range(1001)),
    "key twice": b'{"seq": 1, "seq": 2}',
    "cut off": b'{"seq": 1',
    "blank": b" ",
    "empty": b"",
}
UNFIT = {
    "denormal step": b'{"step": 5e-324}',
    "integer beyond float": b'{"step": ' + b"9" * 25 + b"}",
    "a list": b"[]",
    "a string": b'"manoeuvre"',
    "unknown field": b'{"modell": "8dof"}',
    "wrong type": b'{"lift_off": "perhaps"}',
    "NUL": b'{"manoeuvre": "\\u0000"}',
}


@pytest.fixture(scope="module")
def patient(tmp_path_factory):
    """A service whose unexpected errors come back as 500 instead of stopping the test."""
    settings = Settings(data=tmp_path_factory.mktemp("hostile"))
    with open_client(settings, raise_server_exceptions=False) as client:
        yield Visitor(client)


@pytest.mark.parametrize("name", [*UNREADABLE, *UNFIT])
@pytest.mark.parametrize("path", ["/simulations", "/identifications", "/vehicle"])
def test_a_hostile_body_is_refused_with_a_sentence(patient, name, path):
    method = "PUT" if path == "/vehicle" else "POST"
    reply = patient.request(
        method,
        path,
        content={**UNREADABLE, **UNFIT}[name],
        headers={"Content-Type": "application/json"},
    )
    assert reply.status_code in ((400,) if name in UNREADABLE else (404, 422))
    assert reply.headers["content-type"] == "application/problem+json"
    problem = reply.json()
    assert problem["status"] == reply.status_code
    assert problem["detail"].rstrip(")").endswith(".")
    assert len(problem["detail"]) < 500


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (b'{"step": NaN}', "NaN"),
        (b'{"step": 1e999}', "finite"),
        (b"\xff{}", "UTF-8 at byte 0"),
        (b'{"seq": 1, "seq": 2}', "twice"),
        (b'{"manoeuvre": ' + b"[" * 41 + b"]" * 41 + b"}", "40 levels"),
        (b'{"seq": 1', "character 9"),
        (b"", "body is empty"),
        (b'{"modell": "8dof"}', "field modell is not known"),
        (b'{"rims": {}}', "field rims.measurement is missing"),
    ],
)
def test_the_sentence_says_what_and_where(patient, body, said):
    reply = patient.post("/simulations", content=body, headers={"Content-Type": "application/json"})
    assert said in reply.json()["detail"]


def test_nothing_of_the_input_is_echoed(patient):
    secret = "swordfish-" * 3
    reply = patient.post(
        "/simulations", json={"lift_off": secret, "rims": {"measurement": [secret]}}
    )
    assert reply.status_code == 422
    assert "swordfish" not in reply.text


def test_another_content_type_is_not_json(patient):
    reply = patient.post("/simulations", content=b'{"seq": 1}', headers={"Content-Type": "text/x"})
    assert reply.status_code == 415
    assert "application/json" in reply.json()["detail"]
