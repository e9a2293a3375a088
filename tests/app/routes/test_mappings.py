"""Files of other houses over REST. Oracle: a sample run under other names and in other units."""

import json

import numpy as np
import pytest
from ridetune.app.cli import main
from ridetune.app.recordings.recordings import as_stated
from ridetune.app.storage.measurement import stated
from ridetune.engine.formats.child import ChildTable
from ridetune.engine.mapping.mapping import read_mapping
from ridetune.engine.mapping.reading import read_recording
from ridetune.engine.measurement import read_run, run_to_csv
from ridetune.engine.run import Run

from ..commands.test_cli_channels import TITLES
from ..conftest import SAMPLES, short_recording
from ..test_frames import read_binary

NATIVE = SAMPLES / "twin/manoeuvre_2.csv"
STEP = 5
"""Every fifth sample of the run is sent, which is enough."""


def foreign(step: int = STEP, turned: tuple[str, ...] = ()) -> bytes:
    """The sample run as another house writes it, with an oil pressure."""
    run = read_run(NATIVE)
    titles = [*(title for title, _ in TITLES.values()), "Oeldruck [bar]"]
    columns = [
        (-factor if name in turned else factor) * run[name][::step]
        for name, (_, factor) in TITLES.items()
    ]
    rows = np.transpose([*columns, np.full_like(columns[0], 3.0)])
    lines = [";".join(titles), *(";".join(f"{x:.12g}" for x in row) for row in rows)]
    return "\n".join(lines).encode()


def test_a_file_of_ours_with_gaps_or_a_slip_is_kept_until_it_is_mapped(visitor):
    """What is proposed for it can be applied."""
    lines = ["time [s],chassis.z [mm],chasis.pitch [deg]", "0,1,2", "0.01,,2"]
    lines += [f"{k / 100},{k % 7},{k % 5}" for k in range(2, 50)]
    found = visitor.upload("\n".join(lines).encode(), "lap.csv").json()
    assert found["needs_mapping"] is True
    assert "did you mean chassis.pitch?" in found["warnings"][0]
    lines[0] = "time [s],chassis.z [mm],chassis.pitch [deg]"
    found = visitor.upload("\n".join(lines).encode(), "lap.csv").json()
    assert found["needs_mapping"] is True
    assert "line 3, column chassis.z [mm]: the cell is empty" in found["warnings"][0]
    place = f"/measurements/{found['id']}"
    proposed = visitor.get(f"{place}/columns").json()["proposed"]
    mapped = visitor.put(f"{place}/mapping", json=proposed).json()
    assert mapped["needs_mapping"] is False
    assert [one["name"] for one in mapped["channels"]] == ["chassis.z", "chassis.pitch"]


@pytest.fixture
def kept(visitor):
    """An upload that needs a mapping; its pitch is turned over."""
    reply = visitor.upload(foreign(turned=("chassis.pitch",)), "lap.csv")
    assert reply.status_code == 201
    return reply.json()


def test_a_file_with_other_names_is_kept_until_it_is_mapped(visitor, kept):
    assert kept["needs_mapping"] is True
    assert kept["usable_for_identification"] is False
    assert kept["missing"] == []
    assert kept["channels"] == []
    assert kept["mapping"] is None
    assert kept["samples"] == 801
    assert "no column is called time" in kept["warnings"][0]
    assert any("fit mg, not g" in one for one in kept["warnings"])
    assert visitor.get(f"/measurements/{kept['id']}").json() == kept
    original = visitor.get(f"/measurements/{kept['id']}/original").content
    assert original == foreign(turned=("chassis.pitch",))


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("/simulations", lambda mid: {"rims": {"measurement": mid}}),
        ("/identifications", lambda mid: {"runs": [mid]}),
    ],
)
def test_what_is_not_mapped_is_not_used(visitor, kept, path, body):
    reply = visitor.post(path, json=body(kept["id"]))
    assert (reply.status_code, reply.json()["code"]) == (422, "measurement")
    assert reply.json()["detail"] == (
        "lap.csv: its columns are not mapped to channels; map them first."
    )
    assert visitor.get(f"/measurements/{kept['id']}/frames").status_code == 422


