"""A rendered camera: 1280×720, 78° diagonal field of view, behind the windshield, looking 2° down.

The LiDAR sits in the bumper, 1.6 m ahead of the camera and 0.8 m below it, so the parallax between them is real.
"""

from __future__ import annotations

from functools import lru_cache, partial

import numpy as np

from pipeline.common.geometry import Cuboid, inverse, rotation
from pipeline.simulation.drawing import backdrop
from pipeline.simulation.drawing.canvas import Canvas, Colour
from pipeline.simulation.drawing.lens import ORDINARY, CameraModel, ImageSensor
from pipeline.simulation.drawing.meshes import mesh
from pipeline.simulation.drawing.road_markings import paint_ground
from pipeline.simulation.drawing.roadside_shapes import add_thing
from pipeline.simulation.drawing.turned_view import margin_for, turned, with_margin
from pipeline.simulation.world.roads import Road
from pipeline.simulation.world.roadside import Roadside
from pipeline.simulation.world.world_state import LIDAR_HEIGHT_M, ActorState, World
from pipeline.types import U8, CameraCalibration

WIDTH, HEIGHT, DIAGONAL_FOV_DEG = 1280, 720, 78.0
PLACE_M = (-1.6, 0.0, 0.8)
PITCH_DOWN_DEG = 2.0
_BEHIND_M, _AHEAD_M = 12.0, 420.0
_SHADOWS = ((0.35, 0.35, (72.0, 69.0, 68.0)), (0.12, 0.12, (52.0, 50.0, 49.0)), (-0.12, 0.0, (34.0, 33.0, 33.0)))
_BRAKE_ON, _BRAKE_OFF = (70.0, 60.0, 255.0), (36.0, 30.0, 150.0)


def calibration(model: CameraModel = ORDINARY) -> CameraCalibration:
    """The exact calibration of its images: pinhole with radial distortion."""
    focal = float(np.hypot(WIDTH, HEIGHT) / 2 / np.tan(np.radians(DIAGONAL_FOV_DEG / 2)))
    K = np.array([[focal, 0.0, WIDTH / 2], [0.0, focal, HEIGHT / 2], [0.0, 0.0, 1.0]])
    axes = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # columns: camera x, y, z in level ego axes
    T_ego_camera = np.eye(4)
    T_ego_camera[:3, :3] = rotation(0.0, np.radians(PITCH_DOWN_DEG), 0.0) @ axes
    T_ego_camera[:3, 3] = PLACE_M
    distortion = np.array([model.k1, model.k2, 0.0, 0.0])
    return CameraCalibration(K, distortion, inverse(T_ego_camera), WIDTH, HEIGHT)


@lru_cache(maxsize=2)
def _prepared(model: CameraModel, seed: int, margin_px: int) -> tuple[ImageSensor, backdrop.GroundTexture]:
    """Data shared by all images, which takes as long to compute as a dozen of them; cached for scenarios that are
    opened again."""
    camera = calibration(model)
    ground = backdrop.GroundTexture(with_margin(camera, margin_px), -LIDAR_HEIGHT_M, seed)
    return ImageSensor(camera, model, seed), ground


