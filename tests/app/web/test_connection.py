"""What a connection may do: head and reading in time, a body at a pace; and how many may be."""

import asyncio
import json

import pytest
from ridetune.app.addresses import networks
from ridetune.app.limits import Limits
from ridetune.app.web.bodies import Body
from ridetune.app.web.connection import HEAD_BYTES, connections
from starlette.exceptions import HTTPException
from uvicorn import Config
from uvicorn.server import ServerState

from ..loop import in_a_loop

PROXIES = networks("10.0.0.1")
LIMITS = Limits(connections=1, head_seconds=10, stalled_seconds=60, body_seconds=20, body_rate=1000)
HEAD = b"GET / HTTP/1.1\r\nHost: localhost\r\n"


class Timers:
    """A loop in which time passes when it is told to, and requests are not run."""

    def __init__(self):
        self.now, self.waiting = 0.0, []

    def call_later(self, delay, call):
        timer = Timer(self.now + delay, call)
        self.waiting.append(timer)
        return timer

    def create_task(self, coroutine):
        coroutine.close()
        return NeverDone()

    def pass_by(self, seconds):
        self.now += seconds
        due = [timer for timer in self.waiting if timer.due <= self.now]
        self.waiting = [timer for timer in self.waiting if timer.due > self.now]
        for timer in due:
            if not timer.cancelled:
                timer.call()


class NeverDone:
    def add_done_callback(self, call):
        pass


class Timer:
    def __init__(self, due, call):
        self.due, self.call, self.cancelled = due, call, False

    def cancel(self):
        self.cancelled = True


class Peer:
    """The transport to one peer."""

    def __init__(self, host):
        self.ended, self.protocol, self.host = "", None, host

    def get_extra_info(self, name, default=None):
        return (self.host, 1) if name == "peername" else default

    def get_protocol(self):
        return self.protocol

    def set_protocol(self, protocol):
        self.protocol = protocol

    def is_closing(self):
        return bool(self.ended)

    def close(self):
        self.ended = self.ended or "closed"

    def abort(self):
        self.ended = self.ended or "aborted"

    def write(self, data):
        pass

    def pause_reading(self):
        pass

    def resume_reading(self):
        pass


@pytest.fixture
def loop():
    return Timers()


@pytest.fixture
def connect(loop):
    """Connections of one server, each with its peer."""
    return server(loop, LIMITS)


def server(loop, limits):
    """What makes connections to one server."""

    async def app(scope, receive, send):
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"answered"})

    http, websocket = connections(limits, PROXIES)
    config = Config(app, http=http, ws=websocket, log_config=None)
    config.load()
    state = ServerState()

    def one(host="127.0.0.1"):
        connection, peer = http(config, state, {}, loop), Peer(host)
        peer.protocol = connection
        connection.connection_made(peer)
        return connection, peer

    return one


def test_a_peer_that_says_nothing_is_let_go(connect, loop):
    _, peer = connect()
    loop.pass_by(9)
    assert peer.ended == ""
    loop.pass_by(1)
    assert peer.ended == "closed"


def test_a_head_that_trickles_in_is_not_waited_for(connect, loop):
    connection, peer = connect()
    for byte in HEAD[:10]:
        connection.data_received(bytes([byte]))
        loop.pass_by(1)
    assert peer.ended == "closed"