def test_columns_come_with_numbers_guess_reasons_and_candidates(visitor, kept):
    found = visitor.get(f"/measurements/{kept['id']}/columns").json()
    assert (found["kind"], found["template"], found["mapping"]) == ("CSV", None, None)
    columns = {one["name"]: one for one in found["columns"]}
    assert [one["index"] for one in found["columns"]] == list(range(9))
    pitch = columns["Nickwinkel"]
    assert (pitch["unit"], pitch["samples"], pitch["gaps"], pitch["constant"]) == (
        "rad",
        801,
        0,
        False,
    )
    measured = -np.degrees(read_run(NATIVE)["chassis.pitch"][::STEP])
    assert (pitch["minimum"], pitch["maximum"]) == pytest.approx((measured.min(), measured.max()))
    assert pitch["guess"]["channel"] == "chassis.pitch"
    assert pitch["guess"]["unit"] == "deg"
    assert pitch["guess"]["doubted"] is True
    assert "unit lies" in pitch["guess"]["reason"]
    assert pitch["candidates"][0] == pitch["guess"]
    assert columns["Oeldruck"]["guess"] is None
    assert columns["Oeldruck"]["constant"] is True
    assert [one["clock"] for one in found["columns"]] == [None, *[0] * 8]
    assert {one["step"] for one in found["columns"]} == {None}
    assert {one["channel"] for one in found["proposed"]["columns"]} == set(TITLES)
    json.dumps(found, allow_nan=False)


def test_a_column_is_asked_for_as_any_channel(visitor, kept):
    """The pitch's numbers reach 3: as a height they are mm, whatever its header says."""
    path = f"/measurements/{kept['id']}/columns"
    [pitch] = [one for one in visitor.get(path).json()["columns"] if one["name"] == "Nickwinkel"]
    asked = {"index": pitch["index"], "channel": "wheel.fl.z"}
    found = visitor.get(f"{path}/candidate", params=asked).json()
    assert (found["channel"], found["unit"], found["doubted"]) == ("wheel.fl.z", "mm", True)
    reply = visitor.get(f"{path}/candidate", params=asked | {"channel": "wheel.z"})
    assert reply.status_code == 422
    assert "wheel.z" in reply.json()["detail"]
    reply = visitor.get(f"{path}/candidate", params=asked | {"index": 9})
    assert "There is no column 9" in reply.json()["detail"]


def test_what_is_proposed_can_be_put_and_signs_are_offered(visitor, kept):
    path = f"/measurements/{kept['id']}"
    proposed = visitor.get(f"{path}/columns").json()["proposed"]
    mapped = visitor.put(f"{path}/mapping", json=proposed)
    assert mapped.status_code == 200, mapped.text
    found = mapped.json()
    assert found["needs_mapping"] is False
    assert found["usable_for_identification"] is True
    assert found["mapping"] == proposed
    [offered] = found["sign_suggestions"]
    assert (offered["channel"], offered["flip"]) == ("chassis.pitch", True)
    assert offered["correlation"] < -0.5
    assert "turn its sign over" in offered["sentence"]
    assert visitor.get(path).json() == found
    assert visitor.get(f"{path}/columns").json()["mapping"] == proposed
    next(one for one in proposed["columns"] if one["channel"] == "chassis.pitch")["sign_sure"] = (
        True
    )
    sure = visitor.put(f"{path}/mapping", json=proposed).json()
    assert sure == found | {"mapping": proposed, "sign_suggestions": []}


@pytest.mark.parametrize("turned", [(), ("chassis.pitch",)])
def test_signs_of_a_file_with_our_names_are_looked_at_too(visitor, turned):
    """Oracle: the sample as it is, and with its pitch turned over; Flip is a mapping then."""
    run = read_run(NATIVE)
    over = {name: (-1 if name in turned else 1) * run[name][::STEP] for name in run.columns}
    sent = run_to_csv(Run("lap", run.time[::STEP], over)).encode()
    found = visitor.upload(sent, "lap.csv").json()
    assert (found["needs_mapping"], found["mapping"]) == (False, None)
    assert [one["channel"] for one in found["sign_suggestions"]] == [*turned]
    path = f"/measurements/{found['id']}"
    mapping = visitor.get(f"{path}/columns").json()["proposed"]
    for one in mapping["columns"]:
        one["sign"] = -1 if one["channel"] in turned else 1
    assert visitor.put(f"{path}/mapping", json=mapping).json()["sign_suggestions"] == []
    assert visitor.delete(f"{path}/mapping").status_code == 200
    assert visitor.get(path).json()["sign_suggestions"] == found["sign_suggestions"]


