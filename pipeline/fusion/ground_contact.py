"""The distance of a vehicle by where its box meets the road.

The height of a box gives a distance only as well as the vehicle's own height is known, and a van that is called a car
is placed a third too near. The lower edge of the box needs no height: it is where the tyres touch the road, whose
height the LiDAR measures (Stein, Mano, Shashua, IV 2003, from a flat road). The camera's pitch does not matter, because
both sensors pitch together. What remains is the road's shape beyond its last return (``pipeline.lidar.road_profile``)
and some pixels of the edge.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from pipeline.alignment.projection import Alignment
from pipeline.common.fast_replace import evolve
from pipeline.common.geometry import F64, iou_matrix
from pipeline.lidar.road_profile import ASIDE_M, RoadProfile, fit_road_profile
from pipeline.params import FusionParams
from pipeline.types import F32, VEHICLES, Ground, Mask, VisionMeasurement

NEAREST_M = 10.0
"""By the box's height. Nearer, the edge is a shadow as often as a tyre (``pipeline.vision.vehicle_height``)."""
_EDGE_PX = 2.0
"""Noise of a box's lower edge."""
_FLOOR_SHARE = 0.07
"""What else is wrong, as a share: the edge is drawn under the axle, the bumper or the shadow. With it, one sigma holds
76 and 79 % of the errors and two hold 94 % on labelled vehicles of Astyx and KITTI 0009 at 20–30 m, where the road is
known; beyond that 86 and 94 % or more."""
_PITCH_SIGMA_RAD = np.radians(0.15)
"""Of the alignment between the sensors: a fit to traffic finds its pitch to 0.13–0.36° in the median, a target to less
(docs/reference/accuracy.md)."""
_HIDDEN_SHARE = 0.3
"""Of a box's lower edge: with more of it covered, the network draws it where the nearer vehicle begins."""
_SAME_IOU = 0.5
_WORTHLESS_SHARE = 0.35
"""A sigma beyond this says less than the class."""


class SweptRoad(Protocol):
    """A segmented sweep, as far as its road matters."""

    @property
    def points(self) -> F32:
        """(N, 4) float32 ``x y z intensity``, ego frame."""
        ...

    @property
    def ground(self) -> Ground | None:
        """The road; None without a sweep."""
        ...


class _Contacts(NamedTuple):
    """Of (M,) boxes."""

    range_m: F64
    """Horizontal, from the ego origin; NaN where the line of sight does not meet the road, or beside the strip that
    is known."""
    share: F64
    """Standard deviation of ln(range) for what lasts from image to image."""
    noise_share: F64
    """The same for the noise of the edge."""


def measure_contacts(
    boxes: tuple[VisionMeasurement, ...] | None,
    sweep: SweptRoad,
    alignment: Alignment | None,
    speed_mps: float | None,
    params: FusionParams,
) -> tuple[VisionMeasurement, ...] | None:
    """The boxes, those of vehicles whose lower edge is in sight with ``contact_m`` and its deviations. speed_mps:
    own speed; None while unknown."""
    if not params.use_ground_contact or not boxes or alignment is None or not alignment.is_metric:
        return boxes
    asked = [each.detection.label in VEHICLES and (each.distance_m or 0.0) >= NEAREST_M for each in boxes]
    if not any(asked) or sweep.ground is None:
        return boxes
    road = fit_road_profile(sweep.points, sweep.ground.mask, speed_mps)
    if road is None:
        return boxes
    bbox = np.array([each.detection.bbox for each in boxes])
    found = _contacts(bbox, alignment, road)
    usable = (
        np.array(asked)
        & np.logical_not(_hidden_below(bbox))
        & (np.hypot(found.share, found.noise_share) < _WORTHLESS_SHARE)
    )
    columns = (column.tolist() for column in (usable, *found))
    return tuple(
        evolve(each, contact_m=range_m, contact_share=share, contact_noise_share=noise) if is_usable else each
        for each, is_usable, range_m, share, noise in zip(boxes, *columns, strict=True)
    )


def _hidden_below(bbox: F64) -> Mask:
    """(M,) whether a nearer box covers much of the lower edge of a box (M, 4). Two boxes on one vehicle do not."""
    x1, y1, x2, y2 = bbox.T[:, :, None]
    covered = (np.minimum(x2, x2.T) - np.maximum(x1, x1.T)) / (x2 - x1)
    is_nearer = (y2 + _EDGE_PX < y2.T) & (y2 > y1.T) & (iou_matrix(bbox, bbox) < _SAME_IOU)
    hidden: Mask = (is_nearer & (covered > _HIDDEN_SHARE)).any(axis=1)
    return hidden


def _contacts(bbox: F64, alignment: Alignment, road: RoadProfile) -> _Contacts:
    """Where the lower edges of boxes (M, 4) meet the road."""
    middle, lower = (bbox[:, 0] + bbox[:, 2]) / 2.0, bbox[:, 3]
    meets = [_meets(np.column_stack([middle, lower + off]), alignment, road) for off in (0.0, -_EDGE_PX, _EDGE_PX)]
    (x, range_m, closing), (_, far_m, _), (_, near_m, _) = meets
    with np.errstate(invalid="ignore"):
        by_edge = np.log(far_m / near_m) / 2.0
        by_road = road.height_sigma_m(x) / closing / range_m
    by_pitch = _PITCH_SIGMA_RAD / closing
    return _Contacts(range_m, np.sqrt(by_road**2 + by_pitch**2 + _FLOOR_SHARE**2), by_edge)


def _meets(pixels: F64, alignment: Alignment, road: RoadProfile) -> tuple[F64, F64, F64]:
    """(M,) ego x, range, and by how much line of sight and road close in per metre, where those of pixels (M, 2) meet;
    NaN where they do not."""
    eye, rays = alignment.rays(pixels)
    along = rays / np.hypot(rays[:, 0], rays[:, 1])[:, None]
    height, slope, curvature, cross = road.mean
    # road minus line of sight, over the horizontal way t: a t² + b t + c
    a = curvature * along[:, 0] ** 2 / 2.0
    b = slope * along[:, 0] + curvature * eye[0] * along[:, 0] + cross * along[:, 1] - along[:, 2]
    c = height + slope * eye[0] + curvature * eye[0] ** 2 / 2.0 + cross * eye[1] - eye[2]
    with np.errstate(invalid="ignore", divide="ignore"):
        closing = np.sqrt(b * b - 4.0 * a * c)
        t = -2.0 * c / (b + closing)
        t = np.where((t > 0.0) & (c < 0.0), t, np.nan)
    place = eye[:2] + along[:, :2] * t[:, None]
    place[np.abs(place[:, 1]) > ASIDE_M] = np.nan
    return place[:, 0], np.hypot(place[:, 0], place[:, 1]), closing
