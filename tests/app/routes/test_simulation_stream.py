"""Simulations over a websocket: of the requests that wait the newest is run."""

import asyncio
import json
import threading

import pytest
from ridetune.app.access import sockets
from ridetune.app.errors import NotFound
from ridetune.app.limits import Limits
from ridetune.app.routes import simulation_stream
from ridetune.app.routes.simulation_stream import _Newest
from ridetune.app.settings import Settings
from ridetune.app.web.shares import Shares
from ridetune.engine.vehicle_file import reference_vehicles, vehicle_to_json
from starlette.websockets import WebSocket, WebSocketDisconnect

from ..conftest import ADDRESS, Visitor, open_client
from ..loop import in_a_loop
from ..test_frames import read_binary

BINARY = {"Accept": "application/vnd.ridetune.frames"}
PAPER = vehicle_to_json(reference_vehicles()["paper"])
STIFFNESS = "front.suspension.stiffness"
PATIENCE = 20


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    with open_client(Settings(data=tmp_path_factory.mktemp("stream"))) as client:
        yield client


@pytest.fixture
def visitor(client):
    return Visitor(client)


def opened(client, visitor, **headers):
    return client.websocket_connect(
        f"{ADDRESS.replace('http', 'ws')}/api/sessions/{visitor.id}/simulations",
        headers={"Origin": ADDRESS, "Authorization": f"Bearer {visitor.token}"} | headers,
    )


def body(seq, **more):
    return {
        "vehicle": PAPER,
        "manoeuvre": "bump",
        "duration": 1.0,
        "channels": ["chassis.z"],
        "values": {STIFFNESS: 20e3 + 100 * seq},
        "seq": seq,
        **more,
    }


def answer(socket):
    """(seq, histories) of a reply."""
    head, values = read_binary(socket.receive_bytes())
    return head["seq"], values


def test_it_answers_what_the_same_request_by_post_does(client, visitor):
    with opened(client, visitor) as socket:
        socket.send_json(body(7))
        seq, values = answer(socket)
    _, posted = read_binary(visitor.post("/simulations", json=body(7), headers=BINARY).content)
    assert seq == 7
    assert values.keys() == posted.keys()
    assert all((values[name] == posted[name]).all() for name in values)


class Held:
    """The pool for interactive work, its threads held until told to go on."""

    def __init__(self, client):
        self.pool = client.app.state.services.interactive
        self.client, self.go_on = client, threading.Event()
        self.begun = threading.Semaphore(0)

    def __enter__(self):
        def hold():
            self.begun.release()
            assert self.go_on.wait(PATIENCE)

        for k in range(self.pool._width):
            self.client.portal.start_task_soon(self.pool.run, f"other {k}", hold)
        for _ in range(self.pool._width):
            assert self.begun.acquire(timeout=PATIENCE)
        return self

    def __exit__(self, *_):
        self.go_on.set()


def test_of_the_requests_that_wait_the_newest_is_run_and_no_other(client, visitor, monkeypatch):
    """Oracle: the same car by POST. What was superseded is never answered."""
    put, heard = _Newest.put, threading.Semaphore(0)
    monkeypatch.setattr(_Newest, "put", lambda *told: put(*told) or heard.release())
    with opened(client, visitor) as socket:
        with Held(client) as held:
            for seq in range(1, 6):
                socket.send_json(body(seq))
                assert heard.acquire(timeout=PATIENCE)
            assert held.pool.under_way <= held.pool._width + 1
        seq, values = answer(socket)
        assert seq == 5
        socket.send_json(body(9))
        assert answer(socket)[0] == 9
    _, posted = read_binary(visitor.post("/simulations", json=body(5), headers=BINARY).content)
    assert (values["chassis.z"] == posted["chassis.z"]).all()


@pytest.mark.parametrize(
    ("sent", "status", "code", "says"),
    [
        ("{", 400, "bad-request", "The body is not JSON"),
        ('{"seq": NaN}', 400, "bad-request", "NaN"),
        ("[" * 100_000, 400, "bad-request", "nested deeper"),
        ('{"seq": 1e999}', 400, "bad-request", "beyond 1.8e308"),
        ("\ud800", 400, "bad-request", "JSON"),
        ("[]", 422, "invalid-request", "should be an object"),
        ("12", 422, "invalid-request", "should be an object"),
    ],
)
def test_what_cannot_be_read_is_refused_and_the_next_is_answered(
    client, visitor, sent, status, code, says
):
    with opened(client, visitor) as socket:
        socket.send_bytes(sent.encode(errors="surrogatepass"))
        told = json.loads(socket.receive_text())
        assert (told["status"], told["code"]) == (status, code) or "UTF-8" in told["detail"]
        assert says in told["detail"] or "UTF-8" in told["detail"]
        socket.send_json(body(2))
        assert answer(socket)[0] == 2


