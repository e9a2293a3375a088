"""A table and a mapping become a run. Oracle: straight lines, which interpolation follows."""

import io
import json

import numpy as np
import pytest
from ridetune.engine.errors import MeasurementError
from ridetune.engine.formats.csv_file import CsvFile
from ridetune.engine.formats.table import Column, HeldTable
from ridetune.engine.mapping.apply import apply
from ridetune.engine.mapping.mapping import (
    ChannelMapping,
    MappedColumn,
    Places,
    mapping_from_json,
    mapping_to_json,
    read_mapping,
)
from ridetune.engine.mapping.survey import survey

from .mapped_tables import guessed, held, renamed, truth

SAMPLE = np.arange(500)
TIME = 0.01 * SAMPLE
HEIGHT = MappedColumn("height", "chassis.z", "mm")
SPEED = MappedColumn("speed", "chassis.v_x", "km/h")
CLOCK = MappedColumn("Time", "time", "s")


def wave(time=TIME):
    return 20.0 * np.sin(time)


def table_of(*columns):
    """A table of (name, start, step, numbers), each with a clock of its own."""
    return HeldTable(
        "lap",
        "test",
        tuple(Column(name, "", len(n), start=start, step=step) for name, start, step, n in columns),
        [numbers for *_, numbers in columns],
    )


def refusal(mapping, table) -> str:
    with pytest.raises(MeasurementError) as caught:
        apply(mapping, table)
    return str(caught.value)


def test_unit_sign_and_gain_make_si():
    """A gain of 1.02 counts before the unit."""
    table = held({"Time": ("s", TIME), "height": ("inch", wave())})
    entry = MappedColumn("height", "chassis.z", "mm", sign=-1, gain=1.02)
    run = apply(ChannelMapping((CLOCK, entry)), table)
    np.testing.assert_allclose(run["chassis.z"], -1.02e-3 * wave(), rtol=1e-12)
    np.testing.assert_array_equal(run.time, TIME)
    assert (run.name, run.warnings) == ("lap", ())


def test_what_a_native_file_is_doubted_for_is_doubted_here():
    table = held({"Time": ("s", 100.0 * TIME), "height": ("mm", wave())})
    run = apply(ChannelMapping((CLOCK, MappedColumn("height", "chassis.z", "m"))), table)
    assert "time advances by 1 s a sample; is it in ms?" in run.warnings
    assert "chassis.z reaches 20 m; is it in mm?" in run.warnings
    noisy = apply(ChannelMapping((CLOCK, HEIGHT)), table, noise={"chassis.z": 0.5})
    assert noisy.noise == {"chassis.z": 0.5}
    assert "is this one in mm?" in noisy.warnings[-1]


@pytest.mark.parametrize(
    ("time", "said"),
    [
        (
            np.where(SAMPLE == 7, TIME[6], TIME),
            "lap: the time of height: sample 8: time 0.06 s does not come after",
        ),
        (np.full_like(TIME, np.nan), "lap: the time of height has fewer than two numbers"),
    ],
)
def test_time_that_does_not_run_is_refused(time, said):
    table = held({"Time": ("s", time), "height": ("mm", wave())})
    assert said in refusal(ChannelMapping((CLOCK, HEIGHT)), table)


def test_too_few_samples_are_refused():
    table = held({"Time": ("s", TIME[:5]), "height": ("mm", wave()[:5])})
    assert "holds 5 samples, at least 10" in refusal(ChannelMapping((CLOCK, HEIGHT)), table)


# --- columns ----------------------------------------------------------------------------------


def test_a_column_that_the_file_lacks_is_named():
    table = held({"Time": ("s", TIME), "height": ("mm", wave())})
    said = refusal(ChannelMapping((CLOCK, HEIGHT, SPEED)), table)
    assert said == (
        "lap: the file has no column called 'speed', which the mapping takes for chassis.v_x;"
        " map another one."
    )


