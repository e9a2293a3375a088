"""What arguments name, found or refused with where it belongs."""

import pytest
from ridetune.app.commands.inputs import find_manoeuvre, find_vehicle
from ridetune.engine.errors import RideError


@pytest.mark.parametrize(
    ("find", "name", "said"),
    [
        (find_vehicle, "car.toml", "a vehicle is a JSON file; notes in TOML lie beside"),
        (find_manoeuvre, "run.CSV", "a manoeuvre is a JSON file; CSV recordings go with --rims"),
    ],
)
def test_a_file_of_another_kind_is_told_where_it_goes(tmp_path, find, name, said):
    (tmp_path / name).write_text("time [s]\n0\n")
    with pytest.raises(RideError, match=said):
        find(str(tmp_path / name))


def test_a_name_that_is_no_slip_in_writing_lists_what_there_is():
    """Oracle: "fast" shares three letters with "coast", and is no manoeuvre."""
    with pytest.raises(RideError, match="nor a manoeuvre of that name; known are .*coast"):
        find_manoeuvre("fast")
    with pytest.raises(RideError, match="did you mean coast?"):
        find_manoeuvre("cosat")