@pytest.mark.parametrize(
    ("more", "status", "field"),
    [
        ({"step": 5e-324}, 422, "step"),
        ({"surprise": 1}, 422, "surprise"),
        ({"values": {"no.such": 1.0}}, 422, None),
        ({"duration": 1e9}, 422, None),
        ({"rims": {"measurement": "0" * 16}}, 404, None),
    ],
)
def test_a_problem_is_that_of_a_post_with_the_requests_number(client, visitor, more, status, field):
    asked = {**body(5), **more}
    if "rims" in more:
        del asked["manoeuvre"], asked["duration"]
    with opened(client, visitor) as socket:
        socket.send_json(asked)
        told = json.loads(socket.receive_text())
    posted = visitor.post("/simulations", json=asked)
    assert posted.status_code == told["status"] == status
    assert told.pop("seq") == 5
    assert told == posted.json()
    assert field is None or told["field"].endswith(field)


def test_where_too_much_waits_it_is_told_when_to_try_again(client, visitor, monkeypatch):
    pool = client.app.state.services.interactive
    with opened(client, visitor) as socket:
        monkeypatch.setattr(pool, "_most", 0)
        socket.send_json(body(3))
        told = json.loads(socket.receive_text())
        assert (told["status"], told["code"], told["seq"]) == (503, "unavailable", 3)
        assert told["retry_after"] >= 1
        monkeypatch.undo()
        socket.send_json(body(4))
        assert answer(socket)[0] == 4


def test_no_message_is_read_on_the_event_loop(client, visitor, monkeypatch):
    """A quarter of a second of nothing but brackets would keep everybody waiting."""
    usual, threads = simulation_stream.read, set()
    monkeypatch.setattr(
        simulation_stream, "read", lambda text: threads.add(threading.get_ident()) or usual(text)
    )
    with opened(client, visitor) as socket:
        socket.send_json(body(3, step=0))
        assert json.loads(socket.receive_text())["seq"] == 3
        monkeypatch.setattr(client.app.state.services.interactive, "_most", 0)
        socket.send_json(body(4))
        assert json.loads(socket.receive_text())["seq"] == 4
    assert threads
    assert client.portal.call(threading.get_ident) not in threads


def test_simulated_seconds_are_charged_as_by_post(client, visitor):
    asked = []
    callers = client.app.state.services.callers
    usual = callers._take_simulated
    callers._take_simulated = lambda *told: asked.append(told) or usual(*told)
    try:
        with opened(client, visitor) as socket:
            socket.send_json(body(1))
            answer(socket)
    finally:
        del callers._take_simulated
    assert asked == [(visitor.id, None, 1.0)]


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Authorization": "Bearer wrong"}, 1008),
        ({"Authorization": "Bearer rt_nonsense"}, 1008),
        ({"Origin": "http://evil.example"}, 1008),
        ({"Host": "evil.example"}, 1008),
    ],
)
def test_nobody_else_gets_one(client, visitor, headers, status):
    with (
        pytest.raises(WebSocketDisconnect) as refused,
        opened(client, visitor, **headers) as socket,
    ):
        socket.receive()
    assert refused.value.code == status


def test_it_ends_with_the_session(client, visitor, monkeypatch):
    monkeypatch.setattr(sockets, "LOOK_AGAIN_SECONDS", 0.05)
    with opened(client, visitor) as socket:
        client.app.state.services.store.sessions.delete(visitor.id)
        with pytest.raises(WebSocketDisconnect) as refused:
            socket.receive_bytes()
    assert refused.value.code == 1008


def test_a_session_has_so_many_open_and_is_told_so(client, visitor, monkeypatch):
    services = client.app.state.services
    monkeypatch.setattr(services.simulation_streams, "_most", 1)
    with opened(client, visitor):
        with (
            pytest.raises(WebSocketDisconnect) as refused,
            opened(client, visitor) as socket,
        ):
            socket.receive()
        assert refused.value.code == 1013
        assert "close one of its pages" in refused.value.reason
    assert services.simulation_streams.of(visitor.id) == 0
    with opened(client, visitor):
        pass


