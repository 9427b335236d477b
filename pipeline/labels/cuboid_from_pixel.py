"""Creates a cuboid for a vehicle at an image pixel: from the points there or, if there are too few, from its height in
the image."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.alignment.projection import Alignment, resolve
from pipeline.common.errors import BadInput
from pipeline.common.geometry import Cuboid
from pipeline.fusion.vehicle_sizes import usual_size_m
from pipeline.labels.cuboids.points_of import CLUSTERS, FEWEST_POINTS
from pipeline.labels.cuboids.snap import onto_points
from pipeline.lidar.boxes import fit_obstacles
from pipeline.lidar.cluster import candidates, cluster
from pipeline.lidar.ground import Ground, fit_ground
from pipeline.params import BoxParams, GroundParams, Params
from pipeline.types import F32, I32, REAL_VEHICLES, Box, Detection, Frame, Mask, VisionMeasurement
from pipeline.vision.distance import measure

_CLICK_SHARE = 0.015
"""Maximum distance of a point from a click, in image widths."""
_OWN_SHARE = 0.5
"""A cluster with a smaller share inside the box is something behind or in front of it."""


class NothingThere(BadInput):
    """Neither points nor image determine its position."""


@dataclass(frozen=True)
class Lifted:
    """A cuboid derived from a position in the image."""

    cuboid: Cuboid
    """In the ego frame."""
    bbox: Box | None
    """In image pixels; None if none was drawn or detected there."""
    points: int
    """Number of points used to fit the cuboid; 0 if its distance comes from the image."""
    how: str
    """How the distance was measured: one sentence."""


def lift(
    frame: Frame, params: Params, label: str, bbox: Box | None = None, pixel: tuple[float, float] | None = None
) -> Lifted:
    """The object at ``bbox`` (pixels of the raw image) or at ``pixel``, as a cuboid of a class.

    A pixel stands for the smallest detection that contains it. NothingThere if neither points nor the box determine the
    position.
    """
    alignment = resolve(params.alignment, frame.camera)
    if alignment is None:
        raise NothingThere("the camera is not calibrated, so a pixel has no known direction")
    if bbox is None and pixel is not None:
        bbox = _detected_at(frame, pixel)
    points, ground = _points_of(frame, alignment, bbox, pixel)
    if points is not None and ground is not None:
        seen = fit_obstacles(points, np.zeros(len(points), dtype=np.int32), ground, BoxParams(method="l_shape"))[
            0
        ].cuboid
        usual = Cuboid(seen.center, usual_size_m(label), seen.yaw_rad)
        found = onto_points(points, ground, usual)
        return Lifted(found.cuboid, bbox, found.points, f"fitted to the {found.points} points there")
    if bbox is None:
        raise NothingThere("no points and no detection there: draw a box around it")
    law = _by_height(frame, params, alignment, label, bbox)
    if law.distance_m is None or law.sigma_m is None:
        raise NothingThere(f"no points there, and such a box gives no distance for a {label}")
    how = f"no points there: about {law.distance_m:.0f} ± {law.sigma_m:.0f} m judging by its height in the image"
    return Lifted(_at_height(alignment, label, bbox, law, ground), bbox, 0, how)


def _detected_at(frame: Frame, pixel: tuple[float, float]) -> Box | None:
    """The smallest detection around a pixel."""
    if frame.raw_boxes is None:
        return None
    boxes = frame.raw_boxes.boxes
    u, v = pixel
    around = np.flatnonzero((boxes[:, 0] <= u) & (u <= boxes[:, 2]) & (boxes[:, 1] <= v) & (v <= boxes[:, 3]))
    if len(around) == 0:
        return None
    areas = np.prod(boxes[around, 2:] - boxes[around, :2], axis=1)
    x1, y1, x2, y2 = (float(value) for value in boxes[around[int(areas.argmin())]])
    return x1, y1, x2, y2


def _points_of(
    frame: Frame, alignment: Alignment, bbox: Box | None, pixel: tuple[float, float] | None
) -> tuple[F32 | None, Ground | None]:
    """(points of the object, None if there are too few; the ground, None without a sweep)."""
    if frame.sweep is None:
        return None, None
    sweep = frame.sweep.points
    everything = np.ones(len(sweep), dtype=bool)
    ground = fit_ground(sweep, everything, GroundParams())
    labels = cluster(sweep, candidates(sweep, ground, everything, CLUSTERS), CLUSTERS)
    uv = alignment.project(sweep[:, :3].astype(np.float64))
    if bbox is not None:
        inside = np.all((uv >= bbox[:2]) & (uv <= bbox[2:]), axis=1) & (labels >= 0)
    elif pixel is not None and frame.camera is not None:
        near_px = _CLICK_SHARE * frame.camera.width
        inside = (np.hypot(uv[:, 0] - pixel[0], uv[:, 1] - pixel[1]) <= near_px) & (labels >= 0)
    else:
        return None, ground
    best = _cluster_of(labels, inside, whole=bbox is None)
    if best is None:
        return None, ground
    chosen = labels == best if bbox is None else inside & (labels == best)
    return (sweep[chosen], ground) if int(chosen.sum()) >= FEWEST_POINTS else (None, ground)


def _cluster_of(labels: I32, inside: Mask, *, whole: bool) -> int | None:
    """The cluster with the most points inside; those mostly inside have priority, unless a click selects the whole
    cluster that it hit. (Leaving out clusters far from the distance of the box height was tried: it removed more partly
    hidden cars than foreground and background objects.)"""
    if not inside.any():
        return None
    within = np.bincount(labels[inside])
    share = within / np.maximum(np.bincount(labels[labels >= 0], minlength=len(within))[: len(within)], 1)
    own = np.where(whole | (share >= _OWN_SHARE), within, 0)
    return int((own if own.any() else within).argmax())


def _by_height(frame: Frame, params: Params, alignment: Alignment, label: str, bbox: Box) -> VisionMeasurement:
    """The position according to the box height."""
    law = frame.raw_boxes.law if frame.raw_boxes is not None else REAL_VEHICLES
    return measure((Detection(bbox, label, 1.0),), alignment, frame.camera, params.distance, law)[0]


def _at_height(alignment: Alignment, label: str, bbox: Box, found: VisionMeasurement, ground: Ground | None) -> Cuboid:
    """A cuboid of the class's usual size at that position, heading in our direction."""
    assert found.distance_m is not None
    (length, width, height) = usual_size_m(label)
    foot = np.array([[(bbox[0] + bbox[2]) / 2, bbox[3]]])
    x, y, z = (float(value) for value in alignment.unproject(foot, np.array([found.distance_m]))[0])
    road = float(ground.height(np.array([[x, y]]))[0]) if ground is not None else math.nan
    bottom = road if math.isfinite(road) else z
    return Cuboid((x + length / 2, y, bottom + height / 2), (length, width, height), 0.0)
