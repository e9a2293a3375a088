import math
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import ridetune.sample_runs
from ridetune.engine.channels import CHANNELS
from ridetune.engine.errors import MeasurementError, UnmappedError
from ridetune.engine.formats import csv_file
from ridetune.engine.formats.opening import opened_bytes
from ridetune.engine.mapping.apply import apply
from ridetune.engine.mapping.mapping import ChannelMapping, MappedColumn
from ridetune.engine.measurement import (
    BLOCK,
    missing_for_identification,
    parse_run,
    read_run,
    run_to_csv,
    write_run,
)
from ridetune.engine.run import Run

SAMPLES = 20
TIME = np.arange(SAMPLES) / 100
WAVE = np.sin(20 * TIME)
RECORDED = [
    "chassis.z",
    "chassis.pitch",
    "chassis.roll",
    "chassis.a_x",
    "wheel.fl.z",
    "wheel.fr.z",
    "wheel.rl.z",
    "wheel.rr.z",
]


def csv_of(columns):
    """A CSV text from titles and values."""
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(map(repr, map(float, row))) for row in rows)]
    return "\n".join(lines) + "\n"


def parse(columns, **options):
    return parse_run(csv_of(columns).encode(), "run.csv", **options)


def refusal(content):
    data = content if isinstance(content, bytes) else csv_of(content).encode()
    with pytest.raises(MeasurementError) as caught:
        parse_run(data, "run.csv")
    return str(caught.value)


def small(*titles):
    """A plausible recording: time and a 10 mm wave in each titled column."""
    return {"time [s]": TIME, **{title: 0.01 * WAVE for title in titles}}


def test_units_become_si():
    run = parse(
        {
            "time [ms]": 1000 * TIME,
            "chassis.z [mm]": 10 * WAVE,
            "chassis.pitch [deg]": WAVE,
            "chassis.a_x [g]": 0.1 * WAVE,
            "chassis.v_x [km/h]": 36 + WAVE,
        }
    )
    np.testing.assert_allclose(run.time, TIME, rtol=1e-15)
    np.testing.assert_allclose(run["chassis.z"], 0.01 * WAVE, rtol=1e-14)
    np.testing.assert_allclose(run["chassis.pitch"], np.radians(WAVE), rtol=1e-14)
    np.testing.assert_allclose(run["chassis.a_x"], 0.980665 * WAVE, rtol=1e-14)
    np.testing.assert_allclose(run["chassis.v_x"], 10 + WAVE / 3.6, rtol=1e-14)
    assert run.warnings == ()


def test_the_shipped_recordings_are_read_without_a_warning():
    folder = Path(ridetune.sample_runs.__path__[0])
    run = read_run(folder / "detailed/manoeuvre_2.csv")
    assert (run.time.size, run.duration, run.warnings) == (4001, 20.0, ())
    assert run.sample_step == pytest.approx(0.005)
    assert np.max(np.abs(run["chassis.z"])) < 0.05
    assert missing_for_identification(run) == ()


def test_names_may_be_written_in_any_case():
    assert parse(small("Chassis.Z [m]", "WHEEL.FL.Z (m)")).columns == ["chassis.z", "wheel.fl.z"]


def test_time_need_not_come_first_nor_start_at_zero_nor_be_uniform():
    time = 1e5 + TIME**2
    run = parse({"chassis.z [m]": 0.01 * WAVE, "time [s]": time})
    np.testing.assert_array_equal(run.time, time)


def test_writing_and_reading_returns_the_same_run(tmp_path):
    rng = np.random.default_rng(1)
    scale = 10.0 ** rng.integers(-9, 9, len(CHANNELS))
    channels = {
        name: size * rng.normal(size=SAMPLES)
        for name, size in zip(CHANNELS, scale, strict=True)
        if name != "time"
    }
    written = Run("r.csv", TIME + 1e4, channels | {"seat.driver.a_z": WAVE})
    write_run(written, tmp_path / "r.csv")
    found = read_run(tmp_path / "r.csv")
    assert found.columns == written.columns
    np.testing.assert_allclose(found.time, written.time, rtol=1e-11)
    for name in written.columns:
        np.testing.assert_allclose(found[name], written[name], rtol=1e-11)


def test_a_written_run_names_si_units_in_the_table_s_order():
    run = Run("r", TIME, {"wheel.fl.z": WAVE, "chassis.v_x": WAVE})
    head, *rows = run_to_csv(run).splitlines()
    assert head == "time [s],chassis.v_x [m/s],wheel.fl.z [m]"
    assert len(rows) == SAMPLES


