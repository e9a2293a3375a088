"""The averaged road and what four wheels find of it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.detailed.builder import Model
from ridetune.engine.detailed.car_file import reference_car
from ridetune.engine.detailed.driving import drive
from ridetune.engine.detailed.equilibrium import coordinates, settle, static_settings
from ridetune.engine.detailed.ground import Ground, patch_road
from ridetune.engine.frames import CORNERS
from ridetune.engine.manoeuvre import Manoeuvre
from ridetune.engine.roads.road import LEFT, RIGHT, Road
from ridetune.engine.roads.road_specs import PotholeRoad

PATCH = 0.12


@pytest.mark.parametrize("wavelength", [0.2, 0.5, 3.0])
def test_averaging_takes_a_sine_down_by_the_sinc_of_the_patch(wavelength):
    """Oracle: mean of sin(2 pi x/L) over l is sin(pi l/L) / (pi l/L) of it.

    Both roads are splines, off by up to 5/384 (2 pi h/L)^4 on their grids of h = 10 mm.
    """
    x = 0.01 * np.arange(2001)
    road = Road(0.0, 0.01, np.sin(2 * np.pi * x / wavelength), np.zeros(x.size))
    averaged = patch_road(road, PATCH)
    inside = np.linspace(8.0, 12.0, 997)
    expected = np.sinc(PATCH / wavelength) * np.sin(2 * np.pi * inside / wavelength)
    off = 2.0 * 5.0 / 384.0 * (2 * np.pi * 0.01 / wavelength) ** 4
    assert_allclose(averaged.height(LEFT, inside), expected, rtol=0, atol=off + 1e-12)
    assert_allclose(averaged.height(RIGHT, inside), 0.0, atol=1e-15)


def test_a_level_road_keeps_its_height():
    road = Road(0.0, 0.1, np.full(50, 0.001), np.full(50, 0.001))
    averaged = patch_road(road, PATCH)
    for x in (-5.0, 0.0, 2.0, 4.9, 20.0):
        assert averaged.height(LEFT, x) == pytest.approx(0.001, abs=1e-15)


def test_each_wheel_finds_its_own_side():
    """Oracle: the road's own height and slope, in whatever order the wheels come."""
    rng = np.random.default_rng(1)
    road = Road(0.0, 0.1, rng.normal(size=50), rng.normal(size=50))
    corners = ["rr", "fl", "rl", "fr"]
    sides = [RIGHT, LEFT, LEFT, RIGHT]
    ground = Ground(road, corners)
    for x in rng.uniform(-1.0, 6.0, (200, 4)):
        height, slope = ground.under(x)
        pairs = list(zip(sides, x, strict=True))
        assert_allclose(height, [road.height(*pair) for pair in pairs], rtol=1e-13, atol=1e-14)
        assert_allclose(slope, [road.slope(*pair) for pair in pairs], rtol=1e-12, atol=1e-12)


def test_a_road_1_mm_higher_lifts_the_resting_car_by_1_mm():
    """Oracle: level ground is alike at every height; all bodies rise, none turns."""
    model = Model(reference_car())
    before = settle(model).copy()
    for tyre in model.tyres:
        model.system.SetObjectParameter(tyre, "offset", [0.0, 0.0, 1e-3])
    model.hold(True)
    model.system.SolveStatic(static_settings(model), updateInitialValues=True)
    moved = coordinates(model) - before
    assert_allclose(moved[:, 2], 1e-3, rtol=0, atol=1e-9)
    assert_allclose(np.delete(moved, 2, axis=1), 0.0, atol=1e-8)


@pytest.mark.slow
def test_a_car_that_has_driven_1_mm_down_stands_1_mm_lower():
    """Ground, tyres and pose together, once the car has swung out; loads are those of before."""
    down = PotholeRoad(3.0, 100.0, 0.001, 1.0, "both")
    run, level = (
        drive(reference_car(), Manoeuvre("down", "road", 2.0, initial_speed=10.0, road=road))
        for road in (down, None)
    )
    for name in ("chassis.z", *(f"wheel.{corner}.z" for corner in CORNERS)):
        assert run[name][-1] - level[name][-1] == pytest.approx(-1e-3, abs=1e-5)
    for corner in CORNERS:
        name = f"tyre.{corner}.load"
        assert run[name][-1] == pytest.approx(level[name][-1], rel=1e-3)
