"""Merged bodies and counted freedoms."""

import numpy as np
from numpy.testing import assert_allclose
from ridetune.engine.detailed.car_file import reference_car
from ridetune.engine.detailed.records import BodyData, DetailedCar, Joint, Tensor
from ridetune.engine.detailed.rigid import Counts, counts, frame_about, rigid_groups


def test_three_ways_to_count_agree_on_164_degrees_of_freedom():
    """Oracle: the paper's numbers; rank and null space do not know the joints' sizes."""
    assert counts(reference_car()) == Counts(81, 6 * 81 - 164, 164, 164, 164)
    assert len(rigid_groups(reference_car())) == 51


def test_merged_bodies_keep_mass_moment_and_spin_energy():
    """Oracle: sums over the 81 bodies of m, m r and the inertia about the origin."""

    def about_origin(mass, cg, inertia):
        return inertia + mass * (cg @ cg * np.eye(3) - np.outer(cg, cg))

    car = reference_car()
    single = [(body.mass, np.array(body.cg), body.inertia.matrix) for body in car.bodies]
    merged = [(group.mass, group.cg, group.inertia) for group in rigid_groups(car)]
    for whole in (
        lambda parts: sum(mass for mass, _, _ in parts),
        lambda parts: sum(mass * cg for mass, cg, _ in parts),
        lambda parts: sum(about_origin(*part) for part in parts),
    ):
        assert_allclose(whole(merged), whole(single), rtol=1e-12, atol=1e-9)


def test_a_redundant_joint_shows_in_the_count_by_joints_only():
    """Two hinges on one line: the second adds five rows and takes nothing more."""
    tensor = Tensor(1.0, 1.0, 1.0)
    bodies = tuple(
        BodyData(name, 1.0, (x, 0.0, 0.0), tensor) for name, x in (("a", 0.0), ("b", 1.0))
    )
    hinges = tuple(
        Joint("revolute", ("a", "b"), (0.5, y, 0.0), (0.0, 1.0, 0.0)) for y in (0.0, 1.0)
    )
    car = DetailedCar.__new__(DetailedCar)
    object.__setattr__(car, "bodies", bodies)
    object.__setattr__(car, "joints", hinges)
    assert counts(car) == Counts(2, 10, by_joints=2, by_rank=7, by_null_space=7)


def test_frame_about_an_axis_is_a_rotation_with_z_along_it():
    rng = np.random.default_rng(1)
    for axis in (*rng.normal(size=(20, 3)), *np.eye(3), *-np.eye(3)):
        frame = frame_about(axis)
        assert_allclose(frame.T @ frame, np.eye(3), atol=1e-14)
        assert np.linalg.det(frame) > 0.0
        assert_allclose(frame[:, 2], axis / np.linalg.norm(axis), atol=1e-14)
