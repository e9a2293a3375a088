"""Requests that a library would send and a browser would not: methods, ranges, forms, encodings.

Oracle of the statuses: RFC 9110.
"""

import gzip
import json
import time
import zlib

import pytest
from ridetune.app.settings import Settings

from ..conftest import Visitor, open_client, short_recording

PROBLEM = "application/problem+json"
BOUNDARY = "multipart/form-data; boundary=b"


@pytest.fixture(scope="module")
def visitor(tmp_path_factory):
    """Of a service whose unexpected errors come back as 500 instead of stopping the test."""
    settings = Settings(data=tmp_path_factory.mktemp("odd"))
    with open_client(settings, raise_server_exceptions=False) as client:
        yield Visitor(client)


def described(visitor):
    """Every path of the service with the methods it takes, ids filled in."""
    for path, methods in visitor.client.get("/api/openapi.json").json()["paths"].items():
        place = path.replace("{sid}", visitor.id).replace("{form}", "csv").replace("{", "")
        yield place.replace("}", ""), {method.upper() for method in methods}


def test_a_method_that_a_route_does_not_take_is_a_problem(visitor):
    """405 with the methods there are, whatever the method; with GET there is HEAD."""
    headers = {"Authorization": f"Bearer {visitor.token}"}
    for path, methods in described(visitor):
        methods |= {"HEAD"} if "GET" in methods else set()
        for method in {"HEAD", "OPTIONS", "TRACE", "PUT", "PATCH", "DELETE", "LINK"} - methods:
            reply = visitor.client.request(method, path, headers=headers)
            assert reply.status_code == 405, (method, path)
            assert reply.headers["content-type"] == PROBLEM
            assert set(reply.headers["allow"].split(", ")) <= methods


def test_no_route_takes_a_number_that_json_lacks_however_deep(visitor):
    sent = {"Content-Type": "application/json", "Authorization": f"Bearer {visitor.token}"}
    document = visitor.client.get("/api/openapi.json").json()
    for path, methods in document["paths"].items():
        place = path.replace("{sid}", visitor.id)
        for method, operation in methods.items():
            if "application/json" not in operation.get("requestBody", {}).get("content", {}):
                continue
            for number in (b"NaN", b"1e999", b"9" * 5000):
                body = b'{"vehicle": {"front": [{"a": [1, ' + number + b"]}]}}"
                reply = visitor.client.request(method, place, content=body, headers=sent)
                # A file may say what it likes of itself: its own reader refuses it.
                files = "multipart/form-data" in operation["requestBody"]["content"]
                assert reply.status_code in ((404, 422) if files else (400,)), (method, path)


@pytest.mark.parametrize(
    ("asked", "status", "bytes_of"),
    [
        ("bytes=0-", 206, slice(0, None)),
        ("bytes=5-9", 206, slice(5, 10)),
        ("bytes=-7", 206, slice(-7, None)),
        ("bytes=0-99999999", 206, slice(0, None)),
        ("bytes=99999999-", 416, None),
        ("bytes=9-5", 400, None),
        ("bytes=x-y", 400, None),
        ("lines=1-2", 400, None),
        ("bytes=" + "9" * 5000 + "-", 400, None),
    ],
)
def test_a_range_of_an_original_is_that_part_of_it(visitor, asked, status, bytes_of):
    data = short_recording()
    mid = visitor.upload(data).json()["id"]
    reply = visitor.get(f"/measurements/{mid}/original", headers={"Range": asked})
    # A server may pass over a range that it makes nothing of (14.2).
    assert reply.status_code in (status, *([200] if status == 400 else []))
    if bytes_of is not None:
        assert reply.content == data[bytes_of]
    visitor.delete(f"/measurements/{mid}")


def test_ten_thousand_ranges_take_no_time(visitor):
    mid = visitor.get("/measurements").json()[0]["id"]
    many = "bytes=" + ",".join(f"{2 * k}-{2 * k}" for k in range(10_000))
    before = time.process_time()
    reply = visitor.get(f"/measurements/{mid}/original", headers={"Range": many})
    assert reply.status_code in (200, 206, 400, 416)
    assert len(reply.content) < 3_000_000
    assert time.process_time() - before < 10.0


@pytest.mark.parametrize("tag", ["*", '"x"', 'W/"x", "y"', "x" * 50_000, '"\x00"', ""])
def test_an_odd_condition_is_not_met_or_passed_over(visitor, tag):
    mid = visitor.get("/measurements").json()[0]["id"]
    for path in ("/static/icon.svg", f"/api/sessions/{visitor.id}/measurements/{mid}/original"):
        headers = {"If-None-Match": tag, "Authorization": f"Bearer {visitor.token}"}
        reply = visitor.client.get(path, headers=headers | {"If-Range": tag, "Range": "bytes=0-3"})
        assert reply.status_code in (200, 206, 304)


def part(name: str, content: bytes, more: str = "") -> bytes:
    head = f'--b\r\nContent-Disposition: form-data; name="{name}"{more}\r\n\r\n'
    return head.encode("latin-1") + content + b"\r\n"


