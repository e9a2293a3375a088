import pytest
from ridetune.engine.errors import RideError, VehicleError
from ridetune.engine.json_text import LARGEST_FILE, parse_json, read_json


def test_good_json_is_returned_as_it_stands():
    text = '\ufeff{"a": [1, 2.5, "é", null], "b": {"c": "\\ud83d\\ude00"}}'.encode()
    expected = {"a": [1, 2.5, "é", None], "b": {"c": "\U0001f600"}}
    assert parse_json(text, "f.json", RideError) == expected


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"", "f.json: line 1, column 1: not valid JSON"),
        (b'{"a": 1,\n "b": }', "f.json: line 2, column 7: not valid JSON"),
        (b"\xff\xfe{\x00}\x00", "f.json: not UTF-8 text"),
        (b"[" * 100_000, "f.json: nested too deeply"),
        (b"[" * 100_000 + b"]" * 100_000, "f.json: nested too deeply"),
        (b"1" * 5000, "endless number"),
        (b'{"a": 1, "a": 2}', "f.json: a is given twice; keep one"),
        (b'{"a": [{}, {"b": 1, "c": 2, "b": 3}]}', "f.json: a[1].b is given twice"),
        (rb'{"name": "\ud83d\ud83d\ude00"}', "f.json: it holds half a character"),
        (b" " * (LARGEST_FILE + 1), "f.json: larger than 5 MB"),
    ],
)
def test_bad_json_is_refused_with_its_place(text, message):
    with pytest.raises(VehicleError) as caught:
        parse_json(text, "f.json", VehicleError)
    assert message in str(caught.value)


def test_a_folder_is_no_file(tmp_path):
    with pytest.raises(VehicleError, match="cannot be read"):
        read_json(tmp_path, VehicleError)
