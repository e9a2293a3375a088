"""Who may use the service: by a link, the service's token, a key, or by the word of a proxy."""

import re

import pytest
from fastapi.testclient import TestClient
from ridetune.app.addresses import networks
from ridetune.app.limits import Limits
from ridetune.app.settings import Settings
from ridetune.app.storage import session_store
from ridetune.app.storage.tables import browsers
from sqlalchemy import func, select

from ..conftest import ADDRESS, open_client

PROXY = "10.0.0.1"


@pytest.fixture
def client(settings):
    """A browser that nobody has let in."""
    with open_client(settings, login=True) as client:
        yield client


def another(client, address=ADDRESS, peer="testclient"):
    """Another browser, or program, at the same service."""
    return TestClient(client.app, base_url=address, client=(peer, 50_000))


def stores(client):
    return client.app.state.services.store


def link(client):
    return f"/?token={stores(client).browsers.make_link()}"


def bearer(token):
    return {"Authorization": f"Bearer {token}"}


def go(client, path="/", **options):
    return client.get(path, follow_redirects=False, **options)


def test_who_was_not_let_in_gets_nothing_but_a_page_that_says_what_to_do(client, settings):
    page = go(client)
    assert page.status_code == 403
    assert f"ridetune link --data {settings.data}" in page.text
    assert page.headers["referrer-policy"] == "no-referrer"
    assert client.post("/api/sessions").status_code == 403
    for path in ("/api/parameters", "/api/vehicles/paper", "/api/sensors"):
        refused = client.post(path) if path.endswith("sensors") else client.get(path)
        assert refused.status_code == 403
        assert "ridetune link" in refused.json()["detail"]
    assert client.get("/api/sessions").json() == []
    assert stores(client).owners.sessions(user=None, tokens=[]) == []
    assert not client.cookies


@pytest.mark.parametrize(
    ("path", "status"),
    [("/api/roads/preview", 403), ("/api/sessions/0123456789abcdef/simulations", 404)],
)
def test_nothing_is_read_of_who_was_not_let_in(client, monkeypatch, path, status):
    """4 MB of JSON are most of a second's work, which nobody should do for a stranger."""
    read = []
    monkeypatch.setattr("ridetune.app.routes.strict_json.loads", read.append)
    assert client.post(path, json={}).status_code == status
    assert client.post(path, content=b"").status_code == status
    assert read == []


def test_whether_the_service_runs_is_told_to_everybody(client):
    for path in ("/healthz", "/readyz", "/static/style.css"):
        assert client.get(path).status_code == 200


def test_a_link_lets_one_browser_in_and_leaves_the_address(client):
    opened = link(client)
    first = go(client, f"{opened}&fixedDpr=0.5")
    assert first.status_code == 303
    assert re.fullmatch(r"/s/[0-9a-f]{16}/\?fixedDpr=0\.5", first.headers["location"])
    assert client.get("/api/parameters").status_code == 200
    assert client.post("/api/sessions").status_code == 201
    # Once more in the same browser, as a prefetching one does.
    again = go(client, opened)
    assert (again.status_code, "token" in again.headers["location"]) == (303, False)
    elsewhere = go(another(client), opened)
    assert elsewhere.status_code == 403
    assert "has been used" in elsewhere.text
    assert "ridetune link" in elsewhere.text
    assert "set-cookie" not in elsewhere.headers


def test_a_browser_that_is_in_uses_a_link_up_all_the_same(client):
    """Nobody finds one that still works in its history."""
    go(client, link(client))
    opened = link(client)
    assert go(client, opened).status_code == 303
    assert go(another(client), opened).status_code == 403


def test_a_browser_stays_let_in_over_restarts(settings):
    with open_client(settings, login=True) as before:
        place = go(before, link(before)).headers["location"]
        cookies = dict(before.cookies)
    with open_client(settings, login=True) as after:
        after.cookies.update(cookies)
        assert go(after).headers["location"] == place
        assert after.post("/api/sessions").status_code == 201


