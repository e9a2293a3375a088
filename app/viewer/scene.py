"""The car and the road as viser nodes, in the design position.

The parts are made here; the page moves them, because the ride is played in the browser. Node
names, and what a part's pose means, are therefore shared with static/ride/poses.js:

    /car/body                the sprung mass, origin at its CG, axes B
    /car/wheel_fl ...        a wheel, origin at its centre
    /car/arm_fl ...          unit length along X from the wheel centre to the pivot, scaled; the
                             page draws of it what lies within the body
    /car/ray_fl ...          the same as a thin line, hidden until the page shows the pivots
    /car/pivot_fl ...        origin at the pivot
    /car/spring_fl ...       unit length along Z from the wheel centre to the mount, scaled
    /car/damper_fl, rod_fl   along Z, origins at the wheel centre and at the mount
    /car/body/grip_front ... handles at the right-hand pivots, hidden until the page shows them
    /car/bar_front, bar_rear unit length along Y from the right arm to the left one, scaled
    /ghost/body, wheel_fl    outlines of the car it is compared with
    /road/surface, lines     the road, origin on the ground at X = 0; the page shapes it

Everything is in an earth frame that travels with the car: X = 0 under its CG, Z = 0 flat ground.
Arms, springs and dampers lie in the plane of their wheel; they are drawn INBOARD of it to be seen.
No skinned meshes: viser 1.1.1 fails when it has to take one down, as it does on a reconnect.
"""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from viser import SceneApi

from ...engine.frames import AXLES, CORNERS, AxleName, Corner, axle_of, side_of
from ...engine.vehicle import Vehicle
from . import shapes

INBOARD = 0.19
TYRE_WIDTH = 0.20

BODY = (148, 163, 184)
EDGES = (230, 159, 0)
TYRE = (38, 42, 48)
RIM = (176, 184, 194)
ARM = (196, 204, 214)
SPRING = (204, 121, 167)
DAMPER = (120, 128, 140)
BAR = (0, 158, 115)
GHOST = (86, 180, 233)
ROAD = (52, 58, 66)
MARKS = (150, 160, 172)
SHADOW = (10, 12, 15)
MARK = (240, 240, 240)

ARM_MESH = shapes.tube((0, 0, 0), (1, 0, 0), 0.028)
SPRING_MESH = shapes.coil((0, 0, 0.1), (0, 0, 1), 0.062, 0.009)
RAY_MESH = shapes.tube((0, 0, 0), (1, 0, 0), 0.007)
BAR_MESH = shapes.tube((0, 0, 0), (0, 1, 0), 0.014)


class Stage(Protocol):
    """What of a ViserServer the car needs."""

    scene: SceneApi


def build(stage: Stage, vehicle: Vehicle) -> None:
    """Make every node for a vehicle; nodes of the same name are replaced."""
    for corner in CORNERS:
        _corner(stage.scene, vehicle, corner)
    for axle in AXLES:
        _bar(stage.scene, vehicle, axle)
    _body(stage.scene, vehicle)
    for axle in AXLES:
        _grip(stage.scene, vehicle, axle)
    _road(stage.scene)


def wheel_centre(vehicle: Vehicle, corner: Corner) -> np.ndarray:
    """Wheel centre at rest in the scene's frame, m."""
    axle = vehicle.axle_at(corner)
    forward = 1 if corner[0] == "f" else -1
    return np.array(
        [forward * axle.cg_distance, side_of(corner) * axle.track / 2, axle.wheel.radius]
    )


def pivot(vehicle: Vehicle, corner: Corner) -> np.ndarray:
    """Pivot of a corner's arm at rest in the scene's frame, m."""
    axle = vehicle.axle_at(corner)
    forward = 1 if corner[0] == "f" else -1
    x, y, _ = wheel_centre(vehicle, corner)
    distance = axle.pivot.distance
    return np.array([x - forward * distance, y, distance * np.tan(axle.pivot.angle)])