def test_a_mapping_and_its_run_are_saved_for_the_command_line(visitor, kept, tmp_path, capsys):
    """Oracle: `ridetune channels` takes the mapping for the file's own, and the run is the same."""
    path = f"/measurements/{kept['id']}"
    reply = visitor.get(f"{path}/mapping")
    assert (reply.status_code, reply.json()["code"]) == (404, "not-found")
    mapping = visitor.get(f"{path}/columns").json()["proposed"]
    next(one for one in mapping["columns"] if one["channel"] == "chassis.pitch")["sign"] = -1
    visitor.put(f"{path}/mapping", json=mapping)
    saved = {name: visitor.get(f"{path}/{name}") for name in ("mapping", "run.csv", "run.toml")}
    assert saved["mapping"].json() == mapping
    named = [one.headers["content-disposition"].partition("''")[2] for one in saved.values()]
    assert named == ["lap-mapping.json", "lap-run.csv", "lap-run.toml"]
    for name, one in zip(named, saved.values(), strict=True):
        (tmp_path / name).write_bytes(one.content)
    (tmp_path / "lap.csv").write_bytes(foreign(turned=("chassis.pitch",)))
    assert main(["channels", str(tmp_path / "lap.csv"), "--mapping", str(tmp_path / named[0])]) == 0
    assert "Warning" not in capsys.readouterr().out
    by_mapping = read_recording(tmp_path / "lap.csv", read_mapping(tmp_path / named[0]))
    by_names = read_run(tmp_path / named[1])
    assert list(by_names.columns) == list(by_mapping.columns)
    for name in by_mapping.columns:
        np.testing.assert_allclose(by_names[name], by_mapping[name], rtol=1e-11)


def test_a_mapped_file_is_a_measurement_like_any_other(visitor, kept):
    """Once pitch is turned back, frames, notes and a simulation are those of the native file."""
    path = f"/measurements/{kept['id']}"
    mapping = visitor.get(f"{path}/columns").json()["proposed"]
    next(one for one in mapping["columns"] if one["channel"] == "chassis.pitch")["sign"] = -1
    found = visitor.put(f"{path}/mapping", json=mapping).json()
    assert found["sign_suggestions"] == []
    run = read_run(NATIVE)
    binary = visitor.get(f"{path}/frames", headers={"Accept": "application/vnd.ridetune.frames"})
    _, values = read_binary(binary.content)
    for name in TITLES:
        np.testing.assert_allclose(values[name], run[name][::STEP], rtol=1e-6, atol=1e-7)
    noted = visitor.put(f"{path}/notes", content=b'[noise]\n"chassis.z" = 0.001\n').json()
    assert noted == found | {"noise": {"chassis.z": 0.001}}
    simulation = {"rims": {"measurement": kept["id"]}, "max_samples": 2}
    head = visitor.post("/simulations", json=simulation).json()
    assert head["fit_percent"]["chassis.pitch"] > 50.0


def test_another_mapping_makes_another_run(visitor, kept):
    """What was remembered of the first one does not outlive it."""
    path = f"/measurements/{kept['id']}"
    mapping = visitor.get(f"{path}/columns").json()["proposed"]
    visitor.put(f"{path}/mapping", json=mapping)
    first = visitor.get(f"{path}/frames?channels=chassis.z").json()["values"]["chassis.z"]
    next(one for one in mapping["columns"] if one["channel"] == "chassis.z")["gain"] = 2.0
    visitor.put(f"{path}/mapping", json=mapping)
    second = visitor.get(f"{path}/frames?channels=chassis.z").json()["values"]["chassis.z"]
    np.testing.assert_allclose(second, 2.0 * np.array(first), rtol=1e-6)
    forgotten = visitor.delete(f"{path}/mapping").json()
    assert forgotten == kept


