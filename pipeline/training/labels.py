"""The labels of a rendered image: every vehicle's box, and how much of it is visible."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.common.geometry import transform
from pipeline.simulation.drawing.canvas import NEAR_M, clip_near
from pipeline.simulation.drawing.meshes import mesh
from pipeline.simulation.world.world_state import LIDAR_HEIGHT_M, ActorState, World
from pipeline.types import F64, Box, CameraCalibration

Ints32 = npt.NDArray[np.int32]
CLASSES = ("car", "truck", "bus", "motorcycle")
CLASS_OF = {"car": 0, "van": 0, "truck": 1, "bus": 2, "motorcycle": 3}
"""Class index of each kind of simulated vehicle. A van is a car, as in COCO."""
_FAR_OUTSIDE_PX = 20_000.0
_WIDEST_TAN = 1.1


@dataclass(frozen=True)
class Label:
    """One vehicle in an image."""

    actor_id: int
    """Id of the vehicle in the scenario."""
    label: int
    """Class index, see ``CLASS_OF``."""
    box: Box
    """Box of its whole outline, hidden parts included, because the height gives the distance; clipped to the image."""
    visible: float
    """Share of the outline inside the image that nearer vehicles do not cover."""
    distance_m: float
    """From the ego origin to the nearest corner of its footprint."""
    ahead: bool
    """Whether its centre lies ahead, at most 1.5 m to either side."""
    cut: bool
    """Whether the image's border cuts the outline."""


def labels(world: World, camera: CameraCalibration) -> tuple[Label, ...]:
    """Every vehicle that touches the image, nearest first."""
    owners = np.zeros((camera.height, camera.width), dtype=np.int32)
    found = []
    for number, state in enumerate(world.actors, start=1):  # farthest first
        whole = _outline(state, camera)
        inside = _inside(whole, camera)
        if len(inside) == 0:
            continue
        cut = bool(np.any(np.abs(_extent(inside) - _extent(whole)) > 0.5))
        found.append((number, state, inside, cut, _fill(owners, inside, number)))
    free = np.bincount(owners.ravel(), minlength=len(world.actors) + 1)
    return tuple(
        Label(
            actor_id=state.actor.id,
            label=CLASS_OF[state.actor.kind],
            box=_box(inside),
            visible=float(free[number] / max(area, 1)),
            distance_m=_distance_m(state),
            ahead=abs(state.cuboid.center[1]) < 1.5 and state.cuboid.center[0] > 0.0,
            cut=cut,
        )
        for number, state, inside, cut, area in reversed(found)
    )


def _outline(state: ActorState, camera: CameraCalibration) -> F64:
    """(K, 2) pixels: convex hull of the vehicle's mesh beyond the near plane; empty when it is behind the camera."""
    shape = mesh(state.actor.kind, state.actor.size())
    x, y, _ = state.cuboid.center
    c, s = np.cos(state.cuboid.yaw_rad), np.sin(state.cuboid.yaw_rad)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    points = transform(camera.T_camera_ego, shape.vertices @ turn + np.array([x, y, -LIDAR_HEIGHT_M]))
    if points[:, 2].max() <= NEAR_M:
        return np.empty((0, 2))
    if points[:, 2].min() < NEAR_M:
        points = np.concatenate([clip_near(face) for face in np.split(points, np.cumsum(shape.counts)[:-1])])
    flat = through_lens(points[:, :2] / points[:, 2:], camera)
    pixels = flat * (camera.K[0, 0], camera.K[1, 1]) + camera.K[:2, 2]
    hull = cv2.convexHull(np.clip(pixels, -_FAR_OUTSIDE_PX, _FAR_OUTSIDE_PX).astype(np.float32))
    return np.asarray(hull[:, 0], dtype=np.float64)


def through_lens(flat: F64, camera: CameraCalibration) -> F64:
    """Apply the lens distortion (k1, k2) to (K, 2) points of the image plane at distance 1. Beyond the image, where the
    polynomial may decrease again, the distortion at the image's edge is used."""
    if not camera.distortion.size:
        return flat
    k1, k2 = camera.distortion[:2]
    squared = np.minimum((flat**2).sum(axis=1, keepdims=True), _WIDEST_TAN**2)
    bent: F64 = flat * (1.0 + k1 * squared + k2 * squared**2)
    return bent


def _inside(outline: F64, camera: CameraCalibration) -> F64:
    """(K, 2): the part of a convex outline inside the image; empty if it is less than a pixel across."""
    if len(outline) < 3:
        return np.empty((0, 2))
    w, h = camera.width, camera.height
    image = np.array([[0, 0], [w, 0], [w, h], [0, h]], dtype=np.float32)
    area, common = cv2.intersectConvexConvex(outline.astype(np.float32), image)
    if area <= 0.0 or np.ptp(common[:, 0], axis=0).min() < 1.0:
        return np.empty((0, 2))
    return np.asarray(common[:, 0], dtype=np.float64)


def _fill(owners: Ints32, outline: F64, number: int) -> int:
    """Assign the outline's pixels to a vehicle and return their number."""
    pixels = np.round(outline).astype(np.int32)
    left, top, width, height = cv2.boundingRect(pixels)
    part = owners[top : top + height, left : left + width]
    own = np.zeros(part.shape, dtype=np.uint8)
    cv2.fillConvexPoly(own, pixels - (left, top), 1)
    part[own > 0] = number
    return int(np.count_nonzero(own))


def _extent(outline: F64) -> F64:
    return np.concatenate([outline.min(axis=0), outline.max(axis=0)])


def _box(outline: F64) -> Box:
    x1, y1, x2, y2 = _extent(outline).tolist()
    return x1, y1, x2, y2


def _distance_m(state: ActorState) -> float:
    return float(np.linalg.norm(state.cuboid.footprint(), axis=1).min())
