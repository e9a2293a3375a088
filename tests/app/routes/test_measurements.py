"""Uploads: what was found in them, byte for byte back, and a sentence for every bad one."""

import hashlib
import json
from dataclasses import replace

import h5py
import numpy as np
import pytest
from ridetune.app.recordings.measurement_view import measurement_to_json
from ridetune.engine.manoeuvre import manoeuvre_to_json, reference_manoeuvres
from scipy.io import savemat

from ... import files_of_kinds
from ..conftest import SAMPLES, Visitor, open_client, short_recording
from ..test_frames import read_binary


def test_an_upload_says_what_was_found_in_it(visitor):
    data = short_recording()
    reply = visitor.upload(data, "lap.csv")
    assert reply.status_code == 201
    found = reply.json()
    assert (found["name"], found["bytes"], found["samples"]) == ("lap.csv", len(data), 101)
    assert found["sha256"] == hashlib.sha256(data).hexdigest()
    assert found["duration"] == pytest.approx(1.0)
    assert found["sample_step"] == pytest.approx(0.01)
    assert found["usable_for_identification"] is True
    assert found["missing"] == []
    heave = next(channel for channel in found["channels"] if channel["name"] == "chassis.z")
    assert heave["unit"] == "m"
    assert (heave["minimum"], heave["maximum"]) == pytest.approx((-0.004, 0.004))
    assert visitor.get(f"/measurements/{found['id']}").json() == found
    assert visitor.get("/measurements").json()[-1] == found


@pytest.mark.parametrize("name", files_of_kinds.WRITERS)
def test_every_kind_of_recording_is_an_upload(visitor, tmp_path, name):
    """Oracle: the numbers that were written; a CarMaker recording comes with its description."""
    write, _, off = files_of_kinds.WRITERS[name]
    write(tmp_path / name)
    reply = visitor.upload((tmp_path / name).read_bytes(), name)
    if name.endswith(".erg"):
        assert reply.status_code == 422
        assert "pack the two into one .zip" in reply.json()["detail"]
        return
    assert reply.status_code == 201, reply.text
    found = {channel["name"]: channel for channel in reply.json()["channels"]}
    z = 1e-3 * files_of_kinds.Z
    extremes = [found["chassis.z"][one] for one in ("minimum", "maximum")]
    assert extremes == pytest.approx([z.min(), z.max()], rel=1e-15, abs=1e-3 * off)


def test_the_same_drive_under_another_name_is_remarked(visitor):
    """The same bytes, and the same samples in other bytes; never a drive that differs in one."""
    data = short_recording()
    first = visitor.upload(data, "lap.csv").json()
    assert (first["same_data_as"], first["remarks"]) == (None, [])
    copies = {"monday.csv": data, "windows.csv": data.replace(b"\n", b"\r\n")}
    for name, copy in copies.items():
        found = visitor.upload(copy, name).json()
        assert found["same_data_as"] == first["id"]
        assert found["remarks"] == [
            "It holds the same data as lap.csv; a fit to both would count that drive twice."
        ]
        assert visitor.get(f"/measurements/{found['id']}").json() == found
        assert visitor.get().json()["measurements"][-1] == found
    head, last = data.rstrip(b"\n").rsplit(b"\n", 1)
    cells = last.split(b",")
    cells[1] = b"0.0009"
    other = visitor.upload(b"\n".join([head, b",".join(cells), b""]), "other.csv").json()
    assert other["same_data_as"] is None


def test_the_same_bytes_under_another_mapping_are_other_data(visitor):
    """A body that goes down is another than one that goes up; turned back, they are the same."""
    data = short_recording()
    first, second, third = (visitor.upload(data, f"{name}.csv").json() for name in "abc")
    path = f"/measurements/{second['id']}"
    mapping = visitor.get(f"{path}/columns").json()["proposed"]
    for one in mapping["columns"]:
        one["unit"] = {"time": "s", "chassis.a_x": "m/s^2"}.get(one["column"], "mm")
    [height] = [one for one in mapping["columns"] if one["channel"] == "chassis.z"]
    height["sign"] = -1
    turned = visitor.put(f"{path}/mapping", json=mapping).json()
    assert (turned["same_data_as"], turned["remarks"]) == (None, [])
    assert visitor.get(f"/measurements/{third['id']}").json()["same_data_as"] == first["id"]
    height["sign"] = 1
    assert visitor.put(f"{path}/mapping", json=mapping).json()["same_data_as"] == first["id"]