def test_a_head_without_end_is_not_kept(connect):
    connection, peer = connect()
    connection.data_received(HEAD)
    for k in range(1000):
        connection.data_received(b"X-%d: %s\r\n" % (k, b"x" * 1000))
        if peer.ended:
            break
    assert (peer.ended, k) == ("closed", HEAD_BYTES // 1010)


def test_a_request_may_take_its_time_once_its_head_is_there(connect, loop):
    connection, peer = connect()
    connection.data_received(HEAD + b"\r\n")
    loop.pass_by(1000)
    assert peer.ended == ""


def test_the_head_of_the_next_request_has_its_time_as_well(connect, loop):
    connection, peer = connect()
    connection.data_received(HEAD + b"\r\n")
    in_a_loop(lambda: connection.cycle.run_asgi(connection.app))
    loop.pass_by(1)
    connection.data_received(HEAD)
    loop.pass_by(9)
    assert peer.ended == ""
    loop.pass_by(1)
    assert peer.ended == "closed"


def test_a_peer_that_does_not_read_is_cut_off(connect, loop):
    connection, peer = connect()
    connection.data_received(HEAD + b"\r\n")
    connection.pause_writing()
    loop.pass_by(59)
    connection.resume_writing()
    loop.pass_by(100)
    assert peer.ended == ""
    connection.pause_writing()
    loop.pass_by(60)
    assert peer.ended == "aborted"


def answer(connection, path):
    """Status, headers and body of what a connection's application sends."""

    async def run():
        sent = []

        async def send(message):
            sent.append(message)

        scope = {"type": "http", "path": path, "headers": []}
        await connection.app(scope, None, send)
        return sent

    start, body = in_a_loop(run)
    return start["status"], dict(start["headers"]), body["body"]


def test_a_connection_too_many_is_told_when_to_come_again(connect):
    """All but the probes, so that a service under load is not taken for dead."""
    (first, _), (second, peer) = connect(), connect()
    assert answer(first, "/")[0] == 200
    status, headers, body = answer(second, "/")
    assert status == 503
    assert headers[b"retry-after"] == b"5"
    assert headers[b"connection"] == b"close"
    assert json.loads(body)["code"] == "unavailable"
    assert answer(second, "/healthz")[0] == 200
    assert peer.ended == ""


def test_twice_too_many_are_not_answered(connect):
    peers = [connect()[1] for _ in range(3)]
    assert [peer.ended for peer in peers] == ["", "", "aborted"]


@pytest.mark.parametrize(
    ("first", "second", "statuses"),
    [
        ("192.0.2.7", "192.0.2.7", (200, 503)),
        ("192.0.2.7", "192.0.2.8", (200, 200)),
        ("2001:db8:1:2::1", "2001:db8:1:2::2", (200, 503)),
        ("2001:db8:1:2::1", "2001:db8:1:3::1", (200, 200)),
        ("10.0.0.1", "10.0.0.1", (200, 200)),
        ("127.0.0.1", "127.0.0.1", (200, 200)),
    ],
)
def test_an_address_has_a_part_of_the_connections(loop, first, second, statuses):
    """Many come through a proxy, or from this machine."""
    connect = server(loop, Limits(connections=10, peer_connections=1))
    answers = [answer(connect(host)[0], "/") for host in (first, second)]
    assert tuple(status for status, _, _ in answers) == statuses
    if statuses[1] == 503:
        assert "from where you are" in json.loads(answers[1][2])["detail"]
        assert connect(second)[1].ended == "aborted"


def test_a_connection_too_many_becomes_no_websocket(connect):
    connect()
    connection, peer = connect()
    upgrade = b"Upgrade: websocket\r\nConnection: Upgrade\r\n"
    connection.data_received(HEAD + upgrade + b"\r\n")
    assert peer.ended == "closed"


def body_of(*parts, pause):
    """Take in a body whose parts come with pauses; how many came, and the status of a refusal."""
    now = [0.0]
    left = [*parts]

    async def receive():
        now[0] += pause
        return {"type": "http.request", "body": left.pop(0), "more_body": bool(left)}

    async def run():
        body = Body(receive, 10_000, "too large", LIMITS, clock=lambda: now[0])
        taken = 0
        try:
            while (await body.receive())["more_body"]:
                taken += 1
                now[0] += 1000.0
        except HTTPException as refused:
            return taken, refused.status_code
        return taken + 1, None

    return in_a_loop(run)


def test_a_body_at_the_least_pace_is_taken():
    """1000 bytes a second; the service's own 1000 s between the parts do not count."""
    assert body_of(*[bytes(1000)] * 9, pause=1.0) == (9, None)


def test_a_body_that_trickles_in_is_refused_after_its_grace():
    """100 bytes in 2 s each: 20 s and a tenth of a second for each part are over after 11."""
    assert body_of(*[bytes(100)] * 50, pause=2.0) == (11, 408)


def test_a_body_that_never_comes_is_not_waited_for():
    async def never():
        await asyncio.Event().wait()

    async def run():
        hurried = Limits(body_seconds=0.01)
        with pytest.raises(HTTPException) as refused:
            await Body(never, 1, "too large", hurried).receive()
        return refused.value

    refused = in_a_loop(run)
    assert refused.status_code == 408
    assert refused.headers == {"Connection": "close"}


def test_what_comes_after_the_body_has_all_the_time():
    """A reply that is long in the making waits for its caller to hang up."""
    now = [0.0]

    async def receive():
        now[0] += 1000.0
        return {"type": "http.request", "body": b""}

    async def run():
        body = Body(receive, 1, "too large", LIMITS, clock=lambda: now[0])
        return [await body.receive() for _ in range(3)]

    assert len(in_a_loop(run)) == 3
