"""The 3D view's way through our own address: whose it is, what it may load, what it passes on."""

import time

import httpx2
import msgspec
import pytest
from ridetune.app.access import sockets
from ridetune.app.errors import Busy, Unavailable
from ridetune.app.limits import Limits
from ridetune.app.viewer.relay import Viewers, relay
from ridetune.app.viewer.viser_servers import ADMISSION, HEADER
from ridetune.engine.vehicle_file import reference_vehicles
from starlette.websockets import WebSocket, WebSocketDisconnect
from viser import __version__ as viser_version
from viser import _messages as messages
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from ..conftest import ADDRESS

PROTOCOL = f"viser-v{viser_version}"
SOCKETS = ADDRESS.replace("http", "ws")


@pytest.fixture
def viewers():
    viewers = Viewers()
    yield viewers
    viewers.close()


@pytest.fixture
def car():
    return reference_vehicles()["paper"]


def bearer(visitor):
    return {"Authorization": f"Bearer {visitor.token}"}


def open_socket(client, visitor, protocol=PROTOCOL, **headers):
    return client.websocket_connect(
        f"{SOCKETS}/s/{visitor.id}/viewer",
        subprotocols=[protocol],
        headers={"Origin": ADDRESS} | bearer(visitor) | headers,
    )


def test_the_page_is_visers_own_with_the_bridge_before_it(client, visitor):
    page = client.get(f"/s/{visitor.id}/viewer/", headers=bearer(visitor))
    assert page.status_code == 200
    assert page.text.index("window.bridge") < page.text.index("<title>")


def test_the_page_may_talk_to_nobody_but_this_service(client, visitor):
    """viser's ?websocket= would let a stranger's scene run in our origin."""
    policy = client.get(f"/s/{visitor.id}/viewer/", headers=bearer(visitor)).headers[
        "content-security-policy"
    ]
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == "'none'"
    assert rules["connect-src"] == "'self' data: blob:"
    assert rules["frame-ancestors"] == "'self'"


def test_a_strangers_view_is_not_found(client, visitor):
    other = {"Authorization": "Bearer wrong"}
    assert client.get(f"/s/{visitor.id}/viewer/", headers=other).status_code == 404
    with (
        pytest.raises(WebSocketDisconnect) as refused,
        open_socket(client, visitor, **other),
    ):
        pass
    assert refused.value.code == 1008


def test_a_page_of_another_origin_gets_no_socket(client, visitor):
    with (
        pytest.raises(WebSocketDisconnect),
        open_socket(client, visitor, Origin="http://evil.example"),
    ):
        pass


def test_the_relay_brings_the_scene_to_the_browser(client, visitor, car):
    client.app.state.services.viewers.show(visitor.id, car)
    with open_socket(client, visitor) as socket:
        assert socket.accepted_subprotocol == PROTOCOL
        received = b""
        while b"viser" not in received and len(received) < 100_000:
            received += socket.receive_bytes()
    assert len(received) > 1000


def read_on(socket):
    while True:
        socket.receive_bytes()


def test_an_open_view_ends_with_the_session(client, visitor, monkeypatch):
    monkeypatch.setattr(sockets, "LOOK_AGAIN_SECONDS", 0.05)
    with open_socket(client, visitor) as socket:
        assert socket.receive_bytes()
        client.app.state.services.store.sessions.delete(visitor.id)
        with pytest.raises(WebSocketDisconnect) as refused:
            read_on(socket)
    assert refused.value.code == 1008


def test_a_key_that_is_not_known_opens_no_view_and_is_told_so(client, visitor):
    with (
        pytest.raises(WebSocketDisconnect) as refused,
        open_socket(client, visitor, Authorization="Bearer rt_nonsense"),
    ):
        pass
    assert refused.value.code == 1008
    assert "ridetune keys add" in refused.value.reason


def test_an_open_view_ends_with_its_key(client, monkeypatch):
    monkeypatch.setattr(sockets, "LOOK_AGAIN_SECONDS", 0.05)
    keys = client.app.state.services.store.keys
    rig = {"Authorization": f"Bearer {keys.add('rig')}"}
    sid = client.post("/api/sessions", headers=rig).json()["id"]
    address = f"{SOCKETS}/s/{sid}/viewer"
    with client.websocket_connect(address, subprotocols=[PROTOCOL], headers=rig) as socket:
        assert socket.receive_bytes()
        keys.remove("rig")
        with pytest.raises(WebSocketDisconnect) as refused:
            read_on(socket)
    assert refused.value.code == 1008


def test_an_open_view_outlasts_a_database_that_is_away(client, visitor, monkeypatch):
    monkeypatch.setattr(sockets, "LOOK_AGAIN_SECONDS", 0.01)
    usual, looks = sockets.session_of, []

    def away(*told):
        looks.append(told)
        if 2 <= len(looks) <= 4:
            raise Unavailable("It is away.")
        return usual(*told)

    monkeypatch.setattr(sockets, "session_of", away)
    with open_socket(client, visitor) as socket:
        deadline = time.monotonic() + 20
        while len(looks) < 6:
            assert time.monotonic() < deadline
            time.sleep(0.01)
        client.app.state.services.store.sessions.delete(visitor.id)
        with pytest.raises(WebSocketDisconnect) as refused:
            read_on(socket)
    assert refused.value.code == 1008


