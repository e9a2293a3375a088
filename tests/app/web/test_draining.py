"""The service ends in good order: what is under way is answered, nothing new is begun."""

import asyncio
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from importlib.metadata import version

import pytest
from ridetune.app.web.draining import Drain, Draining
from ridetune.app.web.notify import notify
from ridetune.app.web.server import Server
from starlette.responses import StreamingResponse
from uvicorn import Config

from ..live import LiveService
from ..loop import in_a_loop

HTTP = {"type": "http", "method": "GET", "path": "/", "headers": []}
SOCKET = {"type": "websocket", "path": "/", "headers": []}
PATIENCE = 30.0


def drained(app, scope, arriving, *, after):
    """What a caller is sent by an application told to end after so many messages, and what is under
    way before and after.
    """

    async def run():
        draining = Draining()
        sent, messages = [], [*arriving]
        counts = []

        async def receive():
            if messages:
                return messages.pop(0)
            await asyncio.Event().wait()

        async def send(message):
            sent.append(message)
            if len(sent) == after:
                counts.append(draining.under_way)
                draining.begin()

        await asyncio.wait_for(Drain(app, draining)(scope, receive, send), PATIENCE)
        return sent, [*counts, draining.under_way]

    return in_a_loop(run)


async def endless_stream(scope, receive, send):
    async def lines():
        while True:
            yield b"data: 1\n\n"
            await asyncio.Event().wait()

    await StreamingResponse(lines(), media_type="text/event-stream")(scope, receive, send)


def test_an_event_stream_is_ended_whole():
    """The last message says that no more comes, so that the browser sees no broken transfer."""
    arriving = [{"type": "http.request", "body": b"", "more_body": False}]
    sent, under_way = drained(endless_stream, HTTP, arriving, after=2)
    assert [message.get("body") for message in sent[1:]] == [b"data: 1\n\n", b""]
    assert not sent[-1].get("more_body")
    assert under_way == [1, 0]


def test_a_websocket_is_closed_so_that_its_client_comes_again():
    """1012 is "service restart" in IANA's registry of close codes."""

    async def listening(scope, receive, send):
        await receive()
        await send({"type": "websocket.accept"})
        assert (await receive())["type"] == "websocket.disconnect"

    sent, under_way = drained(listening, SOCKET, [{"type": "websocket.connect"}], after=1)
    assert [message["type"] for message in sent] == ["websocket.accept", "websocket.close"]
    assert sent[-1]["code"] == 1012
    assert under_way == [1, 0]


def test_an_answer_that_was_begun_is_given_to_its_end():
    async def slow(scope, receive, send):
        await receive()
        await send({"type": "http.response.start", "status": 200, "headers": []})
        waiting = asyncio.ensure_future(receive())
        await asyncio.sleep(0)
        assert not waiting.done()
        waiting.cancel()
        await send({"type": "http.response.body", "body": b"whole"})

    arriving = [{"type": "http.request", "body": b"", "more_body": False}]
    sent, _ = drained(slow, HTTP, arriving, after=1)
    assert sent[-1]["body"] == b"whole"


def test_new_requests_are_told_when_to_try_again(client):
    client.app.state.draining.begin()
    reply = client.post("/api/sessions")
    assert (reply.status_code, reply.json()["code"]) == (503, "draining")
    assert reply.headers["retry-after"] == "3"


def unfinished_request(service: LiveService) -> socket.socket:
    """A connection whose request lacks the last byte of its body; the service waits for it."""
    host, port = service.address.removeprefix("http://").split(":")
    connection = socket.create_connection((host, int(port)), timeout=PATIENCE)
    head = f"POST /api/parameters/bounds HTTP/1.1\r\nHost: {host}\r\n"
    body = json.dumps({"start": {"front.suspension.stiffness": 30000}})
    head += f"Content-Type: application/json\r\nContent-Length: {len(body)}\r\n"
    connection.sendall(f"{head}Expect: 100-continue\r\n\r\n".encode())
    assert connection.recv(1000).startswith(b"HTTP/1.1 100 ")
    connection.sendall(body[:-1].encode())
    return connection


def readiness(service: LiveService) -> str:
    try:
        with urllib.request.urlopen(f"{service.address}/readyz") as reply:
            return json.load(reply)["state"]
    except urllib.error.HTTPError as refused:
        with refused:
            return json.load(refused)["state"]


def told_to_end(service: LiveService) -> None:
    """Send SIGTERM, and wait until it shows."""
    service.process.send_signal(signal.SIGTERM)
    deadline = time.monotonic() + PATIENCE
    while readiness(service) != "draining":
        assert time.monotonic() < deadline