def test_what_was_deleted_meanwhile_is_shown_as_it_was(visitor):
    """Between reading it and looking at its session another request may delete it."""
    kept = visitor.upload(short_recording()).json()
    store = visitor.client.app.state.services.store
    before = store.measurements.get(visitor.id, kept["id"])
    visitor.delete(f"/measurements/{kept['id']}")
    shown = measurement_to_json(store, visitor.id, before)
    assert (shown["id"], shown["same_data_as"]) == (kept["id"], None)


def test_a_bare_body_is_an_upload_too(visitor):
    data = short_recording()
    reply = visitor.post("/measurements?name=bare.csv", content=data)
    assert reply.status_code == 201
    assert reply.json()["name"] == "bare.csv"


def test_the_original_comes_back_byte_for_byte(visitor):
    """Line ends, spaces and the byte-order mark of the file included."""
    data = b"\xef\xbb\xbf" + short_recording().replace(b"\n", b"\r\n")
    kept = visitor.upload(data).json()
    back = visitor.get(f"/measurements/{kept['id']}/original")
    assert back.content == data
    assert back.headers["content-disposition"] == 'attachment; filename="run.csv"'
    assert back.headers["content-type"] == "application/octet-stream"


def test_what_an_identification_lacks_is_listed(visitor):
    data = short_recording().replace(b"chassis.a_x", b"chassis.v_x").replace(b"[m/s^2]", b"[m/s]")
    found = visitor.upload(data).json()
    assert found["usable_for_identification"] is False
    assert found["missing"] == ["chassis.a_x"]


def test_the_histories_come_as_binary_and_json_and_whole_as_csv(visitor):
    sample = visitor.get("/measurements").json()[0]
    path = f"/measurements/{sample['id']}/frames?channels=chassis.z,wheel.fl.z&max_samples=500"
    binary = visitor.get(path, headers={"Accept": "application/vnd.ridetune.frames"})
    head, values = read_binary(binary.content)
    assert list(values) == ["time", "chassis.z", "wheel.fl.z"]
    assert head["mode"] == "measured"
    assert head["samples"] <= 500
    shown = visitor.get(path).json()
    assert shown["values"]["chassis.z"] == pytest.approx(values["chassis.z"].tolist(), abs=1e-6)
    assert visitor.get(path, headers={"Accept": "text/csv"}).status_code == 406
    csv = visitor.get(f"/measurements/{sample['id']}/run.csv")
    assert csv.headers["content-type"] == "text/csv; charset=utf-8"
    assert csv.text.startswith("time [s],")
    assert len(csv.text.splitlines()) == sample["samples"] + 1


def test_a_deleted_measurement_is_gone_and_its_file_with_the_last_one(visitor, settings):
    """Two measurements of the same bytes share one original."""
    data = short_recording()
    first, second = visitor.upload(data).json(), visitor.upload(data).json()
    original = settings.data / "originals" / first["sha256"][:2] / first["sha256"]
    assert visitor.delete(f"/measurements/{first['id']}").status_code == 204
    assert visitor.get(f"/measurements/{first['id']}").status_code == 404
    assert original.read_bytes() == data
    visitor.delete(f"/measurements/{second['id']}")
    assert not original.exists()


