import pickle
from dataclasses import replace

import pytest
from ridetune.engine.errors import ParameterError, VehicleError
from ridetune.engine.vehicle import check, numbers
from ridetune.engine.vehicle_file import reference_vehicles


@pytest.fixture
def car():
    return reference_vehicles()["paper"]


def numbers_of(car):
    """Its numbers by path, without those that it lacks."""
    values = {path: car.value(path) for path in numbers()}
    return {path: value for path, value in values.items() if value is not None}


def test_the_car_s_mass_is_that_of_its_five_bodies(car):
    """Oracle: the paper's total mass, 1240 kg."""
    assert car.total_mass == 1090 + 2 * 36 + 2 * 39 == 1240


def test_the_wheelbase_is_the_sum_of_the_axles_distances_from_the_cg(car):
    assert car.wheelbase == pytest.approx(1.30 + 1.36, abs=1e-15)


def test_driven_corners_are_those_of_the_driven_axles(car):
    assert car.driven_corners == ("rl", "rr")
    four_wheels = replace(car, front=replace(car.front, driven=True))
    assert four_wheels.driven_corners == ("fl", "fr", "rl", "rr")


def test_a_corner_belongs_to_its_axle(car):
    assert car.axle_at("fr") is car.axle("front") is car.front
    assert car.axle_at("rl") is car.axle("rear") is car.rear


def test_a_path_names_one_number(car):
    assert car.value("rear.pivot.distance") == 1.10
    assert car.value("chassis.inertia.yy") == 1550


def test_replacing_numbers_leaves_everything_else_alone(car):
    changed = car.with_values({"front.pivot.angle": 0.1, "rear.suspension.damping": 2000})
    assert (changed.front.pivot.angle, changed.rear.suspension.damping) == (0.1, 2000.0)
    back = changed.with_values(numbers_of(car))
    assert back == car


def test_every_number_of_a_car_can_be_replaced_by_its_path(car):
    for path, value in numbers_of(car).items():
        assert car.with_values({path: value}) == car


def test_a_car_survives_the_trip_to_a_worker_process(car):
    assert pickle.loads(pickle.dumps(car)) == car


def test_a_misspelt_path_is_answered_with_the_nearest(car):
    with pytest.raises(ParameterError, match=r"front\.pivot\.angel.*mean front\.pivot\.angle\?"):
        car.value("front.pivot.angel")


@pytest.mark.parametrize("path", ["driven", "front", "front.driven", "front.wheel.cg_offset", ""])
def test_a_path_that_is_no_number_is_refused(car, path):
    with pytest.raises(ParameterError, match="No number"):
        car.with_values({path: 1.0})


def test_brakes_cannot_be_tuned_on_a_car_without_brakes(car):
    bare = replace(car, brakes=None)
    with pytest.raises(ParameterError, match="has no brakes"):
        bare.with_values({"brakes.front_share": 0.6})


@pytest.mark.parametrize(
    ("path", "value", "accepted"),
    [
        ("chassis.mass", -1090.0, "between 10 and 100000 kg"),
        ("chassis.mass", 0.0, "between 10 and 100000 kg"),
        ("front.wheel.mass", float("nan"), "between 0.1 and 100000 kg"),
        ("front.track", 1500.0, "between 0.2 and 5 m"),
        ("front.cg_distance", -1.3, "between 0.05 and 20 m"),
        ("rear.wheel.radius", 0.0, "between 0.05 and 2 m"),
        ("rear.suspension.stiffness", 24.0, "between 100 and 1e\\+07 N/m"),
        ("rear.suspension.damping", -1.0, "between 0 and 1e\\+06 N s/m"),
        ("rear.suspension.mount_height", -0.4, "between 0.02 and 5 m"),
        ("rear.pivot.distance", 0.0999, "between 0.1 and 100 m \\(or between -100 and -0.1 m"),
        ("rear.pivot.distance", 0.0, "between 0.1 and 100 m"),
        ("rear.pivot.angle", 4.0, "between -1.5 and 1.5 rad"),
        ("front.tyre.stiffness", 0.0, "between 1000 and 1e\\+08 N/m"),
        ("front.tyre.rolling_resistance", 1.0, "between 0 and 0.5"),
        ("brakes.front_share", 65.0, "between 0 and 1"),
    ],
)
def test_an_impossible_number_is_refused_with_the_accepted_range(car, path, value, accepted):
    with pytest.raises(VehicleError, match=f"{path} is .*{accepted}"):
        car.with_values({path: value})