def test_a_request_under_way_is_answered_before_the_end(tmp_path):
    with LiveService(tmp_path / "data") as service:
        with unfinished_request(service) as connection:
            told_to_end(service)
            assert service.process.poll() is None
            connection.sendall(b"}")
            assert connection.recv(1000).startswith(b"HTTP/1.1 200 OK")
        assert service.process.wait(PATIENCE) == 0


@pytest.mark.parametrize(
    ("under_way", "goes"), [(0, [False, False, True, True]), (1, [False, False, False, True])]
)
def test_it_gives_notice_and_then_its_grace(under_way, goes):
    """Told at 10 s: 2 s of notice, and 5 s more for what is under way."""
    now, draining = [0.0], Draining()
    draining.under_way = under_way

    async def app(scope, receive, send):
        raise AssertionError

    server = Server(Config(app), draining, grace=5, notice=2, clock=lambda: now[0])

    async def at(*times):
        before = await server.on_tick(1)
        server.handle_exit(signal.SIGTERM, None)
        found = []
        for now[0] in times:
            found.append(await server.on_tick(1))
        return before, draining.begun, found

    assert in_a_loop(lambda: at(10.0, 11.9, 16.9, 17.0)) == (False, True, goes)


def test_the_log_tells_of_the_start_and_the_stop_once_each(tmp_path):
    """What an operator looks for first, and nothing that lets anybody in."""
    token = "open-sesame-of-the-forty"
    told = {"RIDETUNE_LOG": "json", "RIDETUNE_LOG_LEVEL": "INFO", "RIDETUNE_TOKEN": token}
    program = "import sys; from ridetune.app.cli import main; sys.exit(main())"
    with subprocess.Popen(
        [sys.executable, "-c", program, "serve", "--port", "0", "--data", str(tmp_path)],
        env={**os.environ, **told},
        stderr=subprocess.PIPE,
        text=True,
    ) as service:
        assert service.stderr is not None
        begin = json.loads(service.stderr.readline())
        service.send_signal(signal.SIGTERM)
        rest = service.stderr.read()
        assert service.wait(PATIENCE) == 0
    [end] = [json.loads(line) for line in rest.splitlines()]
    assert re.fullmatch(
        rf"ridetune {re.escape(version('ridetune'))} serves 127\.0\.0\.1:\d+ with data in "
        + re.escape(str(tmp_path)),
        begin["message"],
    )
    assert end["message"] == "ridetune has stopped"
    assert begin["level"] == end["level"] == "INFO"
    assert token not in f"{begin}{end}"


def test_a_second_signal_ends_it_at_once(tmp_path):
    with LiveService(tmp_path / "data") as service, unfinished_request(service):
        told_to_end(service)
        service.process.send_signal(signal.SIGTERM)
        assert service.process.wait(PATIENCE) == 128 + signal.SIGTERM


def test_a_request_that_outlasts_its_grace_is_told_so():
    """The server then cancels what is under way."""

    async def never(scope, receive, send):
        await asyncio.Event().wait()

    async def run():
        draining, sent = Draining(), []

        async def send(message):
            sent.append(message)

        request = asyncio.create_task(Drain(never, draining)(HTTP, None, send))
        await asyncio.sleep(0)
        draining.begin()
        request.cancel()
        await request
        return sent

    start, body = in_a_loop(run)
    assert start["status"] == 503
    assert json.loads(body["body"])["code"] == "draining"


def test_the_service_manager_hears_how_it_goes(tmp_path, monkeypatch):
    """Ready once it listens, alive while the event loop beats, stopping once it is told to end."""
    address = tmp_path / "notify"
    monkeypatch.setenv("NOTIFY_SOCKET", str(address))
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(address))
        manager.settimeout(PATIENCE)
        with LiveService(tmp_path / "data") as service:
            heard = [manager.recv(100)]
            while heard[-1] != b"WATCHDOG=1":
                heard.append(manager.recv(100))
            service.process.send_signal(signal.SIGTERM)
            while heard[-1] != b"STOPPING=1":
                heard.append(manager.recv(100))
            assert service.process.wait(PATIENCE) == 0
    assert b"READY=1" in heard
    assert heard[-1] == b"STOPPING=1"


@pytest.mark.parametrize("abstract", [False, True])
def test_the_service_manager_is_told(tmp_path, monkeypatch, abstract):
    """sd_notify(3): a datagram to the socket of NOTIFY_SOCKET; @ stands for a leading NUL."""
    name = f"{'@' if abstract else ''}{tmp_path / 'notify'}"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(name.replace("@", "\0", 1))
        manager.settimeout(PATIENCE)
        monkeypatch.setenv("NOTIFY_SOCKET", name)
        notify("READY=1")
        assert manager.recv(100) == b"READY=1"


def test_a_service_manager_that_is_gone_stops_nothing(tmp_path, monkeypatch, caplog):
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "gone"))
    notify("READY=1")
    assert "READY=1" in caplog.text
