"""Lines of KITTI's label files (devkit_object/readme.txt, devkit_tracking/readme.txt).

``type truncated occluded alpha x1 y1 x2 y2 height width length x y z rotation_y``; tracking files put the frame and the
track in front. Images there are rectified: boxes of a distorted lens are moved to where an undistorted one would see
them. Unknown values are −1, −1000 for positions and −10 for angles, as in ``DontCare`` lines.
"""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.common.errors import BadInput
from pipeline.common.geometry import inverse
from pipeline.formats.kitti_records import (
    DONT_CARE,
    NO_BOX,
    NO_CUBOID,
    LabelRow,
    cuboid_to_label,
    kind_of,
    label_name,
    parse_row,
)
from pipeline.labels.model import Sighting
from pipeline.types import F64, Box, CameraCalibration
from pipeline.types.source import SourceError

_UNKNOWN = 3
"""Occlusion value for unknown."""
_ENOUGH = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12)


def is_kept(label: str) -> bool:
    """Whether a class is preserved when written and read."""
    return label_name(kind_of(label)) == label


def to_line(label: str, sighting: Sighting, T_rect_ego: F64, camera: CameraCalibration) -> str:
    """One line without frame and track. An object seen only in the image becomes a ``DontCare`` region: training code
    would interpret an object without a position as one at −1000 m."""
    place = cuboid_to_label(sighting.cuboid, T_rect_ego) if sighting.cuboid is not None else NO_CUBOID
    box = straightened(sighting.bbox, camera) if sighting.bbox is not None else NO_BOX
    alpha = _wrapped(place[6] - math.atan2(place[3], place[5])) if sighting.cuboid is not None else -10.0
    numbers = " ".join(f"{value + 0.0:.6f}" for value in (alpha, *box, *place))
    if sighting.cuboid is None:
        return f"{DONT_CARE} -1 -1 {numbers}"
    cut = "-1" if sighting.truncation is None else f"{sighting.truncation:.2f}"
    hidden = _UNKNOWN if sighting.occlusion is None else sighting.occlusion
    return f"{kind_of(label)} {cut} {hidden} {numbers}"


def from_fields(fields: list[str], T_rect_ego: F64, camera: CameraCalibration | None, what: str) -> LabelRow:
    """Parse one line split into fields, with its box in the raw image. BadInput, beginning with ``what``, if it is
    invalid."""
    try:
        row = parse_row(fields, inverse(T_rect_ego))
    except SourceError as error:
        raise BadInput(f"{what}: {error}") from None
    return row._replace(bbox=bent(row.bbox, camera)) if row.bbox is not None else row


def straightened(box: Box, camera: CameraCalibration) -> Box:
    """A box in the raw image, with its two corners converted to the undistorted image (same K)."""
    if not camera.distortion.size:
        return box
    corners = np.array(box, dtype=np.float64).reshape(-1, 1, 2)
    return _as_box(cv2.undistortImagePoints(corners, camera.K, camera.distortion, None, _ENOUGH))


def bent(box: Box, camera: CameraCalibration | None) -> Box:
    """The inverse of ``straightened``."""
    if camera is None or not camera.distortion.size:
        return box
    flat = (np.array(box).reshape(-1, 2) - camera.K[:2, 2]) / [camera.K[0, 0], camera.K[1, 1]]
    rays = np.column_stack([flat, np.ones(2)])
    return _as_box(cv2.projectPoints(rays, np.zeros(3), np.zeros(3), camera.K, camera.distortion)[0])


def _as_box(corners: npt.NDArray[Any]) -> Box:
    x1, y1, x2, y2 = (float(value) for value in corners.ravel())
    return x1, y1, x2, y2


def _wrapped(angle_rad: float) -> float:
    return math.remainder(angle_rad, math.tau)