def test_a_browser_that_only_has_a_session_keeps_it(client):
    """As one of before there were links; but it begins no other."""
    sid, token = stores(client).sessions.create({"name": "a car"}, [])
    client.cookies.set(f"ridetune_{sid}", token)
    assert go(client).headers["location"] == f"/s/{sid}/"
    assert client.get("/api/parameters").status_code == 200
    assert client.post("/api/sessions").status_code == 403


def test_the_cookie_is_hidden_from_scripts_and_other_sites(client):
    [access, session] = go(client, link(client)).headers.get_list("set-cookie")
    assert access.startswith("ridetune-access-8000=")
    assert session.startswith("ridetune_")
    for cookie in (access, session):
        assert {"HttpOnly", "Path=/", "SameSite=strict"} <= set(cookie.split("; "))


def test_the_cookies_are_given_anew_with_every_page(client):
    """So that they last for as long as the browser comes back."""
    page = go(client, link(client)).headers["location"]
    given = go(client, page).headers.get_list("set-cookie")
    assert [cookie.partition("=")[0] for cookie in given] == list(client.cookies)


def test_services_on_two_ports_do_not_lose_each_others_browsers(client):
    """A browser sends a cookie to every port of a host."""
    both = another(client, "http://127.0.0.1:9000")
    go(both, link(client))
    both.base_url = ADDRESS
    go(both, link(client))
    for address in (ADDRESS, "http://127.0.0.1:9000"):
        both.base_url = address
        assert go(both).status_code == 303


def test_without_login_everybody_on_this_machine_is_in(settings):
    with open_client(settings) as client:
        assert go(client).status_code == 303
        assert client.post("/api/sessions").status_code == 201


# The service's token


def test_the_services_token_lets_in_whoever_brings_it(tmp_path):
    """As often as they like, in the address or as a bearer; a link does so, too."""
    with open_client(Settings(data=tmp_path, token="open sesame"), login=True) as client:
        assert "/?token=" in go(client).text
        for browser in (client, another(client)):
            assert go(browser, "/?token=open%20sesame").status_code == 303
            assert browser.post("/api/sessions").status_code == 201
        program = another(client)
        assert program.post("/api/sessions").status_code == 403
        for wrong in ("open", "open sesame!", "öpen sesame"):
            brought = {"Authorization": f"Bearer {wrong}".encode()}
            assert program.post("/api/sessions", headers=brought).status_code == 403
        assert program.post("/api/sessions", headers=bearer("open sesame")).status_code == 201
        assert go(another(client), link(client)).status_code == 303


def test_another_token_ends_the_browsers_of_the_former_one(tmp_path):
    """They begin no session; those let in by a link do."""

    def visits(token, cookies):
        with open_client(Settings(data=tmp_path, token=token), login=True) as client:
            client.cookies.update(cookies)
            return client.post("/api/sessions").status_code

    with open_client(Settings(data=tmp_path, token="sesame"), login=True) as client:
        by_link = another(client)
        go(by_link, link(client))
        go(client, "/?token=sesame")
        cookies = [dict(browser.cookies) for browser in (client, by_link)]
    assert [visits("sesame", held) for held in cookies] == [201, 201]
    assert [visits("another", held) for held in cookies] == [403, 201]
    assert [visits("", held) for held in cookies] == [403, 201]


def test_a_browser_that_is_ended_is_out_at_once(client):
    go(client, link(client))
    assert client.post("/api/sessions").status_code == 201
    browsers = stores(client).browsers
    browsers.remove([browser.id for browser in browsers.list()])
    assert client.post("/api/sessions").status_code == 403


# Keys


def test_a_key_makes_lists_and_uses_its_own_sessions(client):
    keys = stores(client).keys
    rig, bench = bearer(keys.add("rig")), bearer(keys.add("bench"))
    made = client.post("/api/sessions", headers=rig)
    assert made.status_code == 201
    assert set(made.json()) == {"id", "name"}
    assert "set-cookie" not in made.headers
    sid = made.json()["id"]
    assert [one["id"] for one in client.get("/api/sessions", headers=rig).json()] == [sid]
    assert client.get(f"/api/sessions/{sid}/vehicle", headers=rig).status_code == 200
    assert client.get("/api/parameters", headers=rig).status_code == 200
    assert client.get("/api/sessions", headers=bench).json() == []
    assert client.get(f"/api/sessions/{sid}/vehicle", headers=bench).status_code == 404