def _corner(scene: SceneApi, vehicle: Vehicle, corner: Corner) -> None:
    axle = vehicle.axle_at(corner)
    radius, side = axle.wheel.radius, side_of(corner)
    centre = wheel_centre(vehicle, corner)
    name = f"/car/wheel_{corner}"
    _part(scene, name, shapes.tyre(radius, TYRE_WIDTH), TYRE, centre)
    vertices, faces = shapes.faceted(shapes.rim(radius, 0.9 * TYRE_WIDTH))
    _part(scene, f"{name}/rim", (vertices * (1, side, 1), faces), RIM)
    hub = centre - (0, side * INBOARD, 0)
    hinge = pivot(vehicle, corner) - (0, side * INBOARD, 0)
    height = axle.suspension.mount_height
    mount = hub + (0, 0, height)
    _part(
        scene, f"/car/pivot_{corner}", shapes.tube((0, -0.07, 0), (0, 0.07, 0), 0.055), ARM, hinge
    )
    length, turn = _towards(hinge - hub)
    for part, mesh in (("arm", ARM_MESH), ("ray", RAY_MESH)):
        name, visible = f"/car/{part}_{corner}", part == "arm"
        _part(scene, name, mesh, ARM, hub, turn, scale=(length, 1, 1), visible=visible)
    _part(scene, f"/car/spring_{corner}", SPRING_MESH, SPRING, hub, scale=(1, 1, height))
    _part(
        scene,
        f"/car/damper_{corner}",
        shapes.merge(
            shapes.tube((0, 0, 0), (0, 0, 0.55 * height), 0.034),
            shapes.tube((0, -0.07, 0), (0, 0.07, 0), 0.05),
        ),
        DAMPER,
        hub,
    )
    rod = shapes.merge(
        shapes.tube((0, 0, -0.65 * height), (0, 0, 0), 0.016),
        shapes.tube((0, 0, 0), (0, 0, 0.025), 0.075),
    )
    _part(scene, f"/car/rod_{corner}", rod, DAMPER, mount)

    turn = np.linspace(0, 2 * np.pi, 25)
    circle = radius * np.column_stack([np.cos(turn), np.zeros_like(turn), np.sin(turn)])
    circle[:, 1] = side * TYRE_WIDTH / 2
    scene.add_line_segments(
        f"/ghost/wheel_{corner}",
        _polyline(circle),
        GHOST,
        thickness=1.5,
        thickness_units="screen",
        position=centre,
        visible=False,
    )


def _bar(scene: SceneApi, vehicle: Vehicle, axle: AxleName) -> None:
    left, right = (_bar_end(vehicle, corner) for corner in CORNERS if axle_of(corner) == axle)
    scale = (1, float(np.linalg.norm(left - right)), 1)
    _part(scene, f"/car/bar_{axle}", BAR_MESH, BAR, right, scale=scale)


def _grip(scene: SceneApi, vehicle: Vehicle, axle: AxleName) -> None:
    corner: Corner = "fr" if axle == "front" else "rr"
    inboard = np.array([0, side_of(corner) * INBOARD, vehicle.chassis.cg_height])
    scene.add_transform_controls(
        f"/car/body/grip_{axle}",
        scale=0.42,
        line_width=3.0,
        active_axes=(True, False, True),
        disable_rotations=True,
        depth_test=False,
        position=pivot(vehicle, corner) - inboard,
        visible=False,
    )


def _bar_end(vehicle: Vehicle, corner: Corner) -> np.ndarray:
    hub, hinge = wheel_centre(vehicle, corner), pivot(vehicle, corner)
    return hub + 0.25 * (hinge - hub) - (0, side_of(corner) * INBOARD, 0)