def test_a_view_of_a_database_that_is_away_is_put_off(client, visitor, monkeypatch, caplog):
    def away(*_):
        raise Unavailable("It is away.")

    monkeypatch.setattr(sockets, "session_of", away)
    with pytest.raises(WebSocketDisconnect) as refused, open_socket(client, visitor):
        pass
    assert refused.value.code == 1013
    assert "unexpected" not in caplog.text


def test_a_client_of_another_version_is_told_so(client, visitor):
    with (
        open_socket(client, visitor, "viser-v0.0.1") as socket,
        pytest.raises(WebSocketDisconnect) as refused,
    ):
        socket.receive_bytes()
    assert refused.value.code == 1002


@pytest.mark.parametrize("token", ["its own", "wrong"])
def test_a_tab_that_is_gone_before_it_is_answered_is_no_error(client, visitor, token):
    """As in a page that is loaded again; the server says so by an OSError on whatever is sent."""
    bearer = visitor.token if token == "its own" else token
    scope = {
        "type": "websocket",
        "app": client.app,
        "path": f"/s/{visitor.id}/viewer",
        "query_string": b"",
        "headers": [(b"authorization", f"Bearer {bearer}".encode())],
        "subprotocols": [PROTOCOL],
    }
    sent = []

    async def receive():
        return {"type": "websocket.connect"}

    async def send(message):
        sent.append(message["type"])
        raise OSError

    client.portal.call(relay, WebSocket(scope, receive, send), visitor.id)
    assert sent == [*(["websocket.accept"] if token == "its own" else []), "websocket.close"]
    assert client.app.state.services.viewers.start(visitor.id).watchers == 0


def test_each_session_has_a_viewer_of_its_own(viewers, car):
    viewers.show("a", car)
    viewers.show("b", car)
    assert viewers.start("a") is viewers.start("a")
    assert viewers.start("a").address != viewers.start("b").address


def test_viewers_listen_on_loopback_only(viewers):
    assert viewers.start("a").server.get_host() == "127.0.0.1"


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Origin": "http://evil.example"},
        {"Origin": ADDRESS},
        {HEADER: ""},
        {HEADER: "guessed"},
        ADMISSION | {HEADER.lower(): "twice"},
    ],
    ids=["a process", "a page elsewhere", "our own page", "nothing", "a guess", "two"],
)
def test_nobody_gets_past_the_relay_to_visers_own_port(viewers, car, headers):
    """Neither a socket nor a page: whoever reaches the port must bring this process's secret."""
    viewers.show("a", car)
    address = viewers.start("a").address
    with pytest.raises(InvalidStatus) as refused:
        connect(address, subprotocols=[PROTOCOL], additional_headers=list(headers.items()))
    assert refused.value.response.status_code == 403
    page = httpx2.get(address.replace("ws", "http"), headers=list(headers.items()))
    assert (page.status_code, page.content) == (403, b"")


def test_the_relays_own_way_leads_to_the_scene(viewers, car):
    """Oracle of the refusals: the same connection with the secret is answered."""
    viewers.show("a", car)
    address = viewers.start("a").address
    with connect(address, subprotocols=[PROTOCOL], additional_headers=ADMISSION) as socket:
        assert len(socket.recv(timeout=30)) > 1000


def test_no_tab_can_open_a_tunnel_to_the_world(viewers):
    handlers = viewers.start("a").server._websock_server._incoming_handlers
    assert messages.ShareUrlRequest not in handlers


def test_a_session_has_its_view_in_so_many_tabs(viewers):
    viewers.limits = Limits(session_viewers=2)
    for _ in range(2):
        viewers.watch("a", 1)
    with pytest.raises(Busy, match="2 tabs"):
        viewers.watch("a", 1)
    viewers.watch("a", -1)
    assert viewers.watch("a", 1).watchers == 2


def test_a_view_that_nobody_watches_makes_room(viewers, car):
    viewers.limits = Limits(viewers=1)
    viewers.show("unwatched", car)
    viewers.watch("watched", 1)
    assert viewers.count() == 1
    with pytest.raises(Unavailable):
        viewers.watch("late", 1)
    viewers.show("late", car)
    assert viewers.count() == 1


def test_a_tab_too_many_is_told_so(client, visitor):
    client.app.state.services.viewers.limits = Limits(session_viewers=1)
    with (
        open_socket(client, visitor),
        pytest.raises(WebSocketDisconnect) as refused,
        open_socket(client, visitor),
    ):
        pass
    assert refused.value.code == 1013


def test_a_browser_that_floods_is_hung_up_on(client, visitor):
    """One message a second leaves room for five at once."""
    harmless = msgspec.msgpack.encode(messages.GuiCloseModalMessage("none").as_serializable_dict())
    client.app.state.services.viewers.limits = Limits(tab_messages=1)
    with open_socket(client, visitor) as socket:
        for _ in range(6):
            socket.send_bytes(harmless)
        while (last := socket.receive())["type"] == "websocket.send":
            pass
    assert (last["type"], last["code"]) == ("websocket.close", 1008)


def test_only_unwatched_viewers_are_reaped(viewers):
    viewers.limits = Limits(unwatched_seconds=1e-6)
    viewers.watch("watched", 1)
    gone = viewers.start("gone")
    time.sleep(0.01)
    viewers.reap()
    assert viewers.start("gone") is not gone
    assert viewers.start("watched").watchers == 1


def test_stopping_what_is_not_there_is_nothing(viewers):
    viewers.stop("nobody")
    viewers.reap()


def test_starting_prints_no_banner(viewers, capsys):
    viewers.start("a")
    assert capsys.readouterr().out == ""
