"""Text files as they come from test benches and spreadsheets.

Oracle: the numbers that were written; where a file is refused, the place in it that was spoilt.
"""

import io
import re

import numpy as np
import pytest
from ridetune.engine import csv_table
from ridetune.engine.csv_table import CsvTable, is_number, split_title
from ridetune.engine.errors import MeasurementError

NUMBERS = np.array([[0.0, -1.5, 3e-7], [0.01, 2.25, 4e5], [0.02, 0.0, -12.0]])
PLAIN = "time [s],chassis.z [mm],temp\n" + "".join(
    ",".join(map(repr, row)) + "\n" for row in NUMBERS.tolist()
)


def table_of(content):
    data = content.encode() if isinstance(content, str) else content
    return CsvTable(io.BytesIO(data), "run.csv")


def read(content):
    table = table_of(content)
    return table.numbers(range(len(table.header)))


def refusal(content):
    with pytest.raises(MeasurementError) as caught:
        read(content)
    return str(caught.value)


def test_a_plain_file_is_read_to_the_last_digit():
    table = table_of(PLAIN)
    assert table.header == ["time [s]", "chassis.z [mm]", "temp"]
    np.testing.assert_array_equal(table.numbers([0, 1, 2]), NUMBERS)


def test_columns_can_be_chosen_and_ordered():
    np.testing.assert_array_equal(table_of(PLAIN).numbers([2, 0]), NUMBERS[:, [2, 0]])


SEMICOLONS = PLAIN.replace(",", ";")
VARIANTS = {
    "byte order mark": PLAIN.encode("utf-8-sig"),
    "utf-16 little endian": PLAIN.encode("utf-16"),
    "utf-16 big endian": b"\xfe\xff" + PLAIN.encode("utf-16-be"),
    "utf-16 without mark": PLAIN.encode("utf-16-le"),
    "utf-16 big endian without mark": PLAIN.encode("utf-16-be"),
    "utf-32": PLAIN.encode("utf-32"),
    "windows line ends": PLAIN.replace("\n", "\r\n"),
    "old macintosh line ends": PLAIN.replace("\n", "\r"),
    "no last line end": PLAIN.rstrip("\n"),
    "blank lines": "\n\n" + PLAIN.replace("\n", "\n\n  \n"),
    "tabs": PLAIN.replace(",", "\t"),
    "semicolons": SEMICOLONS,
    "semicolons and decimal commas": SEMICOLONS.replace(".", ","),
    "tabs and decimal commas": PLAIN.replace(",", "\t").replace(".", ","),
    "excel's separator line": "sep=;\n" + SEMICOLONS,
    "excel's empty rows": PLAIN + ",,\n,,\n",
    "delimiters at line ends": PLAIN.replace("\n", ",\n"),
    "delimiters at the ends of rows only": PLAIN.replace("\n", ",\n").replace("temp,", "temp"),
    "spaces": PLAIN.replace(",", " , "),
    "quotes": "".join(
        ",".join(f'"{cell}"' for cell in line.split(",")) + "\n" for line in PLAIN.splitlines()
    ),
    "quotes and decimal commas": "".join(
        ";".join(f'"{cell}"' for cell in line.split(";")) + "\n"
        for line in SEMICOLONS.replace(".", ",").splitlines()
    ),
    "plus signs": PLAIN.replace(",2.25", ",+2.25"),
    "end-of-file sign of DOS": PLAIN + "\x1a",
}


@pytest.mark.parametrize("content", VARIANTS.values(), ids=VARIANTS.keys())
def test_the_usual_variants_hold_the_same_numbers(content):
    np.testing.assert_array_equal(read(content), NUMBERS)


def test_a_degree_sign_written_by_windows_is_understood():
    assert table_of("time [s],pitch [°]\n0,1\n".encode("cp1252")).header[1] == "pitch [°]"


def test_decimal_commas_between_quotes_are_told_from_thousands():
    """1,250 may be either; beside 0,5 it is a decimal, beside 1.5 or alone it is refused."""
    text = 't,z\n"0,000","1,250"\n"0,5","-1,5"\n'
    np.testing.assert_array_equal(read(text), [[0.0, 1.25], [0.5, -1.5]])
    for text in ('t,z\n1,"1,250"\n2,"3,500"\n', 't,z\n1.5,"1,250"\n2.5,"1,5"\n'):
        assert "line 2, column z: '1,250' is not a number" in refusal(text)
    assert "'1,234,567' is not a number" in refusal('t,z\n1,"1,234,567"\n2,"1,5"\n')


