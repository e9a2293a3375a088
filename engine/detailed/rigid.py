"""Bodies that fixed joints make one, and the count of what is left free.

A group of rigidly joined bodies moves as one body of the same mass, CG and inertia, so the solver
gets one body a group; the counts that are reported are those of the specification, every body and
every joint as written.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .records import CONSTRAINED, BodyData, DetailedCar, Joint

Array = NDArray[np.float64]

DEPENDENT = 1e-9
"""Singular values below this share of the greatest are zero."""


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Bodies that move as one.

    names : the heaviest body first, whose name stands for the group
    mass : kg;  cg (3,) : in the design frame;  inertia (3, 3) : at the CG
    """

    names: tuple[str, ...]
    mass: float
    cg: Array
    inertia: Array


@dataclass(frozen=True, slots=True)
class Counts:
    """Degrees of freedom in three ways, which agree where no constraint is redundant.

    bodies, constraints : as specified
    by_joints : 6 N - constraints;  by_rank : 6 N - rank of the constraint Jacobian
    by_null_space : dimension of the motions that every joint lets happen, bodies merged
    """

    bodies: int
    constraints: int
    by_joints: int
    by_rank: int
    by_null_space: int


def rigid_groups(car: DetailedCar) -> list[Group]:
    """The car's bodies, rigidly joined ones merged, in the order of their first body."""
    group_of = {body.name: {body.name} for body in car.bodies}
    for joint in car.joints:
        if joint.kind == "fixed":
            merged = group_of[joint.bodies[0]] | group_of[joint.bodies[1]]
            group_of.update(dict.fromkeys(merged, merged))
    found: dict[int, list[BodyData]] = {}
    for body in car.bodies:
        found.setdefault(id(group_of[body.name]), []).append(body)
    return [_merged(bodies) for bodies in found.values()]


def _merged(bodies: Sequence[BodyData]) -> Group:
    """Mass, CG and inertia of bodies together: I = sum I_k + m_k (|d|^2 1 - d d^T)."""
    mass = sum(body.mass for body in bodies)
    cg = np.array([body.mass * np.array(body.cg) for body in bodies]).sum(axis=0) / mass
    inertia = np.zeros((3, 3))
    for body in bodies:
        d = np.array(body.cg) - cg
        inertia += body.inertia.matrix + body.mass * (d @ d * np.eye(3) - np.outer(d, d))
    heaviest_first = sorted(bodies, key=lambda body: -body.mass)
    return Group(tuple(body.name for body in heaviest_first), mass, cg, inertia)


def counts(car: DetailedCar) -> Counts:
    """Bodies, constraints and degrees of freedom of the specification."""
    each = {body.name: k for k, body in enumerate(car.bodies)}
    jacobian = constraint_jacobian(car.joints, each, [np.array(b.cg) for b in car.bodies])
    groups = rigid_groups(car)
    merged = {name: k for k, group in enumerate(groups) for name in group.names}
    moving = [joint for joint in car.joints if joint.kind != "fixed"]
    reduced = constraint_jacobian(moving, merged, [group.cg for group in groups])
    size, constraints = jacobian.shape[1], jacobian.shape[0]
    return Counts(
        bodies=len(car.bodies),
        constraints=constraints,
        by_joints=size - constraints,
        by_rank=size - _rank(jacobian),
        by_null_space=null_space(reduced).shape[1],
    )


def constraint_jacobian(joints: Sequence[Joint], index: dict[str, int], cgs: list[Array]) -> Array:
    """Rows of what the joints hold, columns (v, w) of each body's CG and spin, design position."""
    rows = []
    for joint in joints:
        frame = joint_frame(joint)
        for direction in CONSTRAINED[joint.kind]:
            axis = frame[:, direction % 3]
            row = np.zeros(6 * len(cgs))
            for sign, name in zip((-1.0, 1.0), joint.bodies, strict=True):
                at = 6 * index[name]
                if direction < 3:
                    arm = np.array(joint.point) - cgs[index[name]]
                    row[at : at + 3] += sign * axis
                    row[at + 3 : at + 6] += sign * np.cross(arm, axis)
                else:
                    row[at + 3 : at + 6] += sign * axis
            rows.append(row)
    return np.array(rows).reshape(-1, 6 * len(cgs))


def joint_frame(joint: Joint) -> Array:
    """Rotation matrix (3, 3) whose last column is the joint's axis; the rest is any square pair."""
    return frame_about(np.array(joint.axis or (0.0, 0.0, 1.0)))


def frame_about(axis: Array) -> Array:
    """Rotation matrix (3, 3) with z along an axis and x some square direction."""
    z = axis / np.linalg.norm(axis)
    aside = np.eye(3)[np.argmin(np.abs(z))]
    x = np.cross(aside, z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def null_space(jacobian: Array) -> Array:
    """Orthonormal columns that a Jacobian (m, n) maps to zero."""
    _, singular, rows = np.linalg.svd(jacobian, full_matrices=True)
    return rows[int(np.sum(singular > DEPENDENT * singular[0])) :].T


def _rank(jacobian: Array) -> int:
    singular = np.linalg.svd(jacobian, compute_uv=False)
    return int(np.sum(singular > DEPENDENT * singular[0]))
