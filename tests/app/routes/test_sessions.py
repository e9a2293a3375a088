"""Sessions: the sample project in a fresh one, and nobody sees another's."""

import subprocess
import sys

import pytest
from ridetune.app.settings import Settings
from ridetune.app.storage.tables import sessions
from sqlalchemy import update

from ..conftest import Visitor, open_client


def test_a_fresh_session_holds_the_sample_project(visitor):
    """A car and two recordings ready for an identification, before anything was uploaded."""
    session = visitor.get().json()
    assert session["id"] == visitor.id
    assert session["vehicle"] == session["baseline"]
    assert [kept["name"] for kept in session["measurements"]] == [
        "detailed_manoeuvre_1.csv",
        "detailed_manoeuvre_2.csv",
    ]
    assert all(kept["usable_for_identification"] for kept in session["measurements"])
    driven = [kept["manoeuvre"]["name"] for kept in session["measurements"]]
    assert [name.partition(":")[0] for name in driven] == ["Manoeuvre 1", "Manoeuvre 2"]
    assert session["identifications"] == []


def test_the_list_tells_when_a_session_was_made_and_used_last(visitor):
    """In ISO 8601 as all instants of the interface. Oracle: 1.7e9 s of Unix time by `date -u`."""
    with visitor.client.app.state.services.store.database.writing() as connection:
        connection.execute(update(sessions).values(created=1_700_000_000.25, seen=1_700_000_060.0))
    mine = {"Authorization": f"Bearer {visitor.token}"}
    assert visitor.client.get("/api/sessions", headers=mine).json() == [
        {
            "id": visitor.id,
            "name": "Project",
            "created": "2023-11-14T22:13:20.250000+00:00",
            "seen": "2023-11-14T22:14:20+00:00",
            "measurement_count": 2,
        }
    ]