def test_a_typographic_minus_is_a_minus():
    np.testing.assert_array_equal(read("t;z\n0;\u22121,5\n1;2e\u22123\n"), [[0, -1.5], [1, 2e-3]])


def test_text_in_a_column_that_is_not_used_does_no_harm():
    content = PLAIN.replace("-12.0", '"wet, ""cold"""')
    np.testing.assert_array_equal(table_of(content).numbers([0, 1]), NUMBERS[:, :2])


def test_a_german_date_in_a_column_that_is_not_used_does_no_harm():
    content = "t;date;z\n0,5;12.05.2024;1,5\n"
    np.testing.assert_array_equal(table_of(content).numbers([0, 2]), [[0.5, 1.5]])


def test_a_row_knows_its_line():
    table = table_of("\n" + PLAIN.replace("\n", "\r\n\r\n"))
    assert [table.line_of(row) for row in range(3)] == [4, 6, 8]


@pytest.mark.parametrize(
    ("cell", "what"),
    [
        ("abc", "'abc' is not a number"),
        ("0x10", "'0x10' is not a number"),
        ("1_000", "'1_000' is not a number"),
        ("1.2.3", "'1.2.3' is not a number"),
        ("12:30:01", "'12:30:01' is not a number"),
        ("1 000", "'1 000' is not a number"),
        ("٣", "is not a number"),
        ("x" * 100, "xxx...' is not a number"),
        ("nan", "'nan' is not finite; repair it or remove the line"),
        ("-Inf", "'-Inf' is not finite"),
        ("1e999", "'1e999' is too large"),
        ("", "the cell is empty; fill it or remove the line"),
        ('"1,5"', "'1,5' is not a number; write numbers with a decimal point"),
    ],
)
def test_a_cell_that_is_no_number_is_named(cell, what):
    message = refusal(PLAIN.replace("2.25", cell))
    assert message.startswith("run.csv: line 3, column chassis.z [mm]: ")
    assert what in message


def test_a_bad_cell_after_many_lines_is_named_by_its_line():
    """numpy reads in chunks of 50 000 lines; the place must not depend on that."""
    good = "".join(f"{i},1,2\n" for i in range(120_001))
    for cell in ("bad", "nan"):
        content = "time,a,b\n\n" + good + f"1e6,{cell},1\n" + good
        assert refusal(content).startswith("run.csv: line 120004, column a: ")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "run.csv: the file is empty"),
        (" \n\n", "run.csv: the file is empty"),
        ("sep=;\n", "run.csv: the file is blank"),
        ("time,a\n", "run.csv: no samples stand below the header"),
        ("time,a\n\n,\n", "run.csv: no samples stand below the header"),
        ("Dear all,\nplease find, as agreed, the data\n", "run.csv: line 2 holds no number; give"),
        ("time,a\n1,2\n3\n", "run.csv: line 3 holds 1 cells where the header names 2 columns"),
        ("time,a\n1,2\n3,4,5\n", "run.csv: line 3 holds 3 cells where the header names 2"),
        ("t,a\n0,5,1,5\n", "with decimal commas, separate the columns by semicolons"),
        ("t;a\n0,5;1.234,5\n", "line 2, column a: '1.234,5' is not a number; the line mixes"),
        ('t,a\n1,"2\n', "line 2 has a quote that is not closed; close it or remove it"),
    ],
)
def test_a_spoilt_table_is_refused_with_place_and_remedy(content, message):
    assert message in refusal(content)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (bytes(range(256)) * 50, "this is a binary file, not text; export the recording as CSV"),
        (b"time,a\n1,2\n\x00\x01\x02", "binary"),
        (b"PK\x03\x04\x14\x00" + bytes(100), "workbook or a zip archive"),
        (b"MDF     4.10\x00\x00", "binary"),
    ],
)
def test_a_binary_file_is_not_taken_for_text(data, message):
    assert message in refusal(data)


def test_an_endless_line_is_refused_before_it_fills_the_memory():
    endless = "time,a\n" + "1," * csv_table.LONGEST_LINE
    assert "run.csv: line 2 is longer than 100000 characters" in refusal(endless)
    assert "run.csv: line 1 is longer than 100000 characters" in refusal(endless[7:])


