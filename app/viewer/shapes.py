"""Meshes of a car's parts as (vertices, faces), metres, X forward, Y left, Z up.

They show where things are, not what they look like: one plain closed surface a part.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Vertices = NDArray[np.float64]
Faces = NDArray[np.int64]
Mesh = tuple[Vertices, Faces]

GROUND_CLEARANCE = 0.26
ARCH_GAP = 0.06

# Lines of the body's side view: x from the front axle backwards as a share of the wheelbase, and
# height above the ground in metres.
BELT = ((-0.33, 0.52), (-0.29, 0.68), (0.14, 0.88), (1.24, 0.94), (1.34, 0.84), (1.36, 0.56))
ROOF = ((0.16, 0.88), (0.46, 1.34), (0.60, 1.41), (0.92, 1.38), (1.20, 0.94))


def merge(*meshes: Mesh) -> Mesh:
    """One mesh of several."""
    offsets = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    return (
        np.concatenate([vertices for vertices, _ in meshes]),
        np.concatenate([faces + n for (_, faces), n in zip(meshes, offsets, strict=False)]),
    )


def moved(mesh: Mesh, offset: ArrayLike) -> Mesh:
    """The mesh shifted by an offset."""
    vertices, faces = mesh
    return vertices + np.asarray(offset, dtype=float), faces


def faceted(mesh: Mesh) -> Mesh:
    """The mesh with corners of its own for every triangle, so that edges look sharp."""
    vertices, faces = mesh
    return vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)


def straightened(line: Vertices, tolerance: float = 1e-3) -> Vertices:
    """A polyline without the points that lie on it anyway (m), by Ramer, Douglas and Peucker."""
    start, end = line[0], line[-1]
    along = (end - start) / max(float(np.linalg.norm(end - start)), 1e-12)
    off = line - start
    distance = np.linalg.norm(off - np.outer(off @ along, along), axis=1)
    far = int(np.argmax(distance))
    if distance[far] <= tolerance:
        return np.array([start, end])
    return np.concatenate(
        [straightened(line[: far + 1], tolerance)[:-1], straightened(line[far:], tolerance)]
    )


def loft(sections: Sequence[Vertices], closed: bool = True) -> Mesh:
    """Surface through sections of equal length; `closed` joins each section's end to its start."""
    count = len(sections[0])
    vertices = np.concatenate(sections)
    rows = np.arange(len(sections) - 1)[:, None] * count
    here = np.arange(count if closed else count - 1)
    there = (here + 1) % count
    a, b = (rows + here).ravel(), (rows + there).ravel()
    quads = np.column_stack([a, b, b + count, a + count])
    return vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def box(size: ArrayLike) -> Mesh:
    """A box around the origin."""
    x, y, z = np.asarray(size, dtype=float) / 2
    ring = np.array([(-y, -z), (y, -z), (y, z), (-y, z)])
    ends = [np.column_stack([np.full(4, s), ring]) for s in (-x, x)]
    vertices, faces = loft(ends)
    caps = np.array([(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7)])
    return vertices, np.concatenate([faces, caps])


def lathe(profile: Sequence[tuple[float, float]], segments: int = 36) -> Mesh:
    """A profile of (radius, y) turned about the Y axis."""
    angle = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    rings = [
        np.column_stack([r * np.cos(angle), np.full(segments, y), -r * np.sin(angle)])
        for r, y in profile
    ]
    return loft(rings)


def tyre(radius: float, width: float) -> Mesh:
    """A tyre about the Y axis, its sides open where the rim sits."""
    half, shoulder, inner = width / 2, radius - 0.025, 0.66 * radius
    profile = [(inner, -half), (shoulder, -half), (radius, -half + 0.03)]
    return lathe([*profile, *((r, -y) for r, y in reversed(profile))])