def test_a_long_run_is_written_in_little_memory(tmp_path):
    """Oracle: the text is 12 bytes and more a number, of which a small part is held at a time."""
    count = 20 * BLOCK + 1
    time = 0.001 * np.arange(count)
    run = Run("r.csv", time, {"chassis.z": np.sin(time), "chassis.a_x": np.cos(time)})
    tracemalloc.start()
    write_run(run, tmp_path / "r.csv")
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 0.5 * (tmp_path / "r.csv").stat().st_size
    found = read_run(tmp_path / "r.csv")
    np.testing.assert_allclose(found["chassis.a_x"], run["chassis.a_x"], rtol=1e-11)


def test_notes_beside_the_file_state_noise_and_description(tmp_path):
    (tmp_path / "r.csv").write_text(csv_of(small("chassis.z [m]", "chassis.roll [rad]")))
    (tmp_path / "r.toml").write_text(
        'description = "wet"\n[noise]\n"chassis.z" = 1e-3\n"chassis.roll" = 1e-4\n'
    )
    run = read_run(tmp_path / "r.csv", noise={"chassis.z": 2e-3})
    assert run.description == "wet"
    assert run.noise == {"chassis.z": 2e-3, "chassis.roll": 1e-4}


def test_times_counted_from_1970_keep_their_milliseconds():
    """Oracle: the samples themselves, 1 ms apart at 1.7e9 s; doubles are 2.4e-7 s apart there."""
    time = 1.7e9 + 0.001 * np.arange(SAMPLES)
    run = parse_run(run_to_csv(Run("r", time, {"chassis.z": 0.01 * WAVE})).encode(), "run.csv")
    np.testing.assert_allclose(run.time, time, rtol=0, atol=1e-5)


def test_a_number_too_large_for_si_is_named_with_its_cell():
    values = 0.01 * WAVE
    values[3] = 1e307
    message = refusal({"time [s]": TIME, "chassis.z [km]": values})
    assert "line 5, column chassis.z [km]: '1e+307' is too large; correct it" in message


def test_a_stated_noise_in_the_wrong_unit_is_doubted():
    """0.5 was meant in mm."""
    [warning] = parse(
        small("chassis.z [m]", "chassis.a_x [m/s^2]"), noise={"chassis.z": 0.5}
    ).warnings
    assert "noise of chassis.z, 0.5 m," in warning
    assert "is this one in mm?" in warning


def test_stated_noise_must_be_positive():
    with pytest.raises(MeasurementError, match=r"run\.csv: noise of chassis\.z is 0"):
        parse(small("chassis.z [m]"), noise={"chassis.z": 0})


# --- names and units --------------------------------------------------------------------------


def test_a_column_that_is_no_channel_is_left_out_with_a_warning():
    run = parse(small("chassis.z [m]", "oil temperature", "chassis.a_y [m/s^2]", "chassis.yaw"))
    assert run.columns == ["chassis.z"]
    (warning,) = run.warnings
    assert "oil temperature, chassis.a_y [m/s^2], chassis.yaw" in warning


@pytest.mark.parametrize(
    ("title", "known"),
    [
        ("chassis.pich [deg]", "chassis.pitch"),
        ("whel.fl.z [mm]", "wheel.fl.z"),
        ("wheel_fl_z [mm]", "wheel.fl.z"),
        ("WheelFL.z", "wheel.fl.z"),
        ("wheel.lf.z [mm]", "wheel.fl.z"),
        ("chasis.ax [m/s^2]", "chassis.a_x"),
        ("chassis.rol", "chassis.roll"),
    ],
)
def test_a_misspelt_channel_is_refused_rather_than_lost(title, known):
    with pytest.raises(UnmappedError) as caught:
        parse(small("chassis.z [m]", title))
    message = str(caught.value)
    assert f"column 3 is called {title}; did you mean {known}?" in message


def test_a_name_near_a_channel_that_is_there_is_no_misspelling():
    run = parse(small("chassis.pitch [rad]", "chassis.pitc [rad]"))
    assert run.columns == ["chassis.pitch"]


@pytest.mark.parametrize(
    "name",
    ["chassis.y", "chassis.a_y", "chassis.yaw", "wheel.fl.a_y", "chassis.yaw_rate"],
)
def test_other_axes_of_the_car_are_no_misspellings(name):
    assert parse(small("post.fl.z [m]", name)).columns == ["post.fl.z"]


def test_a_doubled_channel_is_refused():
    text = csv_of(small("chassis.z [m]", "b")).replace(",b", ",chassis.z [mm]")
    assert "columns 2 and 3 are both chassis.z; keep one" in refusal(text.encode())