def test_a_thousand_columns_are_enough():
    width = csv_table.MOST_COLUMNS
    row = ",".join(["1"] * width) + "\n"
    header = ",".join(f"c{i}" for i in range(width))
    assert read(header + "\n" + row).shape == (1, width)
    assert f"names {width + 1} columns, more than {width}" in refusal(header + ",x\n" + row)


def test_numbers_that_would_fill_the_memory_are_refused(monkeypatch):
    monkeypatch.setattr(csv_table, "MOST_NUMBERS", 6)
    assert read("a,b\n1,2\n3,4\n5,6\n").shape == (3, 2)
    assert "line 5: more than 3 samples of 2 columns" in refusal("a,b\n1,2\n3,4\n5,6\n7,8\n")


def test_damaged_bytes_never_end_in_anything_but_a_sentence():
    """A thousand seeded damages of good files: read, or refused with the file's name."""
    rng = np.random.default_rng(20240517)
    good = [value.encode() if isinstance(value, str) else value for value in VARIANTS.values()]
    for _ in range(1000):
        data = bytearray(good[rng.integers(len(good))])
        for _ in range(rng.integers(1, 6)):
            place = int(rng.integers(len(data)))
            match rng.integers(3):
                case 0:
                    data[place] = int(rng.integers(256))
                case 1:
                    del data[place : place + int(rng.integers(1, 20))]
                case _:
                    data[place:place] = bytes(data[: int(rng.integers(1, 40))])
            data = data or bytearray(b"\n")
        message = ""
        try:
            assert np.isfinite(read(bytes(data))).all()
        except MeasurementError as error:
            message = str(error)
        assert re.fullmatch(r"(run\.csv: .+\.)?", message)


@pytest.mark.parametrize(
    ("title", "parts"),
    [
        ("chassis.z [mm]", ("chassis.z", "mm")),
        ("chassis.z[mm]", ("chassis.z", "mm")),
        ("chassis.a_x ( m/s^2 )", ("chassis.a_x", "m/s^2")),
        ("time", ("time", "")),
        ("time []", ("time", "")),
        ("a [b] [c]", ("a [b] [c]", "")),
        ("x" * 201, ("x" * 201, "")),
    ],
)
def test_a_title_is_a_name_and_a_unit(title, parts):
    assert split_title(title) == parts


@pytest.mark.parametrize("text", ["1", "-1.5", "+.5e-3", "1,5", " 2. "])
def test_plain_decimal_numbers_are_numbers(text):
    assert is_number(text)


@pytest.mark.parametrize("text", ["", "nan", "0x1", "1e", "time", "1.2.3", "."])
def test_other_texts_are_no_numbers(text):
    assert not is_number(text)


PAIR = ["time [s]", "chassis.z [mm]"]
LAYOUTS = {
    "a row of units": ("time;chassis.z\ns;mm\n0,0;1,5\n0,1;2,5\n", PAIR),
    "units in brackets": ("time,chassis.z\n[s],[mm]\n0,1.5\n0.1,2.5\n", PAIR),
    "units twice": ("time [s],chassis.z\ns,mm\n0,1.5\n0.1,2.5\n", PAIR),
    "a unit of several words": (
        "time,v\ns,km/h\n0,1.5\n0.1,2.5\n",
        ["time [s]", "v [km/h]"],
    ),
    "lines above": (
        "Project X\nDate: 1.2.2020, driver: Y\n\ntime [s]\tchassis.z [mm]\n0\t1.5\n0.1\t2.5\n",
        PAIR,
    ),
    "lines above and units": (
        "Title;\nAuthor;Max\nZeit;Weg\ns;mm\n0;1,5\n0,1;2,5\n",
        ["Zeit [s]", "Weg [mm]"],
    ),
    "a line above and a remark in the first row": (
        "Project X\nZeit;Weg;Bemerkung\ns;mm\n0;1,5;Start\n0,1;2,5;\n",
        ["Zeit [s]", "Weg [mm]", "Bemerkung"],
    ),
    "a line above and dates": (
        "Project X; driver Y; car Z\nZeit;Weg;Datum\ns;mm;\n0;1,5;04.05.2026\n0,1;2,5;04.05.2026\n",
        ["Zeit [s]", "Weg [mm]", "Datum"],
    ),
    "spaces": ("# time   chassis.z\n 0.0   1.5\n 0.1   2.5\n", ["time", "chassis.z"]),
    "spaces and units": ("log 7\ntime [s]  chassis.z [mm]\n0  1.5\n0.1  2.5\n", PAIR),
    "bars": ("time [s]|chassis.z [mm]\n0|1.5\n0.1|2.5\n", PAIR),
    "latin-1": (
        "Zeit [s];D\u00e4mpfer\n0;1,5\n0,1;2,5\n".encode("latin-1"),
        ["Zeit [s]", "D\u00e4mpfer"],
    ),
}