def test_columns_of_one_name_are_told_apart_by_their_group():
    """In another group the name alone counts, as long as it is the only one."""
    described = tuple(Column("z", "mm", TIME.size, group, step=0.01) for group in ("A", "B"))
    table = HeldTable("lap", "test", described, [wave(), 2.0 * wave()])

    def mapped(group):
        return ChannelMapping((MappedColumn("z", "chassis.z", "mm", group),))

    np.testing.assert_allclose(apply(mapped("B"), table)["chassis.z"], 2e-3 * wave())
    assert "has 2 columns called 'z'" in refusal(mapped(""), table)
    assert "in the group 'C'" in refusal(mapped("C"), table)
    alone = HeldTable("lap", "test", described[:1], [wave()])
    np.testing.assert_allclose(apply(mapped("C"), alone)["chassis.z"], 1e-3 * wave())


def test_a_german_log_with_times_of_day_is_mapped_as_it_is():
    rows = "".join(f"12:00:{k / 100:05.2f};{k},5;los\n".replace(".", ",") for k in range(300))
    table = CsvFile(io.BytesIO(f"Uhrzeit;Aufbau z [mm];Text\n{rows}".encode()), "lap.csv")
    found = survey(table)
    [said] = found.doubts
    assert said.startswith("line 2, column Text: 'los' is not a number")
    run = apply(found.guess.mapping, table)
    np.testing.assert_allclose(run.time, 0.01 * np.arange(300), atol=1e-9)
    np.testing.assert_allclose(run["chassis.z"], 1e-3 * (np.arange(300) + 0.5))


def test_a_file_without_a_time_takes_the_step_of_its_mapping():
    table = held({"height": ("mm", wave())})
    assert 'write as "step" of the mapping' in refusal(ChannelMapping((HEIGHT,)), table)
    run = apply(ChannelMapping((HEIGHT,), step=0.01), table)
    np.testing.assert_allclose(run.time, TIME)
    np.testing.assert_allclose(run["chassis.z"], 1e-3 * wave())
    assert run.warnings == (
        "The file tells no time; its samples were taken every 0.01 s, as the mapping says.",
    )


def test_one_column_is_never_two_channels():
    """Two groups of the file that was mapped, one column without a group in this one."""
    body = MappedColumn("acc_z", "chassis.a_z", "g", "IMU")
    mapping = ChannelMapping((body, MappedColumn("acc_z", "seat.driver.a_z", "g", "Seat")))
    table = table_of(("acc_z", 0.0, 0.01, wave()))
    assert not mapping.fits(Places(table.columns))
    assert "takes for chassis.a_z (group 'IMU') and for seat.driver.a_z" in refusal(mapping, table)


def test_time_alone_is_no_recording():
    table = held({"Time": ("s", TIME), "height": ("mm", wave())})
    assert "names no channel besides time" in refusal(ChannelMapping((CLOCK,)), table)


# --- clocks -----------------------------------------------------------------------------------


def test_the_unit_of_the_mapped_time_counts():
    table = held({"Time": ("s", 1000.0 * TIME), "height": ("mm", wave())})
    run = apply(ChannelMapping((MappedColumn("Time", "time", "ms"), HEIGHT)), table)
    np.testing.assert_allclose(run.time, TIME, atol=1e-12)


def test_a_column_s_own_clock_in_its_own_unit_is_enough():
    columns = (Column("master", "ms", TIME.size), Column("height", "mm", TIME.size, clock=0))
    table = HeldTable("lap", "test", columns, [1000.0 * TIME, wave()])
    np.testing.assert_allclose(apply(ChannelMapping((HEIGHT,)), table).time, TIME, atol=1e-12)


def test_without_any_time_the_column_is_refused():
    table = HeldTable("lap", "test", (Column("height", "mm", TIME.size),), [wave()])
    said = refusal(ChannelMapping((HEIGHT,)), table)
    assert "tells no time for height; map the column that holds it as time" in said
    columns = (Column("Time", "s", 20, "A"), Column("height", "mm", TIME.size, "B"))
    table = HeldTable("lap", "test", columns, [TIME[:20], wave()])
    said = refusal(ChannelMapping((CLOCK, HEIGHT)), table)
    assert "Time, which is mapped as time, has 20 samples and this one 500" in said


