"""HEAD, as watchers and `curl -I` send it. Oracle: RFC 9110, 9.3.2: the GET's head, no body."""

import pytest
from ridetune.app.storage.tables import sessions
from sqlalchemy import func, select

from ..conftest import open_client
from ..jobs.owned_jobs import submit
from ..live import LiveService

OF_ONE_ANSWER = ("x-request-id", "date")


def head_of(reply):
    """Status and headers, but for those that differ with every answer."""
    told = {name: value for name, value in reply.headers.items() if name not in OF_ONE_ANSWER}
    return reply.status_code, told


@pytest.fixture(scope="module")
def live(tmp_path_factory):
    """A real service: the server, too, has its say in what follows a head."""
    with LiveService(tmp_path_factory.mktemp("heads") / "data") as service:
        made = service.client.post("/api/sessions").json()
        service.client.cookies.clear()
        service.client.headers["Authorization"] = f"Bearer {made['token']}"
        yield service.client, made["id"]


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("/healthz", 200),
        ("/static/style.css", 200),
        ("/api/openapi.json", 200),
        ("/api/parameters", 200),
        ("/api/sessions", 200),
        ("/api/sessions/{sid}/vehicle", 200),
        ("/api/sessions/{sid}/measurements/{mid}/original", 200),
        ("/api/sessions/{sid}/measurements/nothing", 404),
        ("/s/{sid}/", 200),
        ("/s/{sid}/viewer/", 200),
        ("/nowhere", 404),
        ("/api/sessions/{sid}/simulations", 405),
    ],
)
def test_a_head_is_that_of_the_get_without_its_body(live, path, status):
    """One after the other on one connection, which a body would disturb."""
    client, sid = live
    mid = client.get(f"/api/sessions/{sid}/measurements").json()[0]["id"]
    path = path.format(sid=sid, mid=mid)
    got, told = client.get(path), client.head(path)
    assert told.status_code == status
    assert told.content == b""
    assert head_of(told) == head_of(got)
    assert int(told.headers["content-length"]) == len(got.content)


def test_a_head_is_of_the_whole_whatever_part_is_asked_for(live):
    """RFC 9110, 14.2: Range is for GET."""
    client, _ = live
    told = client.head("/static/style.css", headers={"Range": "bytes=0-9"})
    assert head_of(told) == head_of(client.get("/static/style.css"))


def test_nobody_follows_a_job_whose_head_was_asked_for(service, owner, clusters):
    """An event stream has no end of its own, nor would this test."""
    job = submit(owner)["id"]
    for _ in range(2 * service.app.state.services.settings.limits.session_events):
        told = owner.request("HEAD", f"/identifications/{job}/events")
        assert told.status_code == 200
        assert told.headers["content-type"].startswith("text/event-stream")
    assert service.app.state.draining.under_way == 0
    assert service.app.state.services.event_streams.of(owner.id) == 0


def test_a_head_opens_no_session_and_uses_no_link_up(settings):
    """RFC 9110, 9.2.1: a safe method. Who checks a link with `curl -I` can still follow it."""
    with open_client(settings, login=True) as client:
        store = client.app.state.services.store
        link = f"/?token={store.browsers.make_link()}"
        for path, status in (("/", 403), (link, 403)):
            told = client.head(path, follow_redirects=False)
            assert (told.status_code, dict(told.cookies)) == (status, {})
        assert client.get(link, follow_redirects=False).status_code == 303
        place = client.head("/", follow_redirects=False).headers["location"]
        assert client.get("/", follow_redirects=False).headers["location"] == place
    with open_client(settings) as client:
        assert client.head("/", follow_redirects=False).status_code == 200
        with client.app.state.services.store.database.reading() as connection:
            assert connection.execute(select(func.count()).select_from(sessions)).scalar() == 1
