"""What the log says: a line a record, with the request, the session and the job it is about; and
what it does not say.
"""

import json
import logging
import subprocess
import sys

import pytest
from fastapi import APIRouter
from ridetune.app import logs
from ridetune.app.logs import JsonLines, TextLines, about, tell
from ridetune.app.settings import Settings
from ridetune.app.web.pool import Pool
from starlette.websockets import WebSocket, WebSocketDisconnect

from .conftest import ADDRESS, Visitor, open_client
from .loop import in_a_loop

FORGED = "renamed to x\n2026-01-01T00:00:00.000Z ERROR ridetune: forged \x1b[31m"
TOKEN = "a-token-that-opens-everything"


def record(message: str, error: BaseException | None = None) -> logging.LogRecord:
    found = None if error is None else (type(error), error, error.__traceback__)
    return logging.LogRecord("ridetune.app", logging.ERROR, "file", 1, message, (), found)


def raised(message: str) -> BaseException:
    try:
        raise ValueError(message)
    except ValueError as error:
        return error


@pytest.fixture
def lines(monkeypatch):
    """Records of our own at INFO and above, as the JSON lines that they become."""
    written = []

    class Listening(logging.Handler):
        def emit(self, record):
            written.append(json.loads(JsonLines().format(record)))

    logger, handler = logging.getLogger("ridetune"), Listening()
    monkeypatch.setattr(logger, "level", logging.NOTSET)
    logger.setLevel(logging.INFO)
    logger.addHandler(handler)
    yield written
    logger.removeHandler(handler)
    logger.setLevel(logging.NOTSET)


def broken_routes() -> APIRouter:
    router = APIRouter()

    @router.get("/broken/{name}")
    async def broken(name: str) -> None:
        raise ZeroDivisionError("secret detail")

    @router.websocket("/broken")
    async def hang_up(websocket: WebSocket) -> None:
        await websocket.accept()
        raise ZeroDivisionError("secret detail")

    return router


def test_a_record_is_one_line_whatever_is_in_it():
    """Control characters are shown as Python writes them, so a message cannot look like another."""
    assert len(TextLines().format(record(FORGED)).splitlines()) == 1
    assert "\x1b" not in TextLines().format(record(FORGED))
    assert len(JsonLines().format(record(FORGED, raised(FORGED))).splitlines()) == 1


def test_only_a_record_starts_at_the_margin():
    first, *trace = TextLines().format(record("failed", raised(FORGED))).split("\n")
    assert first.endswith("ERROR ridetune.app: failed")
    assert any("ValueError" in line for line in trace)
    assert all(line.startswith("    ") for line in trace)


def test_a_json_record_says_what_it_is_about():
    with about(request="r1", session="s1"), about(job="j1"):
        tell(user="alice")
        line = json.loads(JsonLines().format(record("done", raised("why"))))
    assert {name: line[name] for name in ("level", "logger", "message")} == {
        "level": "ERROR",
        "logger": "ridetune.app",
        "message": "done",
    }
    assert [line[name] for name in ("request", "session", "job", "user")] == [
        "r1",
        "s1",
        "j1",
        "alice",
    ]
    assert "ValueError: why" in line["traceback"]
    assert "request" not in json.loads(JsonLines().format(record("after")))


def test_what_a_record_is_about_is_on_its_line_too():
    """A proxy may name a user by whatever a header can hold, such as the NEL of latin-1."""
    with about(user="anna\x85forged\x1b[2J"):
        line = TextLines().format(record("done"))
    assert len(line.splitlines()) == 1
    assert "\x1b" not in line


def test_a_request_is_told_with_its_user(client, lines):
    key = client.app.state.services.store.keys.add("script")
    lines.clear()
    client.get("/api/sessions", headers={"Authorization": f"Bearer {key}"})
    client.get("/api/sessions")
    assert [line.get("user") for line in lines] == ["key:script", None]
    assert key not in str(lines)


def test_what_a_record_is_about_goes_into_the_pool():
    async def run():
        pool = Pool("simulations", 1, share=1, most=1, at_once=1)
        with about(request="r1"):
            known = await pool.run("session", lambda: dict(logs.known_about()))
        pool.close()
        return known

    assert in_a_loop(run) == {"request": "r1"}


def test_a_request_keeps_the_id_it_comes_with(client):
    reply = client.get("/healthz", headers={"X-Request-Id": "proxy-1234.abc_D"})
    assert reply.headers["x-request-id"] == "proxy-1234.abc_D"


