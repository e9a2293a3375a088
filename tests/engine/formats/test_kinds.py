"""Every kind of file gives back what its own library was given.

Oracle: the numbers, names and units that were written; the library's own reader where it has one.
"""

from datetime import UTC, datetime
from pathlib import Path

import cmerg
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import pyuff
from asammdf import MDF, Signal
from nptdms import ChannelObject, TdmsWriter
from numpy.testing import assert_allclose
from ridetune.engine.clocks import even_time
from ridetune.engine.errors import MeasurementError
from ridetune.engine.formats.child import ChildTable
from ridetune.engine.formats.envelope import envelope
from ridetune.engine.formats.kinds import kind_of
from ridetune.engine.formats.table import Column, HeldTable
from ridetune.engine.mdf4 import run_to_mdf4
from ridetune.engine.measurement import read_run
from ridetune.engine.run import Run

from tests import files_of_kinds as files

DATA = Path(__file__).parents[2] / "data"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("kinds")
    for name, (write, _, _) in files.WRITERS.items():
        write(made / name)
    return made


def time_of(table, index):
    column = table.columns[index]
    return even_time(column) if column.clock is None else table.values(column.clock)


@pytest.mark.parametrize("name", files.WRITERS)
def test_columns_units_and_times_come_back(folder, name):
    _, kind, off = files.WRITERS[name]
    with ChildTable(folder / name, name) as table:
        assert table.kind == kind
        for channel, (values, unit) in files.CHANNELS.items():
            index = [column.name for column in table.columns].index(channel)
            column = table.columns[index]
            assert (column.unit, column.samples) == (unit, len(values))
            assert_allclose(table.values(index), values, rtol=0, atol=off)
            # Some forms keep the first time and the step, others five digits of every time.
            assert_allclose(time_of(table, index), files.TIME, rtol=1e-5, atol=1e-15)


@pytest.mark.parametrize("name", ["r.csv", "r.mf4", "r.mat", "r73.mat", "r.rsp", "r.zip"])
def test_a_file_titled_like_our_channels_is_a_run(folder, name):
    *_, off = files.WRITERS[name]
    run = read_run(folder / name)
    assert run.warnings == ()
    assert run.columns == ["chassis.z", "chassis.a_x"]
    # mm become m, which may round once more.
    assert_allclose(run["chassis.z"], 1e-3 * files.Z, rtol=1e-15, atol=1e-3 * off)
    assert_allclose(run["chassis.a_x"], files.A_X, rtol=1e-15, atol=off)


@pytest.mark.parametrize("name", ["r.mf4", "r.tdms", "r.csv"])
def test_the_content_tells_the_kind_and_not_the_name(folder, tmp_path, name):
    other = tmp_path / "recording.dat"
    other.write_bytes((folder / name).read_bytes())
    with other.open("rb") as stream:
        assert kind_of(stream, other.name) == files.WRITERS[name][1]


def test_a_carmaker_recording_reads_as_cmerg_reads_it(folder):
    """Oracle: cmerg."""
    theirs = cmerg.ERG(str(folder / "r.erg"))
    with ChildTable(folder / "r.erg", "r.erg") as table:
        for index, column in enumerate(table.columns):
            assert_allclose(table.values(index), theirs.signals[column.name].data)


def test_a_carmaker_recording_without_its_description_is_refused(folder, tmp_path):
    (tmp_path / "r.erg").write_bytes((folder / "r.erg").read_bytes())
    with pytest.raises(MeasurementError, match=r"keep r\.erg\.info beside it, or pack the two"):
        read_run(tmp_path / "r.erg")


@pytest.mark.parametrize("name", ["r.h5", "r.tdms", "r.mf4"])
def test_an_envelope_holds_the_extremes_of_its_stretches(folder, name):
    """Oracle: the extremes of the numbers themselves, five samples a stretch."""
    with ChildTable(folder / name, name) as table:
        index = [column.name for column in table.columns].index("chassis.z")
        found = table.envelope(index, 10)
    stretches = files.Z.reshape(10, 5)
    assert_allclose(found.minimum, stretches.min(axis=1))
    assert_allclose(found.maximum, stretches.max(axis=1))
    assert_allclose(found.time, files.TIME[::5], atol=1e-15)


