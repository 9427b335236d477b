"""The distance of a detected box, from its height alone (paper, Distance Estimation with Regression).

The paper fits d = 1829.1·h^−1.093 to one 720p camera and one car. A box's height is proportional to the object's height
divided by its depth along the optical axis. The same law therefore serves another camera when heights are scaled by the
focal lengths, and another class when they are scaled by the objects' heights; the range follows from the depth and the
bearing. The paper does none of the three (it applies the law to class "car" only, and uses the depth as the range, 22 %
short at 35° off axis); each is a parameter here. The law is the detector's own (``pipeline.types.DistanceLaw``), number
by number unless a parameter overrides it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pipeline.alignment.projection import Alignment, Angular, Pinhole
from pipeline.common.geometry import F64
from pipeline.common.robust import mad_sigma
from pipeline.params import DistanceParams
from pipeline.types import REAL_VEHICLES, Box, CameraCalibration, Detection, DistanceLaw, VisionMeasurement

BIN_M, BIN_LOW_M, BIN_HIGH_M = 10.0, 5.0, 60.0
_BORDER_PX, _BORDER_SHARE = 1.0, 0.02
"""A box is at the image's edge if it is closer to it than this many pixels or this share of its own height, which is
the accuracy of the box sides."""
_NEAREST_M = 0.5
_NOISE_SHARE = 0.03
"""Frame-to-frame noise of a box's height as a share of the height, for any box size. Measured on labelled KITTI cars
within 20 m: 2.9 %."""
_HUBER = 1.345
"""Residuals beyond this many standard deviations get less weight: 95 % efficiency on clean data (Huber 1981, section
4)."""
_ROUNDS = 30
"""Of iteratively reweighted least squares."""


@dataclass(frozen=True)
class PowerLaw:
    """Depth in metres = coefficient · (box height in pixels) ^ exponent."""

    coefficient: float
    """Metres times pixels^-exponent."""
    exponent: float
    """-1 for an ideal pinhole camera."""

    def __call__(self, height_px: float) -> float:
        return self.coefficient * height_px**self.exponent

    def for_taller(self, ratio: float) -> PowerLaw:
        """The law for objects ``ratio`` times as tall: their boxes are that much taller at the same depth."""
        return PowerLaw(self.coefficient * ratio**-self.exponent, self.exponent)


def fit_power_law(heights_px: npt.ArrayLike, distances_m: npt.ArrayLike, exponent: float | None = None) -> PowerLaw:
    """Fit a law to (N,) pairs, by least squares in log-log with Huber weights, which limit the effect of outliers. With
    a fixed ``exponent``, only the coefficient is fitted (−1 is a pinhole camera and needs one pair).

    ValueError for pairs that are not positive and finite, or too few different heights.
    """
    h = np.asarray(heights_px, dtype=np.float64).ravel()
    d = np.asarray(distances_m, dtype=np.float64).ravel()
    if h.shape != d.shape:
        raise ValueError(f"{h.size} heights but {d.size} distances")
    if not (np.isfinite(h).all() and np.isfinite(d).all() and (h > 0).all() and (d > 0).all()):
        raise ValueError("heights and distances must be positive and finite")
    needed = 2 if exponent is None else 1
    if len(np.unique(h)) < needed:
        raise ValueError(f"a law needs at least {needed} different heights, got {len(np.unique(h))}")
    x, y = np.log(h), np.log(d)
    weights = np.ones_like(x)
    intercept, slope = 0.0, 0.0
    for _ in range(_ROUNDS):
        intercept, slope = _weighted_line(x, y, weights, exponent)
        residual = np.abs(y - intercept - slope * x)
        sigma = mad_sigma(residual)
        weights = np.minimum(1.0, _HUBER * sigma / np.maximum(residual, 1e-12)) if sigma > 1e-12 else weights
    return PowerLaw(math.exp(intercept), slope)


def binned(distance_m: float) -> float | None:
    """The paper's binning: the nearest ten metres between 5 and 60 m, None outside ("binning data from 5 meters to 60
    meters with 10 meters incremental process"; the paper does not specify where a bin's value lies)."""
    if not BIN_LOW_M <= distance_m <= BIN_HIGH_M:  # also true for NaN
        return None
    return BIN_M * math.floor(distance_m / BIN_M + 0.5)