FILE = part("file", short_recording(), '; filename="run.csv"')
INNER = b"--c\r\nContent-Disposition: form-data\r\n\r\nx\r\n--c--"
FORMS = {
    "ten thousand parts": (BOUNDARY, part("x", b"") * 10_000 + FILE + b"--b--\r\n"),
    "ten thousand files": (BOUNDARY, part("f", b"", '; filename="x"') * 10_000 + b"--b--\r\n"),
    "a form in a form": (
        BOUNDARY,
        part("file", INNER, "\r\nContent-Type: multipart/mixed; boundary=c") + b"--b--\r\n",
    ),
    "no boundary": ("multipart/form-data", FILE + b"--b--\r\n"),
    "an empty boundary": ("multipart/form-data; boundary=", FILE + b"--b--\r\n"),
    "another boundary": ("multipart/form-data; boundary=z", FILE + b"--b--\r\n"),
    "a boundary of two thousand": (f"multipart/form-data; boundary={'b' * 2000}", FILE),
    "no end": (BOUNDARY, FILE),
    "no head": (BOUNDARY, b"--b\r\n\r\nx\r\n--b--\r\n"),
    "a head without end": (BOUNDARY, b"--b\r\nX: " + b"x" * 1_000_000),
    "ten thousand heads": (BOUNDARY, b"--b\r\n" + b"X: y\r\n" * 10_000 + b"\r\nx\r\n--b--\r\n"),
    "nothing": (BOUNDARY, b""),
    "an unknown charset": (
        BOUNDARY,
        part("file", b"x") + part("_charset_", b"utf-99") + b"--b--\r\n",
    ),
}


# Of a form without an end, Starlette leaves the file to be closed when it is forgotten.
@pytest.mark.filterwarnings("ignore:.*SpooledTemporaryFile:pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("name", FORMS)
def test_a_form_that_is_none_is_refused_with_a_sentence(visitor, name):
    kind, body = FORMS[name]
    reply = visitor.post("/measurements", content=body, headers={"Content-Type": kind})
    assert reply.status_code in (400, 413, 422), reply.text
    assert reply.headers["content-type"] == PROBLEM
    assert reply.json()["detail"].endswith(".")


@pytest.mark.parametrize(
    "kind",
    [
        "application/json; charset=utf-16",
        "APPLICATION/JSON",
        "application/json;",
        "application/vnd.x+json",
        "application/json, text/html",
        "text/plain",
        "json",
        "/",
        "x" * 10_000,
        "application/x-www-form-urlencoded",
        BOUNDARY,
    ],
)
def test_an_odd_content_type_is_json_or_refused(visitor, kind):
    reply = visitor.post("/simulations", content=b'{"seq": -1}', headers={"Content-Type": kind})
    assert reply.status_code in (415, 422)
    assert reply.json()["status"] == reply.status_code


@pytest.mark.parametrize("coding", ["gzip", "deflate", "br", "gzip, gzip", "x" * 1000])
def test_a_packed_body_is_not_unpacked(visitor, coding):
    """A kilobyte might become a gigabyte. RFC 9110, 15.5.16: 415 with what is accepted."""
    pack = {"gzip": gzip.compress, "deflate": zlib.compress}.get(coding, lambda data: data)
    for path, kind in (("/simulations", "application/json"), ("/measurements", "text/csv")):
        reply = visitor.post(
            path,
            content=pack(json.dumps({"seq": 1}).encode()),
            headers={"Content-Type": kind, "Content-Encoding": coding},
        )
        assert (reply.status_code, reply.json()["code"]) == (415, "unsupported-media-type")
        assert reply.headers["accept-encoding"] == "identity"


def test_a_body_that_says_it_is_not_packed_is_taken(visitor):
    plain = {"Content-Encoding": "identity", "Content-Type": "text/csv"}
    reply = visitor.post("/measurements", content=short_recording(), headers=plain)
    assert reply.status_code == 201
    visitor.delete(f"/measurements/{reply.json()['id']}")


@pytest.mark.parametrize(
    "name", ['a"b;c.csv', "a\r\nX-Evil: 1.csv", "Ü→€.csv", "a%0d%0aX-Evil: 1.csv", "CON", "-o.csv"]
)
def test_a_file_goes_out_under_its_name_and_nothing_else(visitor, name):
    """No name of a file ends a header."""
    upload = f"/api/sessions/{visitor.id}/measurements"
    kept = visitor.client.post(
        upload,
        params={"name": name},
        content=short_recording(),
        headers={"Authorization": f"Bearer {visitor.token}"},
    ).json()
    for form in ("original", "run.csv", "run.toml"):
        reply = visitor.get(f"/measurements/{kept['id']}/{form}")
        assert reply.status_code == 200
        assert "x-evil" not in reply.headers
        assert reply.headers["content-disposition"].startswith("attachment; filename")
    visitor.delete(f"/measurements/{kept['id']}")


def test_gaps_of_a_recording_are_null_in_json(visitor):
    """Not-a-number in a reply would be no JSON. Oracle: Python's reader told to refuse it."""
    text = short_recording().decode().replace("time", "Zeit", 1).splitlines()
    for row in range(20, 30):
        cells = text[row].split(",")
        text[row] = ",".join([cells[0], "", *cells[2:]])
    kept = visitor.upload("\n".join(text).encode()).json()
    path = f"/measurements/{kept['id']}"
    reply = visitor.get(f"{path}/columns/preview?index=1&points=200")
    assert reply.status_code == 200, reply.text

    def refuse(name):
        raise AssertionError(name)

    [shown] = json.loads(reply.text, parse_constant=refuse)
    assert None in shown["minimum"]
    visitor.delete(path)


def test_a_clock_that_jumps_changes_no_order_and_ends_no_session(visitor, monkeypatch):
    """An hour back, then two days on: what came later is later, and every session stays."""
    wall, kept = time.time, []
    for shift in (0.0, -3600.0, 2 * 86_400.0):
        monkeypatch.setattr(time, "time", lambda: wall() + shift)
        assert Visitor(visitor.client).get().status_code == 200
        kept.append(visitor.upload(short_recording()).json()["id"])
    assert [one["id"] for one in visitor.get("/measurements").json()][-3:] == kept
    for one in kept:
        visitor.delete(f"/measurements/{one}")