def test_an_envelope_of_no_samples_has_no_stretches():
    found = envelope(HeldTable("r", "CSV", (Column("z", "mm", 0),), [np.empty(0)]), 0, 10)
    assert (found.time.size, found.minimum.size, found.maximum.size) == (0, 0, 0)


def test_noise_and_description_of_our_own_mdf4_come_back(tmp_path):
    run = Run("r", files.TIME, {"chassis.z": 1e-3 * files.Z}, {"chassis.z": 4e-5})
    facts = {"description": "wet road", "vehicle": "car", "manoeuvre": "m.json", "plant": "8dof"}
    (tmp_path / "r.mf4").write_bytes(
        run_to_mdf4(run, {"chassis.z": "mm"}, facts, datetime.now(UTC))
    )
    found = read_run(tmp_path / "r.mf4")
    assert (found.noise, found.description) == ({"chassis.z": 4e-5}, "wet road")
    assert_allclose(found["chassis.z"], run["chassis.z"], rtol=1e-15)
    (tmp_path / "r.toml").write_text('[noise]\n"chassis.z" = 1e-4\n')
    assert read_run(tmp_path / "r.mf4").noise == {"chassis.z": 1e-4}


def of_two_clocks(path, steps, begins=(0.0, 0.0), seconds=1.0):
    with MDF(version="4.10") as file:
        for name, step, begin in zip(("chassis.z", "chassis.a_x"), steps, begins, strict=True):
            time = begin + step * np.arange(int(seconds / step) + 1)
            file.append([Signal(0.01 * time, time, name=name)], common_timebase=True)
        file.save(path, overwrite=True)
    return path


def test_a_coarser_clock_is_interpolated_onto_the_finest(tmp_path):
    """Oracle: a straight line, which linear interpolation keeps."""
    run = read_run(of_two_clocks(tmp_path / "r.mf4", (0.01, 0.03), seconds=0.9))
    assert_allclose(run["chassis.a_x"], 0.01 * run.time, atol=1e-15)
    assert "Interpolated to the times of chassis.z: chassis.a_x (every 0.03 s)." in run.warnings


def test_the_run_is_cut_to_what_its_clocks_share(tmp_path):
    run = read_run(of_two_clocks(tmp_path / "r.mf4", (0.01, 0.01), (0.0, 0.205)))
    assert 0.205 <= run.time[0] < 0.215
    assert run.time[-1] == pytest.approx(1.0)
    assert any("Only the time from 0.205 to 1 s has all" in w for w in run.warnings)


def test_universal_files_are_in_the_units_of_their_data_set_164(tmp_path):
    """Of a file in mm and mN, whose factors are file units over SI; an axis that states its unit
    goes before.
    """
    path = tmp_path / "r.uff"
    file = pyuff.UFF(str(path))
    units = {"units_code": 5, "length": 1000.0, "force": 1000.0, "temp": 1.0, "temp_offset": 273.15}
    files.write_set(file, {"type": 164, **units})
    columns = [("z", 8, ""), ("a", 12, ""), ("f", 13, ""), ("mm", 8, "mm"), ("m", 8, "m")]
    for name, kind, label in columns:
        head = {"type": 58, "func_type": 1, "rsp_node": 1, "rsp_dir": 3, "ref_node": 0}
        axes = {"ordinate_axis_units_lab": label, "ordinate_spec_data_type": kind}
        head |= {"ref_dir": 0, "id1": name, "abscissa_spec_data_type": 17, "binary": 0}
        head |= {"orddenom_spec_data_type": 0, "abscissa_axis_units_lab": "s"}
        data = {"x": files.TIME, "data": files.Z, "abscissa_spacing": 1}
        files.write_set(file, head | axes | data)
    with ChildTable(path, "r.uff") as table:
        assert [one.unit for one in table.columns] == ["m", "m/s^2", "N", "mm", "m"]
        for index, factor in enumerate((1e-3, 1e-3, 1e-3, 1.0, 1.0)):
            assert_allclose(table.values(index), factor * files.Z, atol=factor * 5.1e-11)
        [said] = table.warnings
    assert said.startswith("m is in m by its axis, but in 0.001 m by the file's units")


