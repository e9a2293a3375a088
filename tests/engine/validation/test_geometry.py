import pytest
from ridetune.engine.errors import VehicleError
from ridetune.engine.validation.geometry import Geometry, geometry_from_json
from ridetune.engine.vehicle import Pivot


def test_geometry_is_read_strictly():
    read = geometry_from_json({"rear": {"distance": 1.1, "angle": 0.17}})
    assert read == Geometry(rear=Pivot(1.1, 0.17))
    assert read.values() == {"rear.pivot.distance": 1.1, "rear.pivot.angle": 0.17}
    for data, sentence in (
        ([], "must be an object"),
        ({}, "holds no pivot"),
        ({"frunt": {"distance": 1, "angle": 0}}, 'did you mean "front"'),
        ({"front": {"distance": 1, "angel": 0}}, 'did you mean "angle"'),
        ({"front": {"distance": 1}}, "front.angle is missing"),
        ({"front": {"distance": 0, "angle": 0}}, "front.distance is 0"),
    ):
        with pytest.raises(VehicleError, match=sentence):
            geometry_from_json(data)