def test_notes_state_the_noise_of_a_recording(visitor):
    """As in a file beside it, unit doubts included; the recording stays what it is."""
    kept = visitor.upload(short_recording(), "lap.csv").json()
    path = f"/measurements/{kept['id']}/notes?name=lap.toml"
    noted = visitor.put(path, content=b'[noise]\n"chassis.z" = 0.001\n')
    assert noted.status_code == 200
    assert noted.json() == kept | {"noise": {"chassis.z": 0.001}}
    assert visitor.get(f"/measurements/{kept['id']}").json() == noted.json()
    doubtful = visitor.put(path, content=b'[noise]\n"chassis.z" = 0.5\n').json()
    assert doubtful["noise"] == {"chassis.z": 0.5}
    assert "is this one in mm?" in doubtful["warnings"][0]
    simulation = {"rims": {"measurement": kept["id"]}, "max_samples": 2}
    head = visitor.post("/simulations", json=simulation).json()
    assert doubtful["warnings"][0] in head["warnings"]


@pytest.mark.parametrize(
    ("notes", "said"),
    [
        (b"[noise]\n", "lap.toml states no noise of chassis.z, chassis.pitch, chassis.roll"),
        (b'[noise]\n"wheel.fl.z" = 1e-3\n', "lap.toml states no noise of chassis.z"),
        (b'description = "wet"\n', "or vehicle = and the name of the car"),
        (b'[noise]\n"chassis.z" = -1\n', "give a positive number in m"),
        (b"time [s],chassis.z [mm]\n0,1\n", "lap.toml: not valid TOML"),
    ],
)
def test_notes_that_say_nothing_usable_are_refused(visitor, notes, said):
    kept = visitor.upload(short_recording(), "lap.csv").json()
    path = f"/measurements/{kept['id']}/notes?name=lap.toml"
    reply = visitor.put(path, content=notes)
    assert (reply.status_code, reply.json()["code"]) == (422, "measurement")
    assert said in reply.json()["detail"]
    assert visitor.get(f"/measurements/{kept['id']}").json() == kept
    assert visitor.put("/measurements/none/notes", content=notes).status_code == 404
    nameless = visitor.put(f"/measurements/{kept['id']}/notes", content=notes).json()["detail"]
    assert nameless == reply.json()["detail"].replace("lap.toml", "notes.toml")


def test_what_was_driven_is_kept_with_a_recording_until_it_is_forgotten(visitor):
    kept = visitor.upload(short_recording(), "lap.csv").json()
    assert kept["manoeuvre"] is None
    path, bump = f"/measurements/{kept['id']}/manoeuvre", reference_manoeuvres()["bump"]
    told = visitor.put(path, content=json.dumps(manoeuvre_to_json(bump)).encode()).json()
    assert told == kept | {"manoeuvre": manoeuvre_to_json(bump)}
    assert visitor.get(f"/measurements/{kept['id']}").json() == told
    assert visitor.delete(path).json() == kept


@pytest.mark.parametrize(
    ("manoeuvre", "said"),
    [
        (b"{", "lap.manoeuvre.json: line 1, column 2: not valid JSON"),
        (b'{"nam": "lap"}', 'lap.manoeuvre.json: nam is not known; did you mean "name"?'),
        (
            json.dumps(manoeuvre_to_json(reference_manoeuvres()["heave"])).encode(),
            'lap.manoeuvre.json: a recording is of a drive; give a manoeuvre of kind "road".',
        ),
    ],
)
def test_a_manoeuvre_that_cannot_have_been_driven_is_refused(visitor, manoeuvre, said):
    kept = visitor.upload(short_recording(), "lap.csv").json()
    path = f"/measurements/{kept['id']}/manoeuvre?name=lap.manoeuvre.json"
    reply = visitor.put(path, content=manoeuvre)
    assert (reply.status_code, reply.json()["code"]) == (422, "manoeuvre")
    assert said in reply.json()["detail"]
    assert visitor.get(f"/measurements/{kept['id']}").json() == kept
    nowhere = visitor.put("/measurements/none/manoeuvre", content=manoeuvre)
    assert nowhere.status_code == 404