def test_a_job_reads_a_recording_as_it_was_mapped_then(visitor, kept):
    """Its mapping, and what was done to it, are the job's for ever."""
    path, shared = f"/measurements/{kept['id']}", visitor.client.app.state.services
    visitor.put(f"{path}/mapping", json=visitor.get(f"{path}/columns").json()["proposed"])
    mapped = shared.store.measurements.get(visitor.id, kept["id"])
    run = shared.recordings.run(mapped)
    assert visitor.delete(f"{path}/mapping").json()["needs_mapping"] is True
    again = shared.recordings.run(as_stated(shared.store, visitor.id, stated(mapped)))
    np.testing.assert_array_equal(again["chassis.z"], run["chassis.z"])


def test_notes_of_a_file_that_needs_a_mapping_wait_for_it(visitor, kept):
    path = f"/measurements/{kept['id']}"
    noted = visitor.put(f"{path}/notes", content=b'[noise]\n"chassis.z" = 0.5\n').json()
    assert noted == kept | {"noise": {"chassis.z": 0.5}}
    proposed = visitor.get(f"{path}/columns").json()["proposed"]
    found = visitor.put(f"{path}/mapping", json=proposed).json()
    assert found["noise"] == {"chassis.z": 0.5}
    assert any("is this one in mm?" in one for one in found["warnings"])


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"columns": [{"column": "Aufbauhub", "channel": "chassis.z", "unit": "s"}]}, "columns[0]"),
        ({"columns": [{"column": "nowhere", "channel": "chassis.z", "unit": "m"}]}, "'nowhere'"),
        ({"columns": []}, "names no channel besides time"),
        ({"colums": []}, 'did you mean "columns"?'),
    ],
)
def test_a_mapping_that_does_not_fit_is_refused_and_nothing_changes(visitor, kept, wrong, said):
    path = f"/measurements/{kept['id']}"
    reply = visitor.put(f"{path}/mapping", json=wrong)
    assert (reply.status_code, reply.json()["code"]) == (422, "measurement")
    assert said in reply.json()["detail"]
    assert visitor.get(path).json() == kept
    assert visitor.put("/measurements/none/mapping", json=wrong).status_code == 404


def test_our_own_names_can_be_mapped_otherwise(visitor):
    """The unit of one column is corrected, its channel stays."""
    sent = visitor.upload(short_recording().replace(b"chassis.z [mm]", b"chassis.z [m]")).json()
    assert sent["needs_mapping"] is False
    path = f"/measurements/{sent['id']}"
    found = visitor.get(f"{path}/columns").json()
    guess = next(one["guess"] for one in found["columns"] if one["name"] == "chassis.z")
    assert (guess["unit"], guess["doubted"]) == ("mm", True)
    mapped = visitor.put(f"{path}/mapping", json=found["proposed"]).json()
    height = next(one for one in mapped["channels"] if one["name"] == "chassis.z")
    assert height["maximum"] == pytest.approx(0.004)
    assert visitor.delete(f"{path}/mapping").json() == sent


def test_a_copy_without_a_mapping_does_not_join_two_that_are_mapped_apart(visitor, kept):
    """It is the same as the first of its bytes alone, until it is mapped, too."""
    data = foreign(turned=("chassis.pitch",))
    turned, bare = (visitor.upload(data, name).json() for name in ("turned.csv", "bare.csv"))
    assert bare["same_data_as"] == kept["id"]
    path = f"/measurements/{kept['id']}"
    mapping = visitor.get(f"{path}/columns").json()["proposed"]
    visitor.put(f"{path}/mapping", json=mapping)
    [pitch] = [one for one in mapping["columns"] if one["channel"] == "chassis.pitch"]
    pitch["sign"] = -pitch["sign"]
    visitor.put(f"/measurements/{turned['id']}/mapping", json=mapping)
    same = {one["name"]: one["same_data_as"] for one in visitor.get("/measurements").json()}
    assert (same["turned.csv"], same["bare.csv"]) == (None, kept["id"])
    visitor.put(f"/measurements/{bare['id']}/mapping", json=mapping)
    same = {one["name"]: one["same_data_as"] for one in visitor.get("/measurements").json()}
    assert (same["turned.csv"], same["bare.csv"]) == (None, turned["id"])