@pytest.mark.parametrize("unit", ["blob", "V", "s"])
def test_an_unusable_unit_is_refused_with_a_usable_one(unit):
    message = refusal(small(f"chassis.z [{unit}]"))
    assert f"column 2, chassis.z: the unit '{unit}'" in message
    assert "write a unit of displacement such as chassis.z [mm]" in message


def test_columns_without_unit_are_read_as_si_with_a_warning():
    run = parse({"time": TIME, "chassis.z": 0.01 * WAVE})
    np.testing.assert_allclose(run["chassis.z"], 0.01 * WAVE)
    assert run.warnings == ("Columns without a unit were read as SI: time in s, chassis.z in m.",)


def test_a_file_without_header_is_refused():
    message = refusal(b"0,1.5,2\n0.1,1.6,2\n")
    assert "numbers where the column names belong; add a header" in message


@pytest.mark.parametrize("text", [b"0;1,5;2\n0,1;1,6;2\n", b"1\n2\n", b"0,1,\n0,1,\n"])
def test_a_file_without_header_is_refused_in_every_dialect(text):
    assert "add a header" in refusal(text)


def test_a_file_without_time_is_refused():
    message = refusal({"z [m]": TIME, "t": TIME})
    assert "no column is called time (the first line reads: z [m], t)" in message


def test_a_file_with_time_alone_is_refused():
    assert "no column besides time is a known channel" in refusal(small("temperature"))


def test_a_long_list_of_ignored_columns_is_cut_short():
    (warning,) = parse(small("chassis.z [m]", *(f"signal {i}" for i in range(50)))).warnings
    assert "signal 7 and 42 more" in warning


def test_an_endless_title_is_cut_short():
    assert len(refusal(small("x" * 50_000))) < 300


# --- rows -------------------------------------------------------------------------------------


def test_nan_is_refused_with_its_line_and_column():
    columns = small("chassis.z [m]")
    columns["chassis.z [m]"] = np.where(np.arange(SAMPLES) == 5, np.nan, WAVE)
    message = refusal(columns)
    assert message.startswith("run.csv: line 7, column chassis.z [m]: 'nan' is not finite;")


@pytest.mark.parametrize("cell", ["", "nan", "-"])
def test_a_file_with_a_gap_is_told_to_be_one_for_a_mapping(cell):
    """By a child, too, whose errors come as sentences; other text is no gap."""
    text = "time [s],chassis.z [mm]\n" + "".join(f"{k / 100},{k}\n" for k in range(20))
    with pytest.raises(UnmappedError, match="line 22, column chassis.z"):
        parse_run(f"{text}0.2,{cell}\n0.21,5\n".encode(), "run.csv", apart=cell == "nan")
    for other in ("inf", "x"):
        with pytest.raises(MeasurementError) as caught:
            parse_run(f"{text}0.2,{other}\n".encode(), "run.csv")
        assert not isinstance(caught.value, UnmappedError)
    mapping = ChannelMapping(
        (MappedColumn("time", "time", "s"), MappedColumn("chassis.z", "chassis.z", "mm"))
    )
    with opened_bytes(f"{text}0.2,{cell}\n0.21,21\n".encode(), "run.csv") as table:
        run = apply(mapping, table)
    np.testing.assert_allclose(run["chassis.z"], 0.1 * run.time, atol=1e-15)


@pytest.mark.parametrize("wrong", [0.04, 0.03, -1.0])
def test_time_that_does_not_increase_is_refused_with_its_line(wrong):
    columns = small("chassis.z [m]")
    columns["time [s]"] = np.where(np.arange(SAMPLES) == 5, wrong, TIME)
    message = refusal(columns)
    assert f"line 7: time {wrong:g} s does not come after 0.04 s" in message


def test_two_samples_are_too_few():
    message = refusal({title: values[:2] for title, values in small("chassis.z [m]").items()})
    assert "holds 2 samples, at least 10 are needed" in message


def test_a_file_too_large_is_refused_unread(monkeypatch):
    monkeypatch.setattr(csv_file, "LARGEST_FILE", 100)
    assert "run.csv: the file has 0 MB, more than 0 MB; cut" in refusal(small("chassis.z [m]"))


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(MeasurementError, match=r"nowhere\.csv: the file cannot be read .*path"):
        read_run(tmp_path / "nowhere.csv")
    for folder in (tmp_path, ".", "/"):
        with pytest.raises(MeasurementError, match="cannot be read"):
            read_run(folder)