def test_a_removed_key_is_at_once_worth_nothing(client):
    keys = stores(client).keys
    rig = bearer(keys.add("rig"))
    sid = client.post("/api/sessions", headers=rig).json()["id"]
    keys.remove("rig")
    assert client.get(f"/api/sessions/{sid}", headers=rig).status_code == 401
    renewed = bearer(keys.add("rig"))
    assert client.get(f"/api/sessions/{sid}", headers=renewed).status_code == 200


@pytest.mark.parametrize("login", [True, False])
def test_a_key_that_is_not_known_is_told_so_wherever_it_comes(settings, login):
    """Oracle: RFC 9110, 15.5.2: 401, with a challenge. Without login it is a mistake as well."""
    with open_client(settings, login=login) as client:
        stranger = another(client, peer="192.0.2.7")
        sid = stores(client).sessions.create({"name": "a car"}, [])[0]
        for method, path in (
            ("GET", "/"),
            ("GET", f"/s/{sid}/"),
            ("GET", f"/s/{sid}/viewer/"),
            ("GET", "/metrics"),
            ("GET", "/api/parameters"),
            ("POST", "/api/roads/preview"),
            ("GET", "/api/sessions"),
            ("POST", "/api/sessions"),
            ("GET", f"/api/sessions/{sid}"),
            ("PUT", f"/api/sessions/{sid}/vehicle"),
        ):
            reply = stranger.request(
                method, path, headers=bearer("rt_nonsense"), json={} if method != "GET" else None
            )
            assert (path, reply.status_code) == (path, 401)
            assert reply.headers["www-authenticate"] == "Bearer"
            assert reply.headers["content-type"] == "application/problem+json"
            assert reply.json()["code"] == "unknown-key"
            assert "ridetune keys add" in reply.json()["detail"]
        assert client.get("/healthz", headers=bearer("rt_nonsense")).status_code == 200


def test_other_tokens_may_begin_as_keys_do(tmp_path, monkeypatch):
    """A session's is drawn of all letters, the service's is chosen."""
    monkeypatch.setattr(session_store, "new_secret", lambda: "rt_drawn")
    with open_client(Settings(data=tmp_path, token="rt_chosen"), login=True) as client:
        sid, token = stores(client).sessions.create({"name": "a car"}, [])
        mine = bearer(token)
        assert client.get(f"/api/sessions/{sid}/vehicle", headers=mine).status_code == 200
        assert [one["id"] for one in client.get("/api/sessions", headers=mine).json()] == [sid]
        assert client.post("/api/sessions", headers=bearer("rt_chosen")).status_code == 201


def test_a_key_in_the_address_lets_nobody_in(client):
    """It would stay in histories and logs."""
    key = stores(client).keys.add("rig")
    assert go(client, f"/?token={key}").status_code == 403


def test_the_services_token_lets_in_so_many_browsers_a_minute(tmp_path):
    """Each is kept for 90 days, however often the token is brought."""
    settings = Settings(data=tmp_path, token="the-services-own", limits=Limits(new_sessions=2))
    with open_client(settings, login=True) as client:
        for _ in range(4):
            last = go(another(client), "/?token=the-services-own")
        assert last.status_code == 429
        assert int(last.headers["retry-after"]) > 0
        with stores(client).database.reading() as connection:
            assert connection.execute(select(func.count()).select_from(browsers)).scalar() == 2


# A proxy that tells the user


@pytest.fixture
def proxied(tmp_path):
    """A service behind a proxy that ends TLS at ride.example.com; the browser comes through it."""
    settings = Settings(
        data=tmp_path,
        public_url="https://ride.example.com",
        proxy_user_header="X-Forwarded-User",
        proxy_addresses=networks(f"{PROXY}, 10.9.0.0/24"),
    )
    with open_client(settings, login=True) as client:
        yield another(client, "https://ride.example.com", PROXY)


def named(user, **headers):
    return {"X-Forwarded-User": user} | headers