def test_other_clocks_are_interpolated_to_the_finest_over_what_all_share():
    """Straight lines come out exactly, on the times of the finer column."""
    fine, coarse = 0.005 * np.arange(1000), 1.0 + 0.1 * np.arange(60)
    table = table_of(("height", 0.0, 0.005, 3.0 * fine), ("speed", 1.0, 0.1, 7.0 * coarse))
    run = apply(ChannelMapping((HEIGHT, SPEED)), table)
    np.testing.assert_allclose(run.time, fine[200:], atol=1e-12)
    np.testing.assert_allclose(run["chassis.z"], 3e-3 * run.time, rtol=1e-12)
    np.testing.assert_allclose(run["chassis.v_x"], 7.0 / 3.6 * run.time, rtol=1e-12)
    shared, interpolated = run.warnings
    assert shared.startswith("Only the time from 1 to 4.995 s has all the columns")
    assert interpolated == "Interpolated to the times of height: speed (every 0.1 s)."


def test_a_stated_step_is_taken_and_what_folds_is_said():
    table = table_of(("height", 0.0, 0.005, 3.0 * 0.005 * np.arange(1000)))
    run = apply(ChannelMapping((HEIGHT,), step=0.02), table)
    np.testing.assert_allclose(run.time, 0.02 * np.arange(250), atol=1e-12)
    np.testing.assert_allclose(run["chassis.z"], 3e-3 * run.time, rtol=1e-12)
    assert "Interpolated to equal steps of 0.02 s" in run.warnings[0]
    assert "what moves faster than 25 Hz appears at lower frequencies" in run.warnings[1]


def test_disjoint_times_are_refused():
    table = table_of(("height", 0.0, 0.01, wave()), ("speed", 9.0, 0.01, wave()))
    said = refusal(ChannelMapping((HEIGHT, SPEED)), table)
    assert "height ends at 4.99 s and speed begins at 9 s" in said


def test_absurdly_many_steps_are_refused():
    table = table_of(("height", 0.0, 10.0, 3.0 * np.arange(1000)))
    said = refusal(ChannelMapping((HEIGHT,), step=1e-5, longest_gap=0.0), table)
    assert "are too many; take longer ones" in said


# --- gaps and stand-ins -----------------------------------------------------------------------


def dropped(length, value):
    """A straight line with `length` samples lost from 2 s on."""
    line = 3.0 * TIME
    return np.where(np.isin(SAMPLE, 200 + np.arange(length)), value, line)


def with_height(numbers, **entry):
    table = held({"Time": ("s", TIME), "height": ("mm", numbers)})
    return ChannelMapping((CLOCK, MappedColumn("height", "chassis.z", "mm", **entry))), table


@pytest.mark.parametrize("value", [np.nan, np.inf, -64.0, 1e30, 65535.0])
def test_a_short_gap_is_bridged_with_a_warning(value):
    missing = (value,) if np.isfinite(value) else None
    run = apply(*with_height(dropped(9, value), missing=missing))
    np.testing.assert_allclose(run["chassis.z"], 3e-3 * run.time, rtol=1e-12)
    [warning] = run.warnings
    assert "height, mapped as chassis.z, has no number in 9 samples" in warning
    assert "up to 0.1 s" in warning
    assert run.time.size == TIME.size


def test_a_long_gap_is_refused_with_its_place():
    mapping, table = with_height(dropped(10, np.nan))
    said = refusal(mapping, table)
    assert "has no number between 1.99 and 2.1 s, longer than the 0.1 s that are bridged" in said
    longer = ChannelMapping(mapping.columns, longest_gap=0.2)
    np.testing.assert_allclose(apply(longer, table)["chassis.z"], 3e-3 * TIME, rtol=1e-12)


def test_what_is_missing_at_the_ends_is_left_out():
    numbers = np.where((TIME < 1.0) | (TIME > 4.0), np.nan, wave())
    run = apply(*with_height(numbers))
    assert (run.time[0], run.time[-1]) == pytest.approx((1.0, 4.0))


@pytest.mark.parametrize("value", [-64.0, 1e30, 65535.0, -999.0, 12345.6])
def test_numbers_that_stand_for_nothing_are_refused_until_they_are_named(value):
    mapping, table = with_height(dropped(9, value))
    said = refusal(mapping, table)
    assert f"is {value:g} in 9 samples, far outside the rest" in said
    assert f"give {value:g} as missing, else say that no number is missing" in said
    kept = apply(*with_height(dropped(9, -64.0), missing=()))
    assert kept["chassis.z"].min() == pytest.approx(-0.064)