def rim(radius: float, width: float) -> Mesh:
    """A rim with five spokes, so that turning shows, and the stub that carries the wheel."""
    outer, half = 0.66 * radius, width / 2
    ring = lathe([(outer, -half), (outer, half), (0.88 * outer, half), (0.88 * outer, -half)])
    hub = lathe([(0.0, half - 0.02), (0.22 * outer, half - 0.02), (0.22 * outer, -half)], 16)
    spoke = moved(box((0.9 * outer, 0.025, 0.05)), (0.45 * outer, half - 0.04, 0))
    spokes = [turned(spoke, 2 * math.pi * k / 5) for k in range(5)]
    return merge(ring, hub, *spokes)


def ball(radius: float) -> Mesh:
    """A sphere."""
    angle = np.linspace(0, np.pi, 9)
    return lathe([(radius * math.sin(a), -radius * math.cos(a)) for a in angle], 16)


def turned(mesh: Mesh, angle: float) -> Mesh:
    """The mesh turned about the Y axis."""
    vertices, faces = mesh
    c, s = math.cos(angle), math.sin(angle)
    return vertices @ np.array([(c, 0, -s), (0, 1, 0), (s, 0, c)]), faces


def tube(start: ArrayLike, end: ArrayLike, radius: float, segments: int = 14) -> Mesh:
    """A round bar with closed ends."""
    a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    across, up = _normals(b - a)
    angle = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    ring = radius * (np.outer(np.cos(angle), across) + np.outer(np.sin(angle), up))
    return loft([np.tile(a, (segments, 1)), a + ring, b + ring, np.tile(b, (segments, 1))])


def coil(start: ArrayLike, end: ArrayLike, radius: float, wire: float, turns: float = 6.0) -> Mesh:
    """A helical spring from start to end."""
    a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    across, up = _normals(b - a)
    around = np.linspace(0, 2 * np.pi, 7, endpoint=False)
    axis = (b - a) / np.linalg.norm(b - a)
    sections = []
    for share in np.linspace(0, 1, int(20 * turns)):
        turn = 2 * np.pi * turns * share
        out = math.cos(turn) * across + math.sin(turn) * up
        centre = a + share * (b - a) + radius * out
        sections.append(
            centre + wire * (np.outer(np.cos(around), out) + np.outer(np.sin(around), axis))
        )
    return loft(sections)


def body_sections(wheelbase: float, width: float, wheel_radius: float) -> list[Vertices]:
    """Cross-sections of the body from nose to tail: six points each, sill to roof to sill.

    The origin is on the ground under the front axle.
    """
    arch = wheel_radius + ARCH_GAP
    knots = [x * wheelbase for x, _ in (*BELT, *ROOF)]
    arches = [
        axle + arch * math.cos(a) for axle in (0.0, wheelbase) for a in np.linspace(0, math.pi, 13)
    ]
    lowest = GROUND_CLEARANCE * wheel_radius / 0.3
    sections = []
    for back in sorted({round(x, 4) for x in (*knots, *arches)}):
        share = back / wheelbase
        belt = _height(BELT, share)
        inside = ROOF[0][0] <= share <= ROOF[-1][0]
        top = max(belt, _height(ROOF, share)) if inside else belt
        sill = max(
            lowest,
            *(
                wheel_radius + math.sqrt(max(arch**2 - (back - axle) ** 2, 0.0))
                if abs(back - axle) < arch
                else 0.0
                for axle in (0.0, wheelbase)
            ),
        )
        nose = 1 - 0.12 * max(0.0, (-share - 0.1) / 0.23, (share - 1.1) / 0.26)
        half, glass = nose * width / 2, 0.30 * (top - belt)
        right = [(half, min(sill, belt)), (half, belt), (half - 0.04 - glass, top)]
        profile = [*right, *((-y, z) for y, z in reversed(right))]
        sections.append(np.array([(-back, y, z) for y, z in profile]))
    return sections


def _height(line: Sequence[tuple[float, float]], share: float) -> float:
    return float(np.interp(share, [x for x, _ in line], [z for _, z in line]))


def _normals(direction: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    axis = direction / np.linalg.norm(direction)
    helper = np.array([0.0, 1.0, 0.0]) if abs(axis[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    across = np.cross(helper, axis)
    across /= np.linalg.norm(across)
    return across, np.cross(axis, across)