BAD_FILES = {
    "empty": (b"", "empty"),
    "binary": (bytes(range(256)) * 40, "text"),
    "no header": (b"0,1,2\n0.1,1,2\n0.2,1,2\n", "header"),
    "two samples": (b"time [s],chassis.z [m]\n0,0\n0.01,0\n", "2 samples"),
    "a header alone": (b"Zeit [s],Aufbau z [mm]\n", "no samples stand below the header"),
    "two samples of others": (b"Zeit [s],Aufbau z [mm]\n0,0\n0.01,1\n", "2 samples"),
    "unknown unit": (short_recording().replace(b"[mm]", b"[parsec2]", 1), "parsec2"),
    "doubled channel": (short_recording().replace(b"wheel.fr", b"wheel.fl"), "wheel.fl.z"),
    "time falls": (short_recording().replace(b"\n0.50,", b"\n0.10,"), "line 52"),
    "an array": (b"\x93NUMPY\x01\x00" + bytes(100), "is a NumPy array"),
    "packed": (b"\x1f\x8b\x08" + bytes(100), "is packed with gzip; unpack it"),
    "prose": (b"hello\nworld", "no table of numbers was found (line 2, column hello: 'world' is"),
    "half a TDMS file": (b"TDSm" + bytes(24), "cannot be read as TDMS"),
    "not a number": (short_recording().replace(b"\n0.50,", b"\n0.50,nan,"), "line 52"),
    "overflow": (short_recording().replace(b"\n0.50,", b"\n1e999,"), "line 52"),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_a_bad_file_is_refused_with_a_sentence_and_nothing_is_kept(visitor, settings, name):
    data, said = BAD_FILES[name]
    before = len(visitor.get("/measurements").json())
    files = {path.name for path in (settings.data / "originals").glob("*/*")}
    reply = visitor.upload(data, f"{name}.csv")
    assert reply.status_code == 422, reply.text
    assert reply.json()["code"] == "measurement"
    assert f"{name}.csv" in reply.json()["detail"]
    assert said in reply.json()["detail"]
    assert len(visitor.get("/measurements").json()) == before
    assert {path.name for path in (settings.data / "originals").glob("*/*")} == files


def cut(path):
    """The first half of what is written there."""
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])


def cut_mdf(path):
    files_of_kinds.mdf(path)
    cut(path)


def cut_hdf5(path):
    files_of_kinds.hdf5(path)
    cut(path)


def linked(path):
    with h5py.File(path, "w") as file:
        file["chassis.z"] = h5py.ExternalLink("/etc/passwd", "/x")


def cells(path):
    savemat(path, {"chassis.z": np.array([1, "a"], dtype=object)})


DAMAGED = {
    "half.mf4": (cut_mdf, "damaged"),
    "half.h5": (cut_hdf5, "damaged"),
    "link.h5": (linked, "chassis.z is a link, which is not followed"),
    "cells.mat": (cells, "chassis.z is a cell array"),
    "picture.mat": (lambda path: path.write_bytes(b"\x89PNG\r\n" + bytes(600)), "is a picture"),
    "text.tdms": (lambda path: path.write_bytes(b"hello\nworld"), "no table of numbers"),
    "empty.parquet": (lambda path: path.write_bytes(b""), "the file is empty"),
}


def test_what_is_damaged_is_refused_and_the_service_goes_on(visitor, tmp_path):
    """Oracle: what was done to the file; the next one is taken. All kinds: tests/engine/formats."""
    for name, (write, said) in DAMAGED.items():
        write(tmp_path / name)
        reply = visitor.upload((tmp_path / name).read_bytes(), name)
        assert (reply.status_code, reply.json()["code"]) == (422, "measurement"), name
        assert reply.json()["detail"].startswith(f"{name}: ")
        assert said in reply.json()["detail"]
    assert visitor.upload(short_recording()).status_code == 201


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
@pytest.mark.parametrize("separators", [b",.", b";,"])
def test_what_spreadsheets_write_is_read(visitor, encoding, separators):
    """Semicolons with decimal commas, byte-order marks: the same numbers in all of them."""
    column, decimal = separators[:1], separators[1:]
    plain = short_recording()
    data = plain.replace(b",", b"|").replace(b".", decimal).replace(b"|", column)
    data = data.replace(b"chassis" + decimal, b"chassis.").replace(b"wheel" + decimal, b"wheel.")
    for corner in (b"fl", b"fr", b"rl", b"rr"):
        data = data.replace(corner + decimal + b"z", corner + b".z")
    found = visitor.upload(data.decode().encode(encoding)).json()
    assert found["channels"] == visitor.upload(plain).json()["channels"]