def test_a_tab_that_floods_is_hung_up_on(client, visitor, monkeypatch):
    """One message a second leaves room for five at once."""
    monkeypatch.setattr(Limits, "tab_messages", 1)
    monkeypatch.delitem(vars(client.app.state.services.settings.limits), "tab_messages")
    with opened(client, visitor) as socket:
        for seq in range(6):
            socket.send_json(body(seq))
        while (last := socket.receive())["type"] == "websocket.send":
            pass
    assert (last["type"], last["code"]) == ("websocket.close", 1008)


def test_a_fault_of_ours_is_hung_up_on_and_in_the_log_alone(client, visitor, monkeypatch, caplog):
    services = client.app.state.services

    def broken(*_, **__):
        raise RuntimeError("the secret of the machine")

    monkeypatch.setattr(type(services.simulators), "run", broken)
    with opened(client, visitor) as socket:
        socket.send_json(body(1))
        last = socket.receive()
    assert (last["type"], last["code"]) == ("websocket.close", 1011)
    assert "secret" not in last["reason"]
    assert "the secret of the machine" in caplog.text


def test_a_fault_in_looking_whose_it_is_is_one_of_ours(client, visitor, monkeypatch, caplog):
    async def broken(*_):
        raise RuntimeError("the secret of the machine")

    monkeypatch.setattr(sockets, "LOOK_AGAIN_SECONDS", 0.05)
    monkeypatch.setattr(sockets, "let_in", broken)
    with opened(client, visitor) as socket:
        last = socket.receive()
    assert (last["type"], last["code"]) == ("websocket.close", 1011)
    assert "the secret of the machine" in caplog.text


def connected(send):
    """An open websocket of which nothing is heard."""

    async def receive():
        return {"type": "websocket.connect"}

    return WebSocket({"type": "websocket", "headers": []}, receive, send)


def test_a_tab_that_goes_before_it_is_let_in_is_no_fault(client, visitor, caplog):
    """Its server says so by an OSError."""
    scope = {
        "type": "websocket",
        "path": f"/api/sessions/{visitor.id}/simulations",
        "query_string": b"",
        "headers": [
            (b"host", ADDRESS.removeprefix("http://").encode()),
            (b"authorization", f"Bearer {visitor.token}".encode()),
        ],
        "subprotocols": [],
    }
    sent = []

    async def receive():
        return {"type": "websocket.connect"}

    async def send(message):
        sent.append(message["type"])
        raise ConnectionError

    client.portal.call(client.app, scope, receive, send)
    assert sent == ["websocket.accept"]
    assert caplog.text == ""


def test_a_tab_that_is_gone_need_not_be_hung_up_on():
    async def send(message):
        if message["type"] == "websocket.send":
            raise ConnectionError

    async def run():
        websocket = connected(send)
        await websocket.accept()
        with pytest.raises(WebSocketDisconnect):
            await websocket.send_bytes(b"a reply")
        await sockets.hang_up(websocket, 1008)

    in_a_loop(run)


def test_who_lost_the_session_and_reads_slowly_is_hung_up_on_without_a_fault(monkeypatch):
    """A reply that is ready while the close waits for what the tab has not read."""
    closing, sent = asyncio.Event(), []

    async def lost(*_):
        raise NotFound("It is not yours.")

    async def send(message):
        sent.append(message["type"])
        if message["type"] == "websocket.close":
            closing.set()
            await asyncio.sleep(0.05)

    async def replying(websocket):
        await closing.wait()
        await websocket.send_bytes(b"a reply")

    async def run():
        websocket = connected(send)
        await websocket.accept()
        await sockets.while_theirs(websocket, "", replying(websocket))

    monkeypatch.setattr(sockets, "LOOK_AGAIN_SECONDS", 0)
    monkeypatch.setattr(sockets, "let_in", lost)
    in_a_loop(run)
    assert sent == ["websocket.accept", "websocket.close"]


def test_shares_are_given_back():
    shares = Shares(2, "{} are open.")
    with shares.one_more("one"), shares.one_more("one"), shares.one_more("two"):
        assert (shares.of("one"), shares.of("two")) == (2, 1)
    assert (shares.of("one"), shares.of("two")) == (0, 0)