@pytest.mark.parametrize("name", LAYOUTS)
def test_headers_of_other_programs_are_found(name):
    content, header = LAYOUTS[name]
    table = table_of(content)
    assert table.header == header
    assert table.count() == 2
    np.testing.assert_array_equal(table.numbers([0, 1]), [[0.0, 1.5], [0.1, 2.5]])


def test_a_spoilt_first_row_is_no_header():
    """A file of ours stays one: its first line names the time."""
    for row, column in (("0,abc", "chassis.z"), ("foo,bar", "time")):
        said = refusal(f"time [s],chassis.z [mm]\n{row}\n0.1,2\n0.2,3\n")
        assert f"line 2, column {column}" in said


def test_a_first_row_of_dashes_is_a_sample():
    """A logger's dash for nothing measured; a row of units has one unit at least."""
    table = table_of("t,a,b\n1,-,-\n2,3,4\n")
    assert table.header == ["t", "a", "b"]
    numbers, bad = table.with_gaps([0, 1, 2])
    np.testing.assert_array_equal(numbers, [[1.0, np.nan, np.nan], [2.0, 3.0, 4.0]])
    assert not bad
    assert table_of("t,a,b\n-,-,-\n2,3,4\n").count() == 1
    assert table_of("t,a,b\ns,-,1\n2,3,4\n").header == ["t [s]", "a", "b [1]"]


def test_empty_cells_are_gaps_and_other_text_spoils_its_column_alone():
    """Three columns in one pass: whole, with gaps, with a word."""
    text = "a,b,c\n1,2,3\n2,,x\n3,NaN,1_0\n4,5,6\n"
    numbers, bad = table_of(text).with_gaps([0, 1, 2])
    np.testing.assert_array_equal(numbers[:, 0], [1.0, 2.0, 3.0, 4.0])
    np.testing.assert_array_equal(numbers[:, 1], [2.0, np.nan, np.nan, 5.0])
    assert list(bad) == [2]
    assert "line 3, column c: 'x' is not a number" in str(bad[2])


def test_dates_and_remarks_spoil_their_own_column_alone():
    """Of a German file: numbers with commas, a date, a quoted remark, a number with both signs."""
    text = 't;Datum;z;Text;F\n0,5;12.03.2024;1,5;"los; ab";1,5\n1,0;12.03.2024;2,5;a, b;1.234,5\n'
    numbers, bad = table_of(text).with_gaps(range(5))
    np.testing.assert_array_equal(numbers[:, [0, 2]], [[0.5, 1.5], [1.0, 2.5]])
    assert {column: str(error)[9:].split(" is not")[0] for column, error in bad.items()} == {
        1: "line 2, column Datum: '12.03.2024'",
        3: "line 2, column Text: 'los; ab'",
        4: "line 3, column F: '1.234,5'",
    }
    np.testing.assert_array_equal(table_of("t;a\n0.5;los, ab\n").numbers([0]), [[0.5]])


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("23:59:59,75", "0:00:00,25"),
        ("12:00:00", "12:00:00.5"),
        ("2024-02-29T23:59:59.750Z", "2024-03-01T00:00:00.250Z"),
        ("31.12.2023 23:59:59,75", "01.01.2024 00:00:00,25"),
    ],
)
def test_times_of_day_count_from_the_first(first, second):
    """Half a second later, over midnight, too; beside decimal commas and points."""
    for number in ("1,5", "1.5"):
        table = table_of(f"Messung 7\nUhrzeit;z\n{first};{number}\n{second};{number}\n")
        assert (table.header, table.clocks) == (["Uhrzeit", "z"], {0})
        np.testing.assert_array_equal(table.numbers([0, 1]), [[0.0, 1.5], [0.5, 1.5]])
    with pytest.raises(MeasurementError, match="line 3, column Uhrzeit: '24. May' is not a number"):
        table_of(f"Uhrzeit;z\n{first};1\n24. May;2\n").numbers([0])


def test_a_number_with_underscores_is_no_number():
    _, bad = table_of("a,b\n1,2\n2,1_0\n").with_gaps([0, 1])
    assert "line 3, column b: '1_0' is not a number" in str(bad[1])