def test_a_first_session_does_not_wait_for_the_compiler():
    """numba takes seconds to load; the page answers while it does."""
    program = (
        "import sys; from ridetune.app.work.samples import sample_project; sample_project();"
        "print('numba' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout == "False\n", done.stderr


def test_the_vehicle_is_replaced_and_the_baseline_stays(visitor):
    vehicle = visitor.get("/vehicle").json()
    vehicle["front"]["suspension"]["stiffness"] = 31_000.0
    assert visitor.put("/vehicle", json=vehicle).json() == vehicle
    assert visitor.get("/vehicle").json() == vehicle
    assert visitor.get("/baseline").json()["front"]["suspension"]["stiffness"] != 31_000.0
    visitor.put("/baseline", json=vehicle)
    assert visitor.get("/baseline").json() == vehicle


def test_the_set_up_of_the_next_fit_is_kept_with_the_session(visitor):
    """It has the fields of an identification; what it leaves out is what an identification does."""
    assert visitor.get("/setup").json() is None
    run = visitor.get("/measurements").json()[0]["id"]
    told = {
        "ride": {"kind": "measurement", "id": run, "key": None},
        "use": {run: "hold_out"},
        "fixed": ["front.pivot.angle"],
        "bounds": {"front.suspension.stiffness": [12e3, None]},
        "priors": {"rear.suspension.damping": [1500.0, 50.0]},
        "settings": {"output_highpass_hz": 0.3},
        "sensors": {"chassis.z": {"delay": "fit"}},
        "loss": "huber",
    }
    kept = visitor.patch("/setup", json=told).json()
    assert visitor.get("/setup").json() == visitor.get().json()["setup"] == kept
    settings = visitor.client.get("/api/rims-settings").json()
    assert kept["settings"] == settings | {"output_highpass_hz": 0.3}
    assert {name: kept[name] for name in told if name != "settings"} == {
        name: value for name, value in told.items() if name != "settings"
    }
    fit = visitor.submit("identifications", {"runs": [run]})
    for name in ("traction", "starts", "seed", "loss_scale", "noise", "braking", "fit_noise"):
        assert kept[name] == fit[name]


def test_a_set_up_is_changed_part_by_part(visitor):
    """What is not told stays, entry by entry; null takes an entry away."""
    one, other = (kept["id"] for kept in visitor.get("/measurements").json())
    first = {
        "use": {one: "fit"},
        "braking": {one: [[1.0, 2.0]]},
        "bounds": {"K_F": [12e3, None], "K_R": [None, 40e3]},
        "settings": {"a_x_cutoff_hz": None},
        "starts": 4,
    }
    visitor.patch("/setup", json=first)
    visitor.patch("/setup", json={"ride": {"kind": "manoeuvre", "key": "2"}})
    changes = {
        "use": {other: "hold_out"},
        "braking": {one: None},
        "bounds": {"front.suspension.stiffness": None},
        "settings": {"rim_cutoff_hz": 30.0},
    }
    kept = visitor.patch("/setup", json=changes).json()
    assert kept["ride"] == {"kind": "manoeuvre", "id": None, "key": "2"}
    assert kept["use"] == {one: "fit", other: "hold_out"}
    assert kept["braking"] == {}
    assert kept["bounds"] == {"rear.suspension.stiffness": [None, 40e3]}
    assert kept["settings"]["a_x_cutoff_hz"] is None
    assert kept["settings"]["rim_cutoff_hz"] == 30.0
    assert kept["starts"] == 4


def test_what_a_set_up_tells_of_a_measurement_goes_with_it(visitor):
    one, other = (kept["id"] for kept in visitor.get("/measurements").json())
    visitor.patch("/setup", json={"use": {one: "fit", other: "fit"}, "braking": {one: []}})
    visitor.delete(f"/measurements/{one}")
    kept = visitor.patch("/setup", json={"use": {"of another session": "fit"}}).json()
    assert kept["use"] == {other: "fit"}
    assert kept["braking"] == {}


@pytest.mark.parametrize(
    ("wrong", "field"),
    [
        ({"use": {"x": "holdout"}}, "use.x"),
        ({"starts": 0}, "starts"),
        ({"starst": 2}, "starst"),
        ({"seed": 2**53 + 1}, "seed"),
        ({"settings": {"rim_cutoff_hz": 0.2}}, "settings.rim_cutoff_hz"),
        ({"fixed": ["front.pivot.angel"]}, "fixed.0"),
        ({"bounds": {"K_X": [1.0, 2.0]}}, "bounds.K_X"),
        ({"bounds": {"K_F": [2e4, 1e4]}}, "bounds.K_F"),
        ({"priors": {"front.suspension.stifness": [1.0, 1.0]}}, "priors"),
        ({"priors": {"K_F": [2e4, 0.0]}}, "priors.K_F.1"),
        ({"noise": {"chassis.z": -0.1}}, "noise.chassis.z"),
        ({"noise": {"chassis.zz": 0.1}}, "noise.chassis.zz"),
        ({"sensors": {"chassis.zz": {"sign": -1}}}, "sensors.chassis.zz"),
        ({"ride": {"kind": "measurement", "key": "2"}}, "ride"),
        ({"ride": {"kind": "manoeuvre"}}, "ride"),
    ],
)
def test_a_part_of_a_set_up_that_says_nothing_to_a_fit_is_refused(visitor, wrong, field):
    """Unknown names and numbers out of every range; whether a fit can be made is for the fit."""
    reply = visitor.patch("/setup", json=wrong)
    assert reply.status_code == 422
    assert reply.json()["field"].startswith(field)
    assert reply.json()["detail"].endswith(".")
    assert visitor.get("/setup").json() is None


def test_a_set_up_is_no_place_for_much(visitor):
    """A session keeps at most 50 measurements, and a change of its set-up has 64 kB."""
    use = {f"{number:016x}": "fit" for number in range(51)}
    reply = visitor.patch("/setup", json={"use": use})
    assert reply.status_code == 422
    assert "more than the 50 measurements" in reply.json()["detail"]
    reply = visitor.patch("/setup", json={"use": {"x" * 64_000: "fit"}})
    assert reply.status_code == 413
    assert "0.064 MB" in reply.json()["detail"]
    assert visitor.get("/setup").json() is None


def test_a_misspelt_vehicle_is_refused_and_the_old_one_kept(visitor):
    """The sentence names the field and the nearest known one."""
    before = visitor.get("/vehicle").json()
    vehicle = visitor.get("/vehicle").json()
    vehicle["front"]["suspension"]["stifness"] = vehicle["front"]["suspension"].pop("stiffness")
    reply = visitor.put("/vehicle", json=vehicle)
    assert reply.status_code == 422
    assert reply.headers["content-type"] == "application/problem+json"
    assert reply.json()["code"] == "vehicle"
    assert "stifness" in reply.json()["detail"]
    assert "stiffness" in reply.json()["detail"]
    assert visitor.get("/vehicle").json() == before


@pytest.mark.parametrize("path", ["", "/vehicle", "/measurements", "/identifications"])
def test_another_visitor_finds_nothing(client, visitor, path):
    """A stranger's token opens as much as none: 404, as for a session that never was."""
    stranger = Visitor(client)
    address = f"/api/sessions/{visitor.id}{path}"
    for headers in ({}, {"Authorization": f"Bearer {stranger.token}"}):
        reply = client.get(address, headers=headers)
        assert reply.status_code == 404
        assert reply.json()["code"] == "not-found"


def test_ids_of_another_session_are_not_found_in_mine(client, visitor):
    """Knowing somebody's measurement id does not help."""
    stranger = Visitor(client)
    theirs = visitor.get("/measurements").json()[0]["id"]
    for path in ("", "/frames", "/original"):
        assert stranger.get(f"/measurements/{theirs}{path}").status_code == 404
    assert stranger.delete(f"/measurements/{theirs}").status_code == 404
    rims = {"rims": {"measurement": theirs}}
    assert stranger.post("/identifications", json={"runs": [theirs]}).status_code == 404
    assert visitor.get(f"/measurements/{theirs}").status_code == 200
    assert stranger.post("/simulations", json=rims).status_code == 404


def test_the_token_is_a_cookie_that_scripts_cannot_read(client):
    made = client.post("/api/sessions")
    cookie = made.headers["set-cookie"]
    assert cookie.startswith(f"ridetune_{made.json()['id']}=")
    assert "HttpOnly" in cookie
    assert "SameSite=strict" in cookie
    assert client.get(f"/api/sessions/{made.json()['id']}").status_code == 200


def test_the_token_itself_is_not_kept(settings):
    """What lies in the data directory opens no session."""
    with open_client(settings) as client:
        visitor = Visitor(client)
        kept = b"".join(file.read_bytes() for file in settings.data.glob("ridetune.sqlite*"))
    assert visitor.id.encode() in kept
    assert visitor.token.encode() not in kept


def test_a_deleted_session_is_gone_with_all_it_held(client, visitor, settings):
    uploaded = visitor.upload(client.get("/static/index.html").content, "x.csv")
    assert uploaded.status_code == 422
    assert visitor.delete().status_code == 204
    assert visitor.get().status_code == 404
    assert list((settings.data / "originals").glob("*/*")) == []


def test_too_many_sessions_are_refused_with_a_sentence(small_limits):
    with open_client(small_limits) as client:
        Visitor(client), Visitor(client)
        reply = client.post("/api/sessions")
        assert reply.status_code == 503
        assert "2 sessions" in reply.json()["detail"]
        assert int(reply.headers["retry-after"]) > 0


def test_a_service_with_a_token_gives_sessions_only_to_who_brings_it(tmp_path):
    with open_client(Settings(data=tmp_path, token="open sesame"), login=True) as client:
        assert client.post("/api/sessions").status_code == 403
        assert client.get("/", follow_redirects=False).status_code == 403
        allowed = client.post("/api/sessions", headers={"Authorization": "Bearer open sesame"})
        assert allowed.status_code == 201
        client.cookies.clear()
        link = client.get("/?token=open%20sesame&dpr=1", follow_redirects=False)
        assert link.status_code == 303
        assert link.headers["location"].endswith("/?dpr=1")
        assert (
            client.get("/", follow_redirects=False).headers["location"] in link.headers["location"]
        )
