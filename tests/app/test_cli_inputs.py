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