@pytest.mark.parametrize("distance", [-0.1, 0.1])
def test_the_pivot_may_be_on_either_side_of_the_wheel(car, distance):
    assert car.with_values({"front.pivot.distance": distance}).front.pivot.distance == distance


@pytest.mark.parametrize(
    ("distance", "angle", "degrees"),
    [(1.6, 1.5, "4.1"), (0.1, 1.5, "5.1"), (-1.6, 1.5, "4"), (-0.2, -1.49, "5.3")],
)
def test_an_arm_that_stands_upright_is_refused(car, distance, angle, degrees):
    """Oracle: atan(|d| / |d tan(phi) - r|) by hand; 5.74 deg is a tenth of the length."""
    pivot = {"front.pivot.distance": distance, "front.pivot.angle": angle}
    with pytest.raises(VehicleError, match=rf"front\.pivot lies .* {degrees} deg .*lengthen"):
        car.with_values(pivot)


@pytest.mark.parametrize(
    ("distance", "angle"), [(0.1, -0.3), (0.1, 1.3), (10.0, 1.3), (-10.0, 1.3)]
)
def test_a_virtual_pivot_may_lie_underground_or_far_above(car, distance, angle):
    """The corners of a fit's default bounds: the pivot is the centre of a motion, not a part."""
    for axle in ("front", "rear"):
        values = {f"{axle}.pivot.distance": distance, f"{axle}.pivot.angle": angle}
        assert car.with_values(values).axle(axle).pivot.distance == distance


@pytest.mark.parametrize(
    "moments",
    [
        {"chassis.inertia.xx": 100.0},  # 100 + 1550 < 1700
        {"chassis.inertia.yy": 2200.0},  # 420 + 1700 < 2200
        {"chassis.inertia.zz": 2000.0},  # 420 + 1550 < 2000
        {"rear.wheel.inertia.yy": 1.3},  # 0.6 + 0.6 < 1.3
    ],
)
def test_no_moment_of_inertia_exceeds_the_sum_of_the_others(car, moments):
    with pytest.raises(VehicleError, match="cannot belong to a real body"):
        car.with_values(moments)


def test_a_flat_disc_is_the_limit_that_is_still_a_body(car):
    """Closed form: the moments of a thin disc are m r^2/4, m r^2/2, m r^2/4."""
    disc = {"xx": 0.1, "yy": 0.2, "zz": 0.1}
    path = "front.wheel.inertia."
    accepted = car.with_values({path + axis: value for axis, value in disc.items()})
    assert accepted.front.wheel.inertia.yy == 0.2


def test_the_product_of_inertia_counts_in_the_triangle_inequality(car):
    """Closed form: xx + zz and yy do not change with xz, so yy = xx + zz - 2 min bounds it.

    The principal moments in the xz plane are s -+ sqrt(((zz - xx)/2)^2 + xz^2), s = (xx + zz)/2;
    the greater may exceed the smaller by at most yy: xz^2 <= (yy/2)^2 - ((zz - xx)/2)^2.
    """
    limit = (775.0**2 - 640.0**2) ** 0.5
    assert car.with_values({"chassis.inertia.xz": 0.999 * limit}).chassis.inertia.xz > 0.0
    for sign in (1, -1):
        with pytest.raises(VehicleError, match="xz included"):
            car.with_values({"chassis.inertia.xz": sign * 1.001 * limit})


def test_a_car_without_a_driven_axle_is_refused(car):
    with pytest.raises(VehicleError, match=r"engine\.json: .*both false; set one"):
        check(replace(car, rear=replace(car.rear, driven=False)), "engine.json")


def test_an_offset_is_checked_element_by_element(car):
    wheel = replace(car.front.wheel, cg_offset=(0.0, 0.0, 30.0))
    with pytest.raises(VehicleError, match=r"front\.wheel\.cg_offset\[2\] is 30 m"):
        check(replace(car, front=replace(car.front, wheel=wheel)))