# --- magnitudes -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("title", "peak", "warning"),
    [
        ("chassis.z [m]", 12.0, "chassis.z reaches 12 m; is it in mm?"),
        ("wheel.rr.z", 12.0, "wheel.rr.z reaches 12 m; is it in mm?"),
        ("wheel.rr.z [cm]", 120.0, "wheel.rr.z reaches 120 cm; is it in mm?"),
        ("chassis.z [mm]", 0.015, "chassis.z stays within 0.015 mm; is it in m?"),
        ("chassis.z [mm]", 900.0, "chassis.z reaches 900 mm; check its unit and rest value."),
        ("chassis.roll [rad]", 0.9, "chassis.roll reaches 0.9 rad; is it in deg?"),
        ("chassis.v_x [m/s]", 130.0, "chassis.v_x reaches 130 m/s; is it in km/h?"),
        ("chassis.a_x [g]", 3.0, "chassis.a_x reaches 3 g; is it in m/s^2?"),
    ],
)
def test_a_doubtful_magnitude_is_questioned(title, peak, warning):
    values = np.full(SAMPLES, -peak)
    assert warning in parse({"time [s]": TIME, title: values}).warnings


@pytest.mark.parametrize(
    ("run", "channel"),
    [("detailed/manoeuvre_1", "chassis.pitch"), ("twin/manoeuvre_2", "chassis.roll")],
)
def test_a_motion_that_peaks_beyond_its_unit_is_no_spike(run, channel):
    """Degrees under a header that says rad: the peaks alone are beyond what a car does."""
    recorded = read_run(Path(ridetune.sample_runs.__path__[0]) / f"{run}.csv")
    degrees = np.degrees(recorded[channel])
    columns = {"time [s]": recorded.time, f"{channel} [rad]": degrees}
    [warning] = parse(columns).warnings
    assert f"{channel} reaches" in warning
    assert "is it in deg?" in warning


def test_a_spike_is_named_with_its_place_and_not_taken_for_a_unit():
    time = np.linspace(0.0, 10.0, 2001)
    values = 0.01 * np.sin(time)
    values[640] = 5.0
    [warning] = parse({"time [s]": time, "chassis.z [m]": values}).warnings
    assert "chassis.z jumps to 5000 mm" in warning
    assert "in 1 of 2001 samples from 3.2 s on" in warning


@pytest.mark.parametrize(
    ("title", "peak"),
    [
        ("chassis.z [m]", 0.1),
        ("chassis.z [mm]", 2.5),
        ("chassis.z [m]", 0.0),
        ("chassis.pitch [deg]", 0.9),
        ("chassis.roll [deg]", 1e-9),
        ("chassis.a_x [g]", 0.9),
        ("chassis.v_x [km/h]", 250.0),
    ],
)
def test_a_plausible_magnitude_is_not_questioned(title, peak):
    assert parse({"time [s]": TIME, title: np.full(SAMPLES, peak)}).warnings == ()


def test_a_doubtful_time_is_questioned():
    run = parse({"time [s]": 1000 * TIME, "chassis.z [m]": 0.01 * WAVE})
    assert run.warnings == ("time advances by 10 s a sample; is it in ms?",)
    # 10,000 samples a second without a unit.
    run = parse({"time": 10 * TIME, "chassis.z [m]": 0.01 * WAVE})
    assert run.warnings[-1] == "time advances by 0.1 s a sample; is it in ms?"


# --- identification ---------------------------------------------------------------------------


def run_with(*names):
    return Run("run.csv", TIME, dict.fromkeys(names, WAVE))


@pytest.mark.parametrize("output", ["chassis.z", "chassis.pitch", "chassis.roll"])
def test_one_output_is_enough(output):
    assert missing_for_identification(run_with(output, *RECORDED[3:])) == ()


def test_what_an_identification_lacks_is_named():
    run = run_with("wheel.fl.z", "wheel.rl.z", "wheel.rr.z")
    assert missing_for_identification(run) == (
        "wheel.fr.z",
        "chassis.a_x",
        "chassis.z or chassis.pitch or chassis.roll",
    )


def test_damaged_files_never_end_in_anything_but_a_sentence():
    """A thousand seeded damages of a good file's header and rows."""
    rng, good = np.random.default_rng(7), csv_of(small(*(f"{name} [m]" for name in RECORDED)))
    good = good.replace("a_x [m]", "a_x [g]").replace("h [m]", "h [°]").replace("l [m]", "l [deg]")
    for _ in range(1000):
        data = bytearray(good.encode())
        for _ in range(rng.integers(1, 4)):
            place = int(rng.integers(250 if rng.random() < 0.7 else len(data)))
            data[place : place + int(rng.integers(2))] = bytes([int(rng.integers(256))])
        message = ""
        try:
            run = parse_run(bytes(data), "run.csv")
            assert all(math.isfinite(run[name].sum()) for name in run.columns)
        except MeasurementError as error:
            message = str(error)
        assert not message or (message.startswith("run.csv: ") and message.endswith((".", "?")))