def test_the_proxys_user_has_sessions_in_whatever_browser(proxied):
    place = go(proxied, headers=named("anna")).headers["location"]
    sid = place.split("/")[2]
    elsewhere = another(proxied, "https://ride.example.com", "10.9.0.7")
    assert go(elsewhere, headers=named("anna")).headers["location"] == place
    assert go(elsewhere, place, headers=named("anna")).status_code == 200
    assert [one["id"] for one in elsewhere.get("/api/sessions", headers=named("anna")).json()] == [
        sid
    ]
    assert not proxied.cookies


def test_the_start_page_leads_to_the_session_used_latest(proxied):
    first, second = (
        proxied.post("/api/sessions", headers=named("anna")).json()["id"] for _ in "ab"
    )
    assert go(proxied, headers=named("anna")).headers["location"] == f"/s/{second}/"
    proxied.delete(f"/api/sessions/{second}", headers=named("anna"))
    assert go(proxied, headers=named("anna")).headers["location"] == f"/s/{first}/"


def test_another_user_of_the_proxy_finds_nothing(proxied):
    place = go(proxied, headers=named("anna")).headers["location"]
    assert go(proxied, place, headers=named("bert")).status_code == 404
    assert go(proxied, place).status_code == 404
    assert proxied.get("/api/sessions", headers=named("bert")).json() == []
    sid = place.split("/")[2]
    assert proxied.get(f"/api/sessions/{sid}", headers=named("Anna")).status_code == 404


@pytest.mark.parametrize("peer", ["10.0.0.2", "10.9.1.1", "127.0.0.1", "::1", "testclient"])
def test_nobody_but_the_proxy_may_say_who_it_is(proxied, peer):
    """Refused, not overheard, so that a wrong set-up shows; whatever it says it forwards."""
    stranger = another(proxied, "https://ride.example.com", peer)
    forwarded = {"X-Forwarded-For": PROXY, "Forwarded": f"for={PROXY}"}
    for path in ("/", "/api/sessions", "/healthz"):
        reply = go(stranger, path, headers=named("anna") | forwarded)
        assert reply.status_code == 403
        assert "RIDETUNE_PROXY_ADDRESSES" in reply.json()["detail"]


def test_an_address_of_ipv4_in_ipv6_is_the_same(proxied):
    mapped = another(proxied, "https://ride.example.com", f"::ffff:{PROXY}")
    assert go(mapped, headers=named("anna")).status_code == 303


@pytest.mark.parametrize("users", [["anna", "bert"], ["", "anna"], ["x" * 201]])
def test_a_user_who_is_told_twice_or_at_length_is_refused(proxied, users):
    """As where a proxy adds its header to one that a visitor sent."""
    headers = [("X-Forwarded-User", user) for user in users]
    assert proxied.get("/api/sessions", headers=headers).status_code == 403


@pytest.mark.parametrize("user", ["", "  "])
def test_a_proxy_that_names_nobody_lets_nobody_in(proxied, user, tmp_path):
    """And tells nothing of the machine."""
    page = go(proxied, headers=named(user))
    assert page.status_code == 403
    assert str(tmp_path) not in page.text
    assert "https://ride.example.com/" in page.text


def test_without_a_proxy_its_header_says_nothing(client):
    assert client.post("/api/sessions", headers=named("anna")).status_code == 403


def test_by_https_the_cookies_are_bound_to_the_host(proxied):
    given = go(proxied, link(proxied)).headers.get_list("set-cookie")
    assert [cookie.partition("ridetune")[0] for cookie in given] == ["__Host-", "__Host-"]
    for cookie in given:
        assert {"Secure", "HttpOnly", "Path=/", "SameSite=strict"} <= set(cookie.split("; "))
        assert "domain" not in cookie.lower()
    assert go(proxied).status_code == 303
    assert proxied.get("/api/parameters").status_code == 200


def test_a_key_goes_before_the_proxys_word(proxied):
    """A program may come through the proxy as well; what it makes is its own."""
    key = bearer(stores(proxied).keys.add("rig"))
    sid = proxied.post("/api/sessions", headers=named("anna", **key)).json()["id"]
    assert proxied.get("/api/sessions", headers=named("anna")).json() == []
    assert proxied.get(f"/api/sessions/{sid}", headers=key).status_code == 200
