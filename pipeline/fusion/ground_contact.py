"""The distance of a vehicle by where its box meets the road.

A distance from the height of a box is only as good as the assumed height of the vehicle: a van that is classified as a
car is placed a third too near. The lower edge of the box needs no such assumption. It is where the tyres touch the
road, whose height the LiDAR measures (Stein, Mano, Shashua, IV 2003, on a flat road). The pitch of the car does not
matter, because both sensors pitch with it. The remaining errors are the shape of the road beyond its last return
(``pipeline.lidar.road_profile``) and the noise of the edge.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.alignment.projection import Alignment
from pipeline.common.fast_replace import evolve
from pipeline.common.geometry import F64
from pipeline.fusion.boxes_in_front import EDGE_PX, nearer
from pipeline.lidar.road_profile import ASIDE_M, RoadProfile, fit_road_profile
from pipeline.params import FusionParams
from pipeline.types import F32, VEHICLES, Ground, Mask, VisionMeasurement

NEAREST_M = 10.0
"""Minimum distance by the box's height. Nearer, the lower edge is as often a shadow as a tyre
(``pipeline.vision.vehicle_height``)."""
_FLOOR_SHARE = 0.07
"""Standard deviation of the edge, as a share of the box's height, because it is drawn at the axle, the bumper or the
shadow. A car is about as tall as the camera is high, so its distance is off by the same share; that of a lorry by twice
as much. With this value, one sigma covers 76 and 79 % of the errors, and two sigmas 94 %, of labelled vehicles on Astyx
and KITTI 0009 at 20–30 m, where the road is known; beyond that, 86 and 94 % or more."""
_PITCH_SIGMA_RAD = np.radians(0.15)
"""Standard deviation of the alignment between the sensors. A fit to traffic determines its pitch to within so much from
nine of ten starts (docs/reference/accuracy.md); a calibration target is more accurate."""
_HIDDEN_SHARE = 0.3
"""Covered share of a box's lower edge above which the network draws it where the nearer vehicle begins."""
_WORTHLESS_SHARE = 0.35
"""Above this relative sigma, a contact says less than the vehicle's class does."""


class _Contacts(NamedTuple):
    """Where the lower edges of (M,) boxes meet the road."""

    range_m: F64
    """Horizontal range from the ego origin; NaN if the line of sight does not meet the known strip of road."""
    share: F64
    """Standard deviation of ln(range) due to errors that persist from image to image."""
    noise_share: F64
    """Standard deviation of ln(range) due to the noise of the edge."""


def road_ahead(
    points: F32,
    ground: Ground | None,
    boxes: tuple[VisionMeasurement, ...] | None,
    alignment: Alignment | None,
    speed_mps: float | None = None,
) -> RoadProfile | None:
    """The road in a sweep, as far as no vehicle in the image covers it; None without a sweep or boxes.

    Over a crest, the road falls away, and a ring on the rear of a far car lies where the flat road would be: to the
    LiDAR alone it is road. points: (N, 4) float32 ``x y z intensity``, ego frame.
    """
    if ground is None or not boxes:
        return None
    mask = ground.mask
    bbox = np.array([each.detection.bbox for each in boxes if each.detection.label in VEHICLES])
    rows = np.flatnonzero(mask & (points[:, 0] > NEAREST_M) & (np.abs(points[:, 1]) < ASIDE_M))
    if alignment is not None and len(bbox) and len(rows):
        u, v = alignment.project(points[rows, :3].astype(np.float64)).T[:, :, None]
        x1, y1, x2, y2 = bbox.T
        with np.errstate(invalid="ignore"):
            covered = ((u > x1) & (u < x2) & (v > y1) & (v < y2 - EDGE_PX)).any(axis=1)
        mask = mask.copy()
        mask[rows[covered]] = False
    return fit_road_profile(points, mask, speed_mps)


def measure_contacts(
    boxes: tuple[VisionMeasurement, ...] | None,
    road: RoadProfile | None,
    alignment: Alignment | None,
    params: FusionParams,
) -> tuple[VisionMeasurement, ...] | None:
    """The boxes, with ``contact_m`` and its standard deviations for vehicles whose lower edge is visible. road: None
    while unknown; then there are no contacts."""
    if not params.use_ground_contact or not boxes or alignment is None or not alignment.is_metric:
        return boxes
    asked = [each.detection.label in VEHICLES and (each.distance_m or 0.0) >= NEAREST_M for each in boxes]
    if not any(asked) or road is None:
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
    covered = (np.minimum(x2, x2.T) - np.maximum(x1, x1.T)) / np.maximum(x2 - x1, 1.0)
    hidden: Mask = (nearer(bbox) & (y2 > y1.T) & (covered > _HIDDEN_SHARE)).any(axis=1)
    return hidden


def _contacts(bbox: F64, alignment: Alignment, road: RoadProfile) -> _Contacts:
    """Where the lower edges of boxes (M, 4) meet the road."""
    middle, upper, lower = (bbox[:, 0] + bbox[:, 2]) / 2.0, bbox[:, 1], bbox[:, 3]
    edges = np.concatenate([lower, lower - EDGE_PX, lower + EDGE_PX])
    meets = _meets(np.column_stack([np.tile(middle, 3), edges]), alignment, road)
    (x, _, _), (range_m, far_m, near_m), (closing, _, _) = (each.reshape(3, -1) for each in meets)
    tall_rad = _elevation(alignment, middle, upper) - _elevation(alignment, middle, lower)
    with np.errstate(invalid="ignore", divide="ignore"):
        by_edge = np.log(far_m / near_m) / 2.0
        by_road = road.height_sigma_m(x) / closing / range_m
        by_pitch = _PITCH_SIGMA_RAD / closing
        by_floor = _FLOOR_SHARE * np.maximum(tall_rad / closing, 1.0)
    return _Contacts(range_m, np.sqrt(by_road**2 + by_pitch**2 + by_floor**2), by_edge)


def _elevation(alignment: Alignment, u: F64, v: F64) -> F64:
    """(M,) slope of the lines of sight of pixels u, v (M,): rise per horizontal metre."""
    _, rays = alignment.rays(np.column_stack([u, v]))
    slope: F64 = rays[:, 2] / np.hypot(rays[:, 0], rays[:, 1])
    return slope


def _meets(pixels: F64, alignment: Alignment, road: RoadProfile) -> tuple[F64, F64, F64]:
    """(M,) ego x and range of the points where the lines of sight of pixels (M, 2) meet the road, and by how much they
    approach it per metre there; NaN where they do not meet."""
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
