"""The nodes of the car: where they stand at rest, and that every reference car can be shown."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.app.viewer import scene, shapes
from ridetune.engine.frames import AXLES, CORNERS, side_of
from ridetune.engine.vehicle_file import reference_vehicles


class Recorder:
    """Takes the nodes that a viser scene would be given."""

    def __init__(self):
        self.nodes = {}

    def __getattr__(self, kind):
        def add(name, *data, **options):
            self.nodes[name] = (kind, data, options)

        return add


@pytest.fixture(params=sorted(reference_vehicles()))
def vehicle(request):
    return reference_vehicles()[request.param]


@pytest.fixture
def nodes(vehicle):
    recorder = Recorder()
    scene.build(SimpleNamespace(scene=recorder), vehicle)
    return recorder.nodes


def ends(nodes, name, axis):
    """Where a part of unit length along an axis begins and ends."""
    _, _, options = nodes[name]
    w, x, y, z = options["wxyz"]
    assert (x, z) == (0.0, 0.0)
    turn = 2 * np.arctan2(y, w)
    rotation = np.array(
        [(np.cos(turn), 0, np.sin(turn)), (0, 1, 0), (-np.sin(turn), 0, np.cos(turn))]
    )
    start = np.asarray(options["position"])
    return start, start + rotation @ (np.asarray(axis) * options["scale"])


@pytest.mark.parametrize("corner", CORNERS)
def test_wheels_stand_on_the_ground(nodes, vehicle, corner):
    _, (vertices, _), options = nodes[f"/car/wheel_{corner}"]
    lowest = vertices[:, 2].min() + options["position"][2]
    assert lowest == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("corner", CORNERS)
def test_arms_reach_from_the_wheel_centre_to_the_pivot(nodes, vehicle, corner):
    """docs/model.md: the pivot lies d from the contact point and d tan(phi) above the ground."""
    hub, hinge = ends(nodes, f"/car/arm_{corner}", (1, 0, 0))
    axle = vehicle.axle_at(corner)
    assert hub[2] == pytest.approx(axle.wheel.radius)
    assert abs(hinge[0] - hub[0]) == pytest.approx(abs(axle.pivot.distance))
    assert hinge[2] == pytest.approx(axle.pivot.distance * np.tan(axle.pivot.angle))
    towards_the_middle = np.sign(hinge[0] - hub[0]) == -np.sign(hub[0])
    assert towards_the_middle == (axle.pivot.distance > 0)


@pytest.mark.parametrize("corner", CORNERS)
def test_springs_stand_upright_under_their_mounts(nodes, vehicle, corner):
    hub, mount = ends(nodes, f"/car/spring_{corner}", (0, 0, 1))
    assert_allclose(mount - hub, (0, 0, vehicle.axle_at(corner).suspension.mount_height))
    assert np.sign(hub[1]) == side_of(corner)


@pytest.mark.parametrize("axle", AXLES)
def test_stabilizer_bars_join_the_two_arms(nodes, axle):
    right, left = ends(nodes, f"/car/bar_{axle}", (0, 1, 0))
    assert_allclose(left, right * (1, -1, 1))
    assert left[1] > 0


def test_ghosts_grips_and_rays_are_hidden_until_the_page_shows_them(nodes):
    hidden = {name for name, (_, _, options) in nodes.items() if options.get("visible") is False}
    prefixes = ("/ghost/", "/car/body/grip_", "/car/ray_")
    assert hidden == {name for name in nodes if name.startswith(prefixes)}


@pytest.mark.parametrize(("axle", "corner"), [("front", "fr"), ("rear", "rr")])
def test_grips_sit_at_the_pivots(nodes, vehicle, axle, corner):
    """The grip is a child of the body, whose origin is the CG."""
    _, _, options = nodes[f"/car/body/grip_{axle}"]
    _, hinge = ends(nodes, f"/car/arm_{corner}", (1, 0, 0))
    assert_allclose(options["position"] + np.array([0, 0, vehicle.chassis.cg_height]), hinge)


@pytest.mark.parametrize(
    "mesh",
    [
        shapes.box((1.0, 2.0, 3.0)),
        shapes.tube((0, 0, 0), (1, 0, 0), 0.1),
        shapes.tyre(0.3, 0.2),
        shapes.rim(0.3, 0.2),
        shapes.ball(0.1),
        shapes.faceted(shapes.box((1.0, 2.0, 3.0))),
        shapes.coil((0, 0, 0), (0, 0, 1), 0.1, 0.01),
    ],
)
def test_meshes_refer_to_their_own_vertices_and_all_of_them(mesh):
    vertices, faces = mesh
    assert np.isfinite(vertices).all()
    assert set(np.unique(faces)) == set(range(len(vertices)))


def test_straightening_keeps_the_line_within_its_tolerance():
    """Every point of the original stays within 1 mm of the straightened line."""
    x = np.linspace(0, 3, 200)
    line = np.column_stack([x, np.zeros_like(x), np.where(x < 1, 0, np.sin(x - 1) ** 2)])
    kept = shapes.straightened(line)
    assert len(kept) < 60
    assert_allclose(np.interp(x, kept[:, 0], kept[:, 2]), line[:, 2], atol=1.5e-3)
    assert_allclose(shapes.straightened(line[:60]), line[[0, 59]])


def test_a_box_has_its_volume():
    """Oracle: the divergence theorem over its triangles."""
    vertices, faces = shapes.box((1.0, 2.0, 3.0))
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    volume = np.abs(np.einsum("ij,ij->i", a, np.cross(b, c)).sum()) / 6
    assert volume == pytest.approx(6.0)


def test_the_body_clears_its_wheels():
    """No section near an axle comes lower than the wheel's circle."""
    wheelbase, radius = 2.6, 0.3
    for section in shapes.body_sections(wheelbase, 1.7, radius):
        back, sill = -section[0, 0], section[0, 2]
        for axle in (0.0, wheelbase):
            if abs(back - axle) < radius:
                assert sill >= radius + np.sqrt(radius**2 - (back - axle) ** 2)
