"""What a slider sends while it is moved, and what the page does where its websocket is lost."""

import json
import signal

import pytest

from .conftest import AWAY, Service

pytestmark = pytest.mark.browser

SLIDER = "front.suspension.stiffness"
MOVE = """async ([step, moves]) => {
    const slider = document.querySelector("#slider-front-suspension-stiffness");
    for (let k = 1; k <= moves; k += 1) {
        slider.value = Number(slider.value) + step;
        slider.dispatchEvent(new Event("input", { bubbles: true }));
        await new Promise((done) => setTimeout(done, 10));
    }
}"""


def drag(visitor, step=0.5):
    """Make 40 moves of so many N/mm in less than a second, and wait for what comes of them."""
    before = visitor.value(SLIDER)
    visitor.page.evaluate(MOVE, [step, 40])
    visitor.settled()
    assert visitor.value(SLIDER) == pytest.approx(before + 40e3 * step)


def assert_shown_is_simulated_with_the_sliders(visitor):
    """Oracle: the same car by a request of its own."""
    shown, posted = visitor.page.evaluate(
        """async () => {
            const api = await import("/static/common/api.js");
            const { request } = await import("/static/ride/simulation.js");
            const state = window.ridetune.state;
            const car = { vehicle: state("vehicle"), values: state("values") };
            const run = await api.simulate(request(car));
            return [state("now"), run].map(({ values }) => [...values["chassis.z"]]);
        }"""
    )
    assert shown == posted


def test_values_are_sent_while_a_run_is_under_way_and_the_last_one_is_shown(visit, service):
    sent, answered = [], []

    def watch(socket):
        if socket.url.endswith("/simulations"):
            socket.on("framesent", lambda data: sent.append(json.loads(data)["seq"]))
            socket.on("framereceived", lambda data: answered.append(data))

    visitor = visit()
    visitor.page.on("websocket", watch)
    visitor.open(service.address)
    visitor.settled()
    drag(visitor)
    assert sent == sorted(set(sent))
    assert 0 < len(answered) <= len(sent) < 40
    assert visitor.look("ridetune.state('now').head.seq") == sent[-1]
    assert_shown_is_simulated_with_the_sliders(visitor)


def test_without_websockets_every_value_is_a_request(visit, service):
    """As behind a proxy that does not pass them on; the 3D view has one, too, and is not there."""
    visitor = visit()
    visitor.page.route_web_socket("**/api/sessions/*/simulations", lambda socket: socket.close())
    visitor.open(service.address)
    visitor.settled()
    drag(visitor)
    assert_shown_is_simulated_with_the_sliders(visitor)


def test_a_websocket_that_is_lost_takes_no_run_with_it(visit, service):
    """Lost with a value on the way; the next drag has a new one."""
    lost = []

    def lose_once(socket):
        server = socket.connect_to_server()

        def passed_on(message):
            if len(lost) == 1:
                lost.append(message)
                socket.close()
            else:
                server.send(message)

        socket.on_message(passed_on)
        if not lost:
            lost.append(socket)

    visitor = visit()
    visitor.page.route_web_socket("**/api/sessions/*/simulations", lose_once)
    visitor.open(service.address)
    visitor.settled()
    drag(visitor)
    assert len(lost) == 2
    assert_shown_is_simulated_with_the_sliders(visitor)
    drag(visitor, -0.25)
    assert_shown_is_simulated_with_the_sliders(visitor)


def intercepted(visit, service, intercept):
    """A visitor of whose messages some are kept from the service: `intercept(socket, message)` says
    which, and may answer them.
    """

    def between(socket):
        server = socket.connect_to_server()
        socket.on_message(
            lambda message: None if intercept(socket, message) else server.send(message)
        )

    visitor = visit()
    visitor.page.route_web_socket("**/api/sessions/*/simulations", between)
    visitor.open(service.address)
    visitor.settled()
    return visitor


def test_where_too_much_is_asked_for_the_page_asks_less_often(visit, service):
    """Twice a second, by the newest value alone, however many were refused before."""
    busy, asked = [], []

    def refuse(socket, message):
        asked.append(message)
        if busy:
            told = {"status": 429, "code": "busy", "seq": json.loads(message)["seq"]}
            socket.send(json.dumps(told))
        return bool(busy)

    visitor = intercepted(visit, service, refuse)
    busy.append(True)
    visitor.page.evaluate(MOVE, [0.5, 40])
    visitor.page.wait_for_timeout(1500)
    before = len(asked)
    visitor.page.wait_for_timeout(2000)
    assert 2 <= len(asked) - before <= 5
    busy.clear()
    visitor.settled()
    assert_shown_is_simulated_with_the_sliders(visitor)


def test_what_the_service_cannot_do_just_now_is_told_and_asked_again(visit, service):
    sentence = "The service is busy with 80 simulations; try again in a moment."
    refusals = []

    def refuse(socket, message):
        if refusals:
            socket.send(json.dumps(refusals.pop() | {"seq": json.loads(message)["seq"]}))
            return True
        return False

    visitor = intercepted(visit, service, refuse)
    refusals.append({"status": 503, "code": "unavailable", "detail": sentence})
    before = visitor.look("ridetune.state('now').head.seq")
    visitor.page.evaluate(MOVE, [0.5, 1])
    visitor.until(f"ridetune.state('trouble')?.message === {json.dumps(sentence)}")
    visitor.until(f"ridetune.state('now').head.seq > {before} && !ridetune.state('trouble')")
    assert_shown_is_simulated_with_the_sliders(visitor)


@pytest.mark.slow
def test_a_websocket_that_falls_silent_is_given_up(visit, service):
    """As after a laptop's sleep: what is sent goes nowhere, and nobody says so."""
    silent = []
    visitor = intercepted(visit, service, lambda *_: silent)
    silent.append(True)
    drag(visitor)
    assert_shown_is_simulated_with_the_sliders(visitor)


def test_a_message_that_cannot_be_read_is_refused_and_the_next_is_answered(visit, service):
    """The service knows no number of it."""
    spoilt = []

    def spoil(socket, message):
        if spoilt:
            told = {"status": 400, "code": "bad-request", "detail": "It is not JSON."}
            socket.send(json.dumps(told))
        return bool(spoilt)

    visitor = intercepted(visit, service, spoil)
    spoilt.append(True)
    drag(visitor)
    assert visitor.look("ridetune.state('trouble').message") == "It is not JSON."
    spoilt.clear()
    drag(visitor, -0.25)
    assert visitor.look("ridetune.state('trouble')") is None
    assert_shown_is_simulated_with_the_sliders(visitor)


def test_a_value_moved_while_the_service_ends_is_simulated_by_the_next_one(visit, tmp_path):
    service = Service(tmp_path / "data", RIDETUNE_NOTICE="2")
    try:
        visitor = visit().open(service.address)
        visitor.expect(*AWAY)
        visitor.settled()
        service.process.send_signal(signal.SIGTERM)
        visitor.page.evaluate(MOVE, [0.5, 40])
        banner = visitor.element("#banner")
        visitor.wait(banner.is_visible, "the page says that the service ends")
        service.stop()
        service = Service(tmp_path / "data", service.port)
        visitor.wait(lambda: not banner.is_visible(), "the page goes on")
        visitor.settled()
        assert visitor.look("ridetune.state('trouble')") is None
        assert_shown_is_simulated_with_the_sliders(visitor)
    finally:
        service.stop()