def test_millimetres_under_a_header_of_metres_are_pointed_out(visitor):
    """Kept, with a warning that names the channel."""
    reply = visitor.upload(short_recording().replace(b"chassis.z [mm]", b"chassis.z [m]"))
    assert reply.status_code == 201
    assert any("chassis.z" in warning for warning in reply.json()["warnings"])


def test_a_form_without_a_file_is_refused(visitor):
    for form in ({"files": {"other": ("x.csv", b"x")}}, {"files": {"file": (None, "just text")}}):
        reply = visitor.post("/measurements", **form)
        assert (reply.status_code, reply.json()["field"]) == (422, "file")
        assert "file" in reply.json()["detail"]


@pytest.mark.parametrize(
    ("sent", "kept"),
    [
        ("../../etc/passwd", "passwd"),
        ("C:\\Users\\me\\lap 1.csv", "lap 1.csv"),
        ("a\x00b\x1b[31m.csv", "ab[31m.csv"),
        ("..", "measurement.csv"),
        ("", "measurement.csv"),
        ("x" * 300 + ".csv", "x" * 96 + ".csv"),
        ("Überlauf.csv", "Überlauf.csv"),
    ],
)
def test_a_name_is_only_a_name(visitor, sent, kept):
    reply = visitor.request(
        "POST", "/measurements", params={"name": sent}, content=short_recording()
    )
    assert reply.json()["name"] == kept


@pytest.mark.parametrize("path", ["..%2f..%2fowner.lock", "%2e%2e/%2e%2e/owner.lock", "%00"])
def test_an_id_is_no_path(visitor, path):
    assert visitor.get(f"/measurements/{path}/original").status_code == 404


def test_a_file_over_the_limit_is_refused_with_the_limit(small_limits):
    """By the guard where the whole body is too long, by the reader where only just."""
    with open_client(small_limits) as client:
        visitor = Visitor(client)
        for size in (20_001, 1_000_000):
            reply = visitor.upload(b"x" * size, "long.csv")
            assert reply.status_code == 413
            assert "MB" in reply.json()["detail"]
        assert visitor.get("/measurements").status_code == 200


def test_a_full_session_asks_to_delete_one(small_limits):
    """Two samples and one upload fill the three places."""
    with open_client(small_limits) as client:
        visitor = Visitor(client)
        assert visitor.upload(short_recording()).status_code == 201
        reply = visitor.upload(short_recording())
        assert reply.status_code == 429
        assert "delete one" in reply.json()["detail"]


def test_a_sample_run_uploads_like_any_other_file(visitor):
    file = SAMPLES / "detailed/manoeuvre_1.csv"
    kept = visitor.upload(file.read_bytes(), file.name).json()
    assert kept["sha256"] in {one["sha256"] for one in visitor.get("/measurements").json()[:-1]}


def test_the_reader_of_a_file_has_the_memory_that_the_service_is_told(small_limits):
    """Oracle: a recording that is taken otherwise, and a process that cannot even start."""
    limits = replace(small_limits.limits, reader_bytes=1000)
    with open_client(small_limits) as client:
        assert Visitor(client).upload(short_recording()).status_code == 201
    with open_client(replace(small_limits, limits=limits)) as client:
        reply = Visitor(client).upload(short_recording())
    assert reply.status_code == 422, reply.text
    assert "run.csv: its reader" in reply.json()["detail"]