@pytest.mark.parametrize(
    "numbers",
    [
        np.where(TIME < 2.0, 0.0, 80.0),
        np.maximum(0.0, 3.0 * (TIME - 2.0)),
        wave(),
        np.round(wave()),
        np.clip(wave(), -15.0, 15.0),
        np.where(np.arange(TIME.size) == 200, 300.0, wave()),
    ],
    ids=["switch", "standstill", "wave", "quantized", "clipped", "one spike"],
)
def test_what_a_sensor_measures_is_not_taken_for_a_stand_in(numbers):
    run = apply(*with_height(numbers))
    np.testing.assert_allclose(run["chassis.z"], 1e-3 * numbers, rtol=1e-12)


def test_a_channel_that_never_changes_is_named():
    run = apply(*with_height(np.full_like(TIME, 3.0)))
    assert "height, mapped as chassis.z, never changes." in run.warnings


def test_samples_without_a_time_are_left_out():
    time = np.where(TIME > 4.0, np.nan, TIME)
    run = apply(
        ChannelMapping((CLOCK, HEIGHT)), held({"Time": ("s", time), "height": ("", wave())})
    )
    assert run.time[-1] == pytest.approx(4.0)
    assert "The time of height has no number in 99 of 500 samples" in run.warnings[0]


# --- templates --------------------------------------------------------------------------------


def test_a_mapping_comes_back_from_its_file(tmp_path):
    entry = MappedColumn(
        "h", "chassis.z", "mm", "IMU", -1, 1.5, (-64.0, 1e30), "name and unit", True
    )
    mapping = ChannelMapping((CLOCK, entry), 0.05, 0.002)
    path = tmp_path / "mapping.json"
    path.write_text(json.dumps(mapping_to_json(mapping)))
    assert read_mapping(path) == mapping


def test_a_template_made_of_one_file_reads_the_next():
    """Another order of columns, others between them."""
    names = {
        "time": ("Zeit", "s", "s"),
        "chassis.z": ("Aufbauhub", "mm", "mm"),
        "chassis.a_x": ("Laengsbeschl", "g", "g"),
    }
    template = guessed(renamed(truth(), names)).mapping
    later = renamed(truth(), dict(reversed(names.items())))
    assert template.fits(Places(later.columns))
    run = apply(mapping_from_json(mapping_to_json(template)), later)
    np.testing.assert_allclose(run["chassis.a_x"], truth()["chassis.a_x"], rtol=1e-12, atol=1e-15)
    assert not template.fits(Places(later.columns[:2]))


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"columns": [{"column": "a", "channel": "chassis.zz", "unit": "m"}]}, "chassis.z"),
        (
            {"columns": [{"column": "a", "channel": "chassis.z", "unit": "s"}]},
            "m.json: columns[0]: chassis.z: the unit 's' does not measure the same quantity",
        ),
        (
            {"columns": [{"column": "a", "channel": "chassis.z", "unit": "m", "sign": 2}]},
            "m.json: columns[0]: chassis.z: the sign is 2; give 1 or -1.",
        ),
        (
            {"columns": [{"column": c, "channel": "chassis.z", "unit": "m"} for c in "ab"]},
            "m.json: columns a and b are both chassis.z; keep one of them.",
        ),
        (
            {
                "columns": [
                    {"column": "a", "channel": one, "unit": "m"}
                    for one in ("chassis.z", "chassis.x")
                ]
            },
            "m.json: column a is both chassis.z and chassis.x; keep one of them.",
        ),
        (
            {
                "columns": [
                    {"column": "a", "channel": "chassis.z", "unit": "m", "missing": [-64.1e308]}
                ]
            },
            "m.json: columns[0].missing[0] is -inf, but must be finite; correct it.",
        ),
        ({"columns": [], "longest_gap": -1}, "m.json: longest_gap is -1, but must lie between"),
        (
            {"columns": [{"column": "a", "channel": "chassis.z", "unit": "m"}] * 1001},
            "m.json: columns are more than 1000; map those that are used.",
        ),
        ({"columns": [], "step": 100}, "m.json: step is 100, but must lie between"),
        ({"colums": []}, 'm.json: colums is not known; did you mean "columns"?'),
        ([], "m.json: must be an object"),
    ],
)
def test_a_mapping_that_makes_no_sense_is_refused(wrong, said):
    with pytest.raises(MeasurementError) as caught:
        mapping_from_json(wrong, "m.json")
    assert said in str(caught.value)
