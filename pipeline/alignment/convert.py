"""Turns one model of a camera into the best fit of the other, over the part of the world that matters: the road ahead
and what stands on it.

Both directions are linear least-squares problems: an angular model's pixels are linear in 1/h_res and 1/v_res, and a
pinhole camera's without distortion in its focal lengths.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from pipeline.alignment.projection import Alignment, Angular, corrected, resolve
from pipeline.common.errors import BadInput
from pipeline.common.geometry import T_OPTICAL_BODY
from pipeline.params import AlignmentParams
from pipeline.types import F64, CameraCalibration

NEAREST_M, FARTHEST_M = 10.0, 60.0
LOWEST_M, HIGHEST_M = 0.0, 1.5
"""Heights of vehicles above the road."""
BEARINGS_DEG = (0.0, 5.0, 10.0, 20.0, 30.0, 45.0)
"""Edges of the bins by bearing, to either side."""
_EGO_HEIGHT_M = 1.7
"""Height of the ego origin above the road, if a calibration does not say."""
_RANGES, _HEIGHTS, _BEARINGS = 8, 4, 91


class Incomplete(BadInput):
    """An alignment without all of its values; the text names them."""


class Cost(NamedTuple):
    """What a converted model is off by, in a bin of bearings."""

    from_deg: float
    """Lower edge of the bin."""
    to_deg: float
    """Upper edge of the bin."""
    mean_px: float
    """Mean distance in the image."""
    mean_m: float
    """Mean distance in the plan, of a box at its correct range."""


def calibration_in_use(
    params: AlignmentParams, camera: CameraCalibration | None, size: tuple[int, int]
) -> CameraCalibration:
    """The recording's calibration with its correction; with the angular model, the pinhole camera that comes nearest.
    size: width and height of the images. Incomplete if there is neither."""
    if params.model == "pinhole" and camera is not None:
        return corrected(params, camera)
    aligned = resolve(params, camera)
    if isinstance(aligned, Angular):
        return pinhole_of(aligned, *size)
    if params.model == "pinhole":
        raise Incomplete("the recording has no camera calibration")
    raise Incomplete("the angular alignment is incomplete: set h_res_deg, v_res_deg, cx_px and cy_px")


def angular_values(angular: Angular) -> dict[str, float | str]:
    """As alignment parameters."""
    h_res_deg, v_res_deg = np.degrees([angular.h_res_rad, angular.v_res_rad]).tolist()
    return {
        "model": "angular",
        "h_res_deg": round(h_res_deg, 5),
        "v_res_deg": round(v_res_deg, 5),
        "cx_px": round(angular.cx, 1),
        "cy_px": round(angular.cy, 1),
    }


def angular_of(aligned: Alignment, camera: CameraCalibration) -> Angular:
    """The angular model that comes nearest to another model of this camera, in pixels."""
    points, pixels = _in_sight(aligned, camera.width, camera.height, _road_z_m(camera))
    azimuth = np.arctan2(-points[:, 1], points[:, 0])
    elevation = np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1]))
    (per_rad, cx), (down_per_rad, cy) = _line(azimuth, pixels[:, 0]), _line(-elevation, pixels[:, 1])
    return Angular(1.0 / per_rad, 1.0 / down_per_rad, cx, cy)


def pinhole_of(angular: Angular, width: int, height: int) -> CameraCalibration:
    """The pinhole camera at the ego origin, without distortion, that comes nearest to an angular model, in pixels."""
    points, pixels = _in_sight(angular, width, height, -_EGO_HEIGHT_M)
    right, down = -points[:, 1] / points[:, 0], -points[:, 2] / points[:, 0]
    (fx, cx), (fy, cy) = _line(right, pixels[:, 0]), _line(down, pixels[:, 1])
    K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    return CameraCalibration(K, np.zeros(0), T_OPTICAL_BODY, width, height)


def costs(aligned: Alignment, converted: Alignment, width: int, height: int, road_z_m: float | None) -> list[Cost]:
    """What the conversion costs, by bearing; only bins that the image shows."""
    points, pixels = _in_sight(aligned, width, height, -_EGO_HEIGHT_M if road_z_m is None else road_z_m)
    bearing = np.degrees(np.abs(np.arctan2(points[:, 1], points[:, 0])))
    apart_px = np.hypot(*(converted.project(points) - pixels).T)
    range_m = np.hypot(points[:, 0], points[:, 1])
    apart_m = np.hypot(*(converted.unproject(pixels, range_m) - points)[:, :2].T)
    found = []
    for low, high in pairwise(BEARINGS_DEG):
        inside = (bearing >= low) & (bearing < high)
        if inside.any():
            found.append(Cost(low, high, float(apart_px[inside].mean()), float(apart_m[inside].mean())))
    return found


def _in_sight(aligned: Alignment, width: int, height: int, road_z_m: float) -> tuple[F64, F64]:
    """(N, 3) points above the road, evenly over bearings and, in logarithms, over ranges, and their (N, 2) pixels."""
    bearing = np.radians(np.linspace(-BEARINGS_DEG[-1], BEARINGS_DEG[-1], _BEARINGS))
    range_m = np.geomspace(NEAREST_M, FARTHEST_M, _RANGES)
    above_m = np.linspace(LOWEST_M, HIGHEST_M, _HEIGHTS)
    a, r, z = (each.ravel() for each in np.meshgrid(bearing, range_m, above_m + road_z_m, indexing="ij"))
    points = np.column_stack([r * np.cos(a), r * np.sin(a), z])
    pixels = aligned.project(points)
    inside = ((pixels >= 0.0) & (pixels < [width, height])).all(axis=1)  # false for NaN, behind the camera
    return points[inside], pixels[inside]


def _road_z_m(camera: CameraCalibration) -> float:
    return camera.road_z_m if camera.road_z_m is not None else -_EGO_HEIGHT_M


def _line(x: F64, y: F64) -> tuple[float, float]:
    """Slope and intercept of the least-squares line."""
    slope, intercept = np.polyfit(x, y, 1)
    return float(slope), float(intercept)
