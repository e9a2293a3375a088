"""Two people with browsers of their own at one service, which asks who they are."""

import re
import subprocess

import pytest

from .conftest import AWAY, PROGRAM, Service


@pytest.fixture
def asking(tmp_path):
    service = Service(tmp_path / "data", login=True)
    yield service
    service.stop()


def another_link(service: Service) -> str:
    """What `ridetune link` prints beside the running service."""
    command = [*PROGRAM, "link", "--data", str(service.data)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()[1]


def get_in(visitor, link):
    visitor.page.goto(f"{link}&fixedDpr=0.4")
    visitor.wait_until_drawn()
    place = visitor.page.url
    assert re.search(r"/s/[0-9a-f]{16}/\?fixedDpr=0\.4$", place)
    return place


def test_two_people_get_in_and_not_at_each_others_cars(visit, asking):
    """By guessed pages, requests and sockets; and both stay let in over a restart."""
    anna, bert = visit(), visit()
    bert.expect("status of 403", "status of 404", "WebSocket connection", *AWAY)
    anna.expect(*AWAY)

    bert.page.goto(asking.address)
    assert "has not been let in" in bert.element("h1").inner_text()
    hers = get_in(anna, asking.link)
    bert.page.goto(asking.link)
    assert "has been used" in bert.element("h1").inner_text()
    assert "ridetune link" in bert.element("pre").inner_text()
    his = get_in(bert, another_link(asking))
    assert his != hers

    sid = hers.split("/")[4]
    guessed = bert.page.evaluate(
        """async (sid) => {
            const opened = ([path, ...protocols]) => new Promise((done) => {
                const socket = new WebSocket(`ws://${location.host}${path}`, protocols);
                socket.onopen = () => done(true);
                socket.onclose = () => done(false);
            });
            const sockets = [
                [`/s/${sid}/viewer`, "viser-v1.1.1"], [`/api/sessions/${sid}/simulations`],
            ];
            const { status } = await fetch(`/api/sessions/${sid}`);
            const own = await (await fetch("/api/sessions")).json();
            return [status, await Promise.all(sockets.map(opened)), own.length];
        }""",
        sid,
    )
    assert guessed == [404, [False, False], 1]
    bert.page.goto(hers)
    assert "is not here" in bert.element("h1").inner_text()
    bert.click(".button")
    bert.wait_until_drawn()
    assert bert.page.url.split("/")[4] == his.split("/")[4]

    asking.stop()
    again = Service(asking.data, asking.port, login=True)
    try:
        anna.page.goto(again.address)
        anna.wait_until_drawn()
        assert anna.page.url.split("/")[4] == sid
    finally:
        again.stop()