class DrawnCamera:
    """Renders the world of one scenario. Static content is prepared once. turns_rad: largest angle by which the camera
    may be turned in its mount."""

    def __init__(
        self, road: Road, roadside: Roadside, seed: int, model: CameraModel = ORDINARY, turns_rad: float = 0.0
    ) -> None:
        self.camera = calibration(model)
        self._margin_px = margin_for(self.camera, turns_rad)
        self._wide = with_margin(self.camera, self._margin_px)
        self._sensor, self._ground = _prepared(model, seed, self._margin_px)
        self._road, self._roadside = road, roadside
        self._sky = backdrop.sky(self._wide.width, self._ground.horizon, seed)

    def image(self, world: World, actual: CameraCalibration | None = None) -> U8:
        """(720, 1280, 3) uint8 blue green red of one moment. actual: the camera as it really looks; None if as
        calibrated."""
        drawn = self._drawn(world)
        if self._margin_px:
            drawn = turned(drawn, self.camera, self._margin_px, actual if actual is not None else self.camera)
        return self._sensor.expose(drawn, world.t_s)

    def _drawn(self, world: World) -> U8:
        """The ideal image, with its margin: sharp and without noise."""
        bgr = np.empty((self._wide.height, self._wide.width, 3), dtype=np.uint8)
        canvas = Canvas(bgr, self._wide)
        horizon = self._ground.horizon
        self._paint_sky(bgr[:horizon], world)
        paint_ground(canvas, self._road, world, horizon)
        for state in world.actors:
            _add_shadow(canvas, state)
        canvas.paint(haze=False)
        x, y, _ = world.pose
        self._ground.finish(bgr[horizon:], x, y)
        self._add_standing(canvas, world)
        canvas.paint()
        return bgr

    def _paint_sky(self, above: U8, world: World) -> None:
        turned_px = round(world.pose[2] * self.camera.K[0, 0])
        columns, width = self._sky.shape[1], above.shape[1]
        start = (width - turned_px) % columns
        first = self._sky[: len(above), start : start + width]
        above[:, : first.shape[1]] = first
        above[:, first.shape[1] :] = self._sky[: len(above), : width - first.shape[1]]

    def _add_standing(self, canvas: Canvas, world: World) -> None:
        """Vehicles and roadside items, farthest first (painter's algorithm)."""
        ahead = [state for state in world.actors if -_BEHIND_M < state.cuboid.center[0] < _AHEAD_M]
        jobs = [(*state.cuboid.center[:2], partial(_add_actor, canvas, state)) for state in ahead]
        for thing, x, y, yaw in self._roadside.near(world, _BEHIND_M, _AHEAD_M):
            jobs.append((x, y, partial(add_thing, canvas, thing, x, y, yaw)))
        for _, _, add in sorted(jobs, key=lambda job: (-job[0], -abs(job[1]))):
            add()


def _add_shadow(canvas: Canvas, state: ActorState) -> None:
    """The contact shadow below a vehicle, and the softer sun shadow ahead and to the right."""
    x, y, _ = state.cuboid.center
    length, width, _ = state.cuboid.size
    if not -_BEHIND_M < x < _AHEAD_M / 2:
        return
    for grow, shift, bgr in _SHADOWS:
        flat = Cuboid((x + shift, y - shift, 0.0), (length + grow, width + grow, 0.0), state.cuboid.yaw_rad).footprint()
        canvas.add_face(tuple((px, py, -LIDAR_HEIGHT_M) for px, py in flat.tolist()), bgr)


def _add_actor(canvas: Canvas, state: ActorState) -> None:
    shape = mesh(state.actor.kind, state.actor.size())
    x, y, _ = state.cuboid.center
    c, s = np.cos(state.cuboid.yaw_rad), np.sin(state.cuboid.yaw_rad)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    foot = np.array([x, y, -LIDAR_HEIGHT_M])
    normals = shape.normals @ turn
    to_eye = np.array(PLACE_M) - (shape.middles @ turn + foot)
    seen = np.einsum("ij,ij->i", normals, to_eye) > 0.0
    points = shape.vertices @ turn + foot
    colours = shape.colours_of(_paint(state.actor.colour), _BRAKE_ON if state.braking else _BRAKE_OFF)
    normals[shape.glows] = 0.0
    away = np.hypot(x + shape.group_x * c - shape.group_y * s, y + shape.group_x * s + shape.group_y * c)
    for group in np.argsort(-away, kind="stable"):
        chosen = seen & (shape.group == group)
        canvas.add(points[chosen[shape.face_of_vertex]], shape.counts[chosen], colours[chosen], normals[chosen])


def _paint(colour: str) -> Colour:
    red, green, blue = (float(int(colour[i : i + 2], 16)) for i in (1, 3, 5))
    return blue, green, red