@pytest.mark.parametrize("stated", ["", "short", "x" * 65, "a b c d e f", "12345678\\n"])
def test_a_request_without_a_good_id_is_given_one(client, stated):
    replies = [client.get("/healthz", headers={"X-Request-Id": stated}) for _ in range(2)]
    given = {reply.headers["x-request-id"] for reply in replies}
    assert len(given) == 2
    assert stated not in given


def test_a_request_is_told_by_its_template_and_without_its_query(client, visitor, lines):
    lines.clear()
    reply = visitor.get(f"/vehicle?token={TOKEN}")
    (line,) = lines
    assert line["message"].startswith("GET /api/sessions/{sid}/vehicle 200 ")
    assert (line["method"], line["route"], line["status"]) == (
        "GET",
        "/api/sessions/{sid}/vehicle",
        200,
    )
    assert line["bytes"] == len(reply.content)
    assert (line["session"], line["request"]) == (visitor.id, reply.headers["x-request-id"])
    assert TOKEN not in json.dumps(lines)
    assert visitor.token not in json.dumps(lines)


def test_what_nobody_foresaw_is_in_the_log_alone(settings, lines):
    """In the reply the caller finds the request under which the log has it, for a person to ask."""
    with open_client(settings) as client:
        client.app.include_router(broken_routes())
        reply = client.get(f"/broken/{TOKEN}")
    assert reply.status_code == 500
    assert reply.headers["x-content-type-options"] == "nosniff"
    told = reply.json()
    assert told["code"] == "internal"
    (line,) = (line for line in lines if line["level"] == "ERROR")
    assert told["request"] == line["request"] == reply.headers["x-request-id"]
    assert "ZeroDivisionError: secret detail" in line["traceback"]
    assert "secret" not in reply.text
    assert "Division" not in reply.text
    assert TOKEN not in line["message"]


def test_a_websocket_that_fails_is_closed_without_a_word_of_why(settings, lines):
    """1011 is "internal error" in RFC 6455."""
    with open_client(settings) as client:
        client.app.include_router(broken_routes())
        with (
            client.websocket_connect(
                "ws://127.0.0.1:8000/broken", headers={"Origin": ADDRESS}
            ) as socket,
            pytest.raises(WebSocketDisconnect) as closed,
        ):
            socket.receive_text()
    assert closed.value.code == 1011
    assert "secret" not in closed.value.reason
    assert any("secret detail" in line.get("traceback", "") for line in lines)


def test_a_refusal_of_the_callers_making_names_no_request(client):
    assert "request" not in client.get("/api/nothing").json()


def test_the_form_and_the_level_are_settings(tmp_path):
    """In a process of its own, whose logging a test may change."""
    program = """if True:
        import logging, threading
        from ridetune.app.logs import configure
        configure("json", "INFO")
        logging.getLogger("ridetune.access").info("ours")
        logging.getLogger("uvicorn.error").info("theirs")
        logging.getLogger("uvicorn.error").warning("warned")
        thread = threading.Thread(target=lambda: 1 / 0, name="a-thread")
        thread.start()
        thread.join()
    """
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    told = [json.loads(line) for line in done.stderr.splitlines()]
    assert [line["message"] for line in told] == [
        "ours",
        "warned",
        "the thread a-thread ended unexpectedly",
    ]
    assert "ZeroDivisionError" in told[2]["traceback"]
    environment = {"RIDETUNE_LOG": "json", "RIDETUNE_LOG_LEVEL": "INFO"}
    settings = Settings.from_environment(data=tmp_path, environment=environment)
    assert (settings.log, settings.log_level) == ("json", "INFO")


def test_a_malformed_upload_leaves_no_line():
    """Of the parser's, for which anybody could fill the log."""
    program = """if True:
        from python_multipart.exceptions import MultipartParseError
        from python_multipart.multipart import MultipartParser
        from ridetune.app.logs import configure
        configure("text", "INFO")
        try:
            MultipartParser(b"b").write(b"--b\\r\\nContent\\xc3: x\\r\\n")
        except MultipartParseError:
            print("refused")
    """
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("refused\n", "")


def test_of_a_library_with_handlers_of_its_own_only_warnings_are_written():
    theirs = logging.getLogger("a_library.part")
    theirs.addHandler(logging.NullHandler())
    theirs.setLevel(logging.DEBUG)
    theirs.propagate = False
    logs.adopt("a_library")
    assert (theirs.handlers, theirs.propagate) == ([], True)
    assert [theirs.isEnabledFor(level) for level in (logging.INFO, logging.WARNING)] == [
        False,
        True,
    ]


def test_every_request_is_one_record(settings, lines):
    with open_client(settings) as client:
        Visitor(client).get("")
    assert [line["status"] for line in lines if line["logger"] == "ridetune.access"] == [201, 200]