def _body(scene: SceneApi, vehicle: Vehicle) -> None:
    front, rear = vehicle.front, vehicle.rear
    width = max(front.track, rear.track) + TYRE_WIDTH
    sections = shapes.body_sections(
        vehicle.wheelbase, width, max(front.wheel.radius, rear.wheel.radius)
    )
    offset = np.array([front.cg_distance, 0, -vehicle.chassis.cg_height])
    sections = [section + offset for section in sections]
    at_rest = (0, 0, vehicle.chassis.cg_height)

    shell = shapes.faceted(shapes.loft(sections, closed=False))
    _part(scene, "/car/body", shell, BODY, at_rest, opacity=0.16)
    edges = _edges(sections)
    for name, colour, thickness in (
        ("/car/body/edges", EDGES, 1.4),
        ("/ghost/body", GHOST, 1.6),
    ):
        scene.add_line_segments(
            name,
            edges,
            colour,
            thickness=thickness,
            thickness_units="screen",
            position=at_rest if name == "/ghost/body" else (0, 0, 0),
            visible=name != "/ghost/body",
        )
    middle = (front.cg_distance - rear.cg_distance) / 2
    floor = shapes.faceted(shapes.box((0.86 * vehicle.wheelbase, 0.62 * width, 0.04)))
    under = (middle, 0, 0.30 - vehicle.chassis.cg_height)
    _part(scene, "/car/body/floor", floor, DAMPER, under, opacity=0.55)
    _part(scene, "/car/body/cg", shapes.ball(0.045), MARK)
    shadow = shapes.faceted(shapes.box((1.5 * vehicle.wheelbase, 1.02 * width, 0.002)))
    _part(scene, "/car/shadow", shadow, SHADOW, (middle, 0, 0.004), opacity=0.35)


def _road(scene: SceneApi) -> None:
    x, y = np.array([-30.0, 60.0]), np.array([1.7, -1.7])
    surface = [np.column_stack([np.full(2, station), y, np.zeros(2)]) for station in x]
    _part(scene, "/road/surface", shapes.loft(surface, closed=False), ROAD)
    marks = np.array([[(station, 1.7, 0), (station, -1.7, 0)] for station in range(-30, 61, 2)])
    scene.add_line_segments("/road/lines", marks, MARKS, thickness=1.2, thickness_units="screen")


def _edges(sections: list[np.ndarray]) -> np.ndarray:
    along = [np.array([section[k] for section in sections]) for k in range(6)]
    x = np.array([section[0, 0] for section in sections])
    tops = np.array([section[2, 2] - section[1, 2] for section in sections])
    cabin = np.flatnonzero(tops > 1e-6)
    roof = cabin[[int(np.argmax(tops[cabin] > 0.9 * tops.max()))]]
    across = [0, cabin[0], int(roof[0]), cabin[-1], len(x) - 1]
    return np.concatenate(
        [
            *(_polyline(shapes.straightened(line)) for line in along),
            *(_polyline(sections[k]) for k in across),
        ]
    )


def _polyline(points: np.ndarray) -> np.ndarray:
    return np.stack([points[:-1], points[1:]], axis=1)


def _towards(direction: np.ndarray) -> tuple[float, tuple[float, float, float, float]]:
    """Length of a direction in the XZ plane, and the quaternion that turns +X to it."""
    x, _, z = direction
    half = np.arctan2(-z, x) / 2
    return float(np.hypot(x, z)), (float(np.cos(half)), 0.0, float(np.sin(half)), 0.0)


def _part(
    scene: SceneApi,
    name: str,
    mesh: shapes.Mesh,
    colour: tuple[int, int, int],
    position: ArrayLike = (0.0, 0.0, 0.0),
    turn: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0),
    *,
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0),
    opacity: float | None = None,
    visible: bool = True,
) -> None:
    """Every mesh has the same material: a browser without a GPU compiles each kind for seconds."""
    scene.add_mesh_simple(
        name,
        *mesh,
        color=colour,
        opacity=opacity,
        side="double",
        position=np.asarray(position, dtype=float),
        wxyz=turn,
        scale=scale,
        visible=visible,
        cast_shadow=False,
        receive_shadow=False,
    )