BEGIN = np.datetime64("2024-03-12T10:00:00.000000")
LATER = BEGIN + np.timedelta64(1500, "ms")


@pytest.mark.parametrize(
    ("begins", "starts", "said"),
    [((LATER, BEGIN), (1.75, 0.25), []), ((BEGIN, None), (0.25, 0.25), ["When z1 began"])],
)
def test_waveforms_begin_when_they_say(tmp_path, begins, starts, said):
    with TdmsWriter(tmp_path / "r.tdms") as writer:
        for number, begin in enumerate(begins):
            told = {"wf_increment": 0.01, "wf_start_offset": 0.25}
            dated = {} if begin is None else {"wf_start_time": begin}
            one = ChannelObject(f"group {number}", f"z{number}", files.Z, {**told, **dated})
            writer.write_segment([one])
    with ChildTable(tmp_path / "r.tdms", "r.tdms") as table:
        assert [column.start for column in table.columns] == pytest.approx(starts)
        assert [one[:13] for one in table.warnings] == said
        assert_allclose(time_of(table, 0), starts[0] + files.TIME, rtol=1e-12)


def test_dates_of_a_file_count_from_one_beginning(tmp_path):
    milliseconds = (10 * np.arange(files.Z.size)).astype("timedelta64[ms]")
    dates = {"A": LATER + milliseconds, "B": BEGIN + milliseconds}
    with TdmsWriter(tmp_path / "r.tdms") as writer:
        for group, time in dates.items():
            z = ChannelObject(group, "z", files.Z)
            writer.write_segment([ChannelObject(group, "time", time), z])
    with ChildTable(tmp_path / "r.tdms", "r.tdms") as table:
        assert_allclose(time_of(table, 1), 1.5 + files.TIME, atol=1e-9)
        assert_allclose(time_of(table, 3), files.TIME, atol=1e-9)
    pq.write_table(pa.table({**dates, "z": files.Z}), tmp_path / "r.parquet")
    with ChildTable(tmp_path / "r.parquet", "r.parquet") as table:
        assert_allclose(table.values(0), 1.5 + files.TIME, atol=1e-9)
        assert_allclose(table.values(1), files.TIME, atol=1e-9)


@pytest.mark.parametrize(
    ("steps", "begins", "said"),
    [((0.01, 0.2), (0.0, 0.0), "export them at one rate"), ((0.01, 0.01), (0.0, 5.0), "overlap")],
)
def test_clocks_too_different_are_refused(tmp_path, steps, begins, said):
    with pytest.raises(MeasurementError, match=said):
        read_run(of_two_clocks(tmp_path / "r.mf4", steps, begins))


@pytest.mark.parametrize(
    ("name", "said"),
    [("non_ascii_header.uff", "ref6_23_Mar is a spectrum, not a time history"), ("time", "")],
)
def test_files_of_other_programs(name, said):
    """Oracle: what the text of the file says; its last row of numbers is not filled."""
    if said:
        with pytest.raises(MeasurementError, match=said):
            read_run(DATA / "uff" / name)
        return
    path = DATA / "uff/time-history-not-all-columns-filled.uff"
    with ChildTable(path, path.name) as table:
        (column,) = table.columns
        assert (column.unit, column.samples, column.step) == ("m/s\u00b2", 13, 5e-5)
        values = table.values(0)
    assert_allclose([values[0], values[-1]], [-3.81956, -5.84096])