def measure(
    detections: tuple[Detection, ...],
    alignment: Alignment | None,
    camera: CameraCalibration | None,
    params: DistanceParams,
    own: DistanceLaw = REAL_VEHICLES,
) -> tuple[VisionMeasurement, ...]:
    """Each detection with its range, uncertainty and position. All three are None if the box gives no distance: no law
    for its class, cut by the image's upper or lower edge (its height is then only a lower bound), or beyond ``max_m``.
    Without an alignment there is no bearing: the depth is used as range, and the position is None. own: the detector's
    law."""
    if not detections:
        return ()
    # A power law of the box height gives the depth; with the bearing, this gives the range
    boxes = np.array([detection.bbox for detection in detections], dtype=np.float64)
    law = law_in_use(params, own)
    depth_m = _depths(detections, boxes, _focal_px(alignment, camera), camera, params, law)
    range_m = depth_m
    if alignment is not None and params.depth_along_axis:
        range_m = range_at_depth(_centres(boxes), depth_m, alignment, camera)
    range_m = np.where(range_m <= params.max_m, range_m, np.nan)
    # Two errors: box height noise changes from image to image; the unknown vehicle height is constant
    height_px = np.maximum(boxes[:, 3] - boxes[:, 1], 1.0)
    pixel_share = np.abs(law.exponent) * params.height_sigma_px / height_px
    noise_share = np.hypot(pixel_share, _NOISE_SHARE)
    sigma_m = range_m * np.hypot(pixel_share, params.size_spread)
    if params.binning:
        range_m = np.array([binned(float(value)) for value in range_m], dtype=np.float64)
    # The position lies at this range along the line of sight through the middle of the box
    place = np.full((len(boxes), 2), np.nan)
    if alignment is not None:
        place = alignment.unproject(_centres(boxes), range_m)[:, :2]
    known = np.isfinite(range_m)
    placed = known & np.isfinite(place).all(axis=1)
    columns = (range_m, sigma_m, place, known, placed, noise_share, _aspects(boxes, camera))
    car = PowerLaw(law.coefficient, law.exponent)
    factors = {name: each.coefficient / car.coefficient for name, each in _by_class(law, params.per_class).items()}
    rows = zip(detections, *(column.tolist() for column in columns), strict=True)
    return tuple(
        VisionMeasurement(
            detection,
            at_m if is_known else None,
            sigma if is_known else None,
            (x, y) if is_placed else None,
            noise if is_known else None,
            params.size_spread if is_known else None,
            aspect=aspect if math.isfinite(aspect) else None,
            class_factors=factors,
        )
        for detection, at_m, sigma, (x, y), is_known, is_placed, noise, aspect in rows
    )


def law_in_use(params: DistanceParams, own: DistanceLaw) -> DistanceLaw:
    """The detector's law at the parameters' focal length; values set as parameters override it."""
    given = {
        "coefficient": params.coefficient,
        "exponent": params.exponent,
        "truck_ratio": params.truck_ratio,
        "bus_ratio": params.bus_ratio,
        "motorcycle_ratio": params.motorcycle_ratio,
    }
    changed = {name: value for name, value in given.items() if value is not None}
    return replace(own.at_focal(params.reference_focal_px), **changed)


def _by_class(law: DistanceLaw, per_class: bool) -> Mapping[str, PowerLaw]:
    """The law of each supported class, for box heights at the law's focal length."""
    car = PowerLaw(law.coefficient, law.exponent)
    if not per_class:
        return {"car": car}
    ratios = {"truck": law.truck_ratio, "bus": law.bus_ratio, "motorcycle": law.motorcycle_ratio}
    return {"car": car} | {label: car.for_taller(ratio) for label, ratio in ratios.items()}


