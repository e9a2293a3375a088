"""Files of other names from disk. Oracle: the numbers that were written."""

import re
from datetime import UTC, datetime

import numpy as np
import pytest
from ridetune.engine.errors import MeasurementError, UnmappedError
from ridetune.engine.mapping.mapping import ChannelMapping, MappedColumn
from ridetune.engine.mapping.reading import parse_recording, read_recording, survey_file
from ridetune.engine.measurement import read_run

TIME = 0.01 * np.arange(500)
HEIGHT = ChannelMapping(
    (MappedColumn("Zeit", "time", "s"), MappedColumn("Aufbauhub", "chassis.z", "mm"))
)


@pytest.fixture
def text(tmp_path):
    """A text with a gap of five cells, a column of words, and notes beside it."""
    lines = ["Zeit [s],Aufbauhub [mm],Bemerkung,Oeldruck [bar]"]
    for k, time in enumerate(TIME.tolist()):
        height = "" if 200 <= k < 205 else f"{3.0 * time!r}"
        lines.append(f"{time!r},{height},{'start' if k == 0 else 'x'},4")
    path = tmp_path / "lap.csv"
    path.write_text("\n".join(lines))
    (tmp_path / "lap.toml").write_text('description = "wet"\n[noise]\n"chassis.z" = 0.001\n')
    return path


def test_a_text_is_surveyed_column_by_column(text):
    found = survey_file(text)
    assert (found.kind, found.source) == ("CSV", "lap.csv")
    assert sorted(found.known) == [0, 1, 3]
    assert found.known[1].missing == 5
    assert any("column Bemerkung: 'start' is not a number" in one for one in found.warnings)
    chosen = {one.column: (one.channel, one.unit) for one in found.guess.mapping.columns}
    assert chosen == {"Zeit": ("time", "s"), "Aufbauhub": ("chassis.z", "mm")}


def test_a_column_without_numbers_is_taken_for_no_channel(text):
    """Its name alone says what it is: words below it, and nothing."""
    for cell in ("fast", ""):
        lines = text.read_text().splitlines()
        lines[0] = lines[0].replace("Bemerkung", "Geschwindigkeit [m/s]")
        lines[1:] = [re.sub(r"(,start|,x),", f",{cell},", line) for line in lines[1:]]
        text.with_name("words.csv").write_text("\n".join(lines))
        found = survey_file(text.with_name("words.csv"))
        assert "chassis.v_x" not in [one.channel for one in found.guess.mapping.columns]
        assert found.guess.candidates[2] == ()


def test_a_text_is_read_with_its_notes_and_its_gap_bridged(text):
    with pytest.raises(UnmappedError):
        read_recording(text)
    run = read_recording(text, HEIGHT)
    np.testing.assert_allclose(run["chassis.z"], 3e-3 * TIME, rtol=1e-12)
    assert (run.description, run.noise) == ("wet", {"chassis.z": 0.001})
    assert "has no number in 5 samples" in run.warnings[0]
    parsed = parse_recording(text.read_bytes(), "lap.csv", HEIGHT, noise={"chassis.z": 0.002})
    np.testing.assert_array_equal(parsed["chassis.z"], run["chassis.z"])
    assert parsed.noise == {"chassis.z": 0.002}


def test_our_own_names_need_no_mapping(tmp_path):
    path = tmp_path / "own.csv"
    rows = "\n".join(f"{time!r},{3.0 * time!r}" for time in TIME.tolist())
    path.write_text(f"time [s],chassis.z [mm]\n{rows}\n")
    np.testing.assert_array_equal(read_recording(path)["chassis.z"], read_run(path)["chassis.z"])
    with pytest.raises(MeasurementError, match="no column called 'Zeit'"):
        read_recording(path, HEIGHT)


def test_a_file_that_is_not_there_is_named(tmp_path):
    for read in (survey_file, lambda path: read_recording(path, HEIGHT)):
        with pytest.raises(MeasurementError, match=r"nowhere\.csv: the file cannot be read"):
            read(tmp_path / "nowhere.csv")


def test_groups_of_an_mdf_with_their_own_clocks_become_one_run(tmp_path):
    """100 Hz and 10 Hz; straight lines are interpolated without error. No time is mapped."""
    asammdf = pytest.importorskip("asammdf")
    path, slow = tmp_path / "lap.mf4", 0.1 * np.arange(50)
    with asammdf.MDF(version="4.10") as file:
        file.start_time = datetime(2024, 5, 1, tzinfo=UTC)
        for time, name, unit, slope in (
            (TIME, "Car.CFL.tz", "mm", 2.0),
            (slow, "VehSpd", "km/h", 7.0),
        ):
            file.append(
                [asammdf.Signal(slope * time, time, name=name, unit=unit)], common_timebase=True
            )
        file.save(path)
    found = survey_file(path)
    assert found.kind == "MDF4"
    assert {one.channel for one in found.guess.mapping.columns} == {"wheel.fl.z", "chassis.v_x"}
    run = read_recording(path, found.guess.mapping)
    np.testing.assert_allclose(run.time, TIME[: 10 * slow.size - 9], atol=1e-9)
    np.testing.assert_allclose(run["wheel.fl.z"], 2e-3 * run.time, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(run["chassis.v_x"], 7.0 / 3.6 * run.time, rtol=1e-9, atol=1e-12)
    assert "VehSpd (every 0.1 s)" in run.warnings[-1]