def test_a_preview_shows_the_file_s_numbers_over_time_in_s(visitor, kept):
    path = f"/measurements/{kept['id']}/columns/preview?index=2&index=3&points=40"
    pitch, a_x = visitor.get(path).json()
    assert (pitch["name"], pitch["unit"], pitch["time_unit"]) == ("Nickwinkel", "rad", "s")
    assert (a_x["index"], a_x["name"]) == (3, "acc_x_g")
    run = read_run(NATIVE)
    degrees = -np.degrees(run["chassis.pitch"][::STEP])
    assert len(pitch["time"]) == len(pitch["minimum"]) == 40
    assert min(pitch["minimum"]) == pytest.approx(degrees.min())
    assert max(pitch["maximum"]) == pytest.approx(degrees.max())
    assert pitch["time"][0] == pytest.approx(run.time[0])
    assert run.time[0] < pitch["time"][-1] < run.time[-1]
    beyond = visitor.get(f"/measurements/{kept['id']}/columns/preview?index=9")
    assert (beyond.status_code, beyond.json()["field"]) == (422, "index")
    assert "they go from 0 to 8" in beyond.json()["detail"]


def test_a_preview_of_any_length_asks_for_few_numbers(monkeypatch, visitor, kept):
    """Oracle: no whole column, and no part of one, leaves the child."""

    def whole(*_):
        raise AssertionError("the samples themselves were asked for")

    for name in ("values", "part", "in_si"):
        monkeypatch.setattr(ChildTable, name, whole)
    shown = visitor.get(f"/measurements/{kept['id']}/columns/preview?index=2&points=40").json()
    assert len(shown[0]["time"]) == 40


def test_a_mapping_that_is_kept_is_proposed_for_the_next_file(visitor, kept):
    """A column was taken for nothing, and pitch turned over: as the engineer said."""
    path = f"/measurements/{kept['id']}"
    mapping = visitor.get(f"{path}/columns").json()["proposed"]
    mapping["columns"] = mapping["columns"][:3]
    mapping["columns"][2]["sign"] = -1
    stored = visitor.post("/mappings", json={"name": "car 7", "mapping": mapping})
    assert (stored.status_code, stored.json()) == (201, {"name": "car 7", "mapping": mapping})
    other = {"columns": [{"column": "other", "channel": "chassis.z", "unit": "m"}]}
    visitor.post("/mappings", json={"name": "another car", "mapping": other})
    names = [one["name"] for one in visitor.get("/mappings").json()]
    assert names == ["another car", "car 7"]
    later = visitor.upload(foreign(step=10), "next.csv").json()
    found = visitor.get(f"/measurements/{later['id']}/columns").json()
    assert (found["template"], found["proposed"]) == ("car 7", mapping)
    assert visitor.delete("/mappings/car 7").status_code == 204
    assert visitor.delete("/mappings/car 7").status_code == 404
    found = visitor.get(f"/measurements/{later['id']}/columns").json()
    assert found["template"] is None
    bad = visitor.post("/mappings", json={"name": "x", "mapping": {"columns": 1}})
    assert bad.status_code == 422


@pytest.mark.parametrize("name", [".", "..", "a/b", "a\\b", "../x"])
def test_a_name_that_an_address_cannot_hold_is_refused(visitor, name):
    """A browser makes the session's own address of mappings/.. ."""
    mapping = {"columns": [{"column": "x", "channel": "chassis.z", "unit": "m"}]}
    reply = visitor.post("/mappings", json={"name": name, "mapping": mapping})
    assert (reply.status_code, reply.json()["field"]) == (422, "name")
    assert "give a name without / and \\ that is more than dots" in reply.json()["detail"]
    assert visitor.get("/mappings").json() == []


@pytest.mark.parametrize("path", ["/", "/mappings/"])
def test_an_address_with_a_slash_too_many_deletes_nothing(visitor, path):
    """Oracle: what is there afterwards; httpx follows a redirection as a browser does."""
    reply = visitor.delete(path, follow_redirects=True)
    assert reply.status_code in (404, 405)
    assert visitor.get().status_code == 200