def height_at_reference(box: Box, focal_px: float | None, params: DistanceParams) -> float:
    """A box's height in pixels, converted to the focal length of the law."""
    scale = params.reference_focal_px / focal_px if params.scale_to_camera and focal_px else 1.0
    return (box[3] - box[1]) * scale


def is_cut(box: Box, camera: CameraCalibration | None) -> bool:
    """Whether the image's upper or lower edge cuts the box. The lower edge is known only from the calibration."""
    near_px = max(_BORDER_PX, _BORDER_SHARE * (box[3] - box[1]))
    return box[1] <= near_px or (camera is not None and box[3] >= camera.height - near_px)


def range_at_depth(pixels: F64, depth_m: F64, alignment: Alignment, camera: CameraCalibration | None) -> F64:
    """(N,) horizontal ranges from the ego origin of the points on the rays of (N, 2) pixels that lie ``depth_m`` (N,)
    along the optical axis (along ego x for a camera without calibration). NaN if that point is not ahead.

    Depth is linear along a ray.
    """
    start, rays = alignment.rays(pixels)
    axis = camera.T_camera_ego[2] if camera is not None else np.array([1.0, 0.0, 0.0, 0.0])
    slope = rays @ axis[:3]
    along = (depth_m - start @ axis[:3] - axis[3]) / np.where(slope > 0.0, slope, np.nan)
    point = start[:2] + along[:, None] * rays[:, :2]
    range_m = np.hypot(point[:, 0], point[:, 1])
    return np.where((depth_m > _NEAREST_M) & (along > 0.0) & (range_m > _NEAREST_M), range_m, np.nan)


def _depths(
    detections: tuple[Detection, ...],
    boxes: F64,
    focal_px: float | None,
    camera: CameraCalibration | None,
    params: DistanceParams,
    law_of_cars: DistanceLaw,
) -> F64:
    """(N,) depths in metres by each class's law, NaN if the box gives none."""
    by_class = _by_class(law_of_cars, params.per_class)
    depths = np.full(len(boxes), np.nan)
    for row, detection in enumerate(detections):
        law = by_class.get(detection.label)
        height_px = height_at_reference(detection.bbox, focal_px, params)
        if law is not None and height_px > 0.0 and not is_cut(detection.bbox, camera):
            depths[row] = law(height_px)
    return depths


def _aspects(boxes: F64, camera: CameraCalibration | None) -> F64:
    """(N,) ln(height / width), NaN if the image's edge or a nearer object may hide part of the width. Of two
    overlapping boxes, the one that extends farther down is the nearer object."""
    x1, y1, x2, y2 = boxes.T
    beside = (x1[:, None] < x2) & (x1 < x2[:, None]) & (y1[:, None] < y2) & (y1 < y2[:, None]) & (y2[:, None] < y2)
    cut = x1 <= _BORDER_PX
    if camera is not None:
        cut |= x2 >= camera.width - _BORDER_PX
    aspects = np.log(np.maximum(y2 - y1, 1.0) / np.maximum(x2 - x1, 1.0))
    return np.where(cut | beside.any(axis=1), np.nan, aspects)


def _centres(boxes: F64) -> F64:
    return (boxes[:, :2] + boxes[:, 2:]) / 2


def _focal_px(alignment: Alignment | None, camera: CameraCalibration | None) -> float | None:
    """Vertical focal length in pixels per radian: from the calibration and its correction, else from the parameters of
    the angular model."""
    if isinstance(alignment, Pinhole):
        return float(alignment.K[1, 1])
    if camera is not None:
        return float(camera.K[1, 1])
    return 1.0 / alignment.v_res_rad if isinstance(alignment, Angular) else None


def _weighted_line(x: F64, y: F64, weights: F64, slope: float | None) -> tuple[float, float]:
    """Intercept and slope of the weighted least-squares line; a given slope is fixed."""
    mean_x, mean_y = float(np.average(x, weights=weights)), float(np.average(y, weights=weights))
    if slope is None:
        slope = float(np.sum(weights * (x - mean_x) * (y - mean_y)) / np.sum(weights * (x - mean_x) ** 2))
    return mean_y - slope * mean_x, slope
