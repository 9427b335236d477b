"""The filter of a box's centre in the image: constant velocity, in pixels, with the noise of detectors' boxes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.common import kalman
from pipeline.common.geometry import F64
from pipeline.common.kalman import CvState
from pipeline.params import VisionTrackingParams
from pipeline.types import Box

SPEED_SIGMA_MPS = 8.0
"""Standard deviation of a new object's relative speed before a second sighting."""
CAR_WIDTH_M = 1.8
"""Converts box widths to metres, so that process noise in the image corresponds to that on the road."""
_CENTRE_NOISE = 0.04
"""Noise of a box's centre, as a share of the box width."""
_EDGE_PX = 2.0
"""Minimum noise of a box's edges."""
_TURN_PXPS2 = 150.0
"""Angular acceleration of the image when the car starts to turn: 0.2 rad/s² through a lens of 720 px."""
_MEASURED_TURN_PXPS2, _ASIDE_MPS2 = 40.0, 1.5
"""Where the yaw rate is measured, boxes are predicted with it, and what remains is its error, 0.3 °/s from image to
image, and the lateral acceleration of vehicles that change lanes quickly."""


def start(box: Box, pan_pxps: float, params: VisionTrackingParams) -> CvState:
    """The filter of a new box, which moves with the image (``pan_pxps`` to the right) if it moves at all."""
    begun = kalman.start(centre(box), centre_variance(box, params) * np.eye(2), _speed_sigma_pxps(box))
    begun.mean[2] = pan_pxps
    return begun


def predict(
    filters: Sequence[CvState],
    boxes: Sequence[Box],
    dt_s: float,
    pan_change_pxps: float | None,
    params: VisionTrackingParams,
) -> list[CvState]:
    """All filters, with their last boxes, ``dt_s`` later. pan_change_pxps: by how much the image moves faster to the
    right than at the last tick, because the car turns more; None if not known."""
    per_m = [width(box) / CAR_WIDTH_M for box in boxes]
    if pan_change_pxps is None:
        lively = [params.accel_sigma_mps2 * each + _TURN_PXPS2 for each in per_m]
    else:
        lively = [math.hypot(_ASIDE_MPS2 * each, _MEASURED_TURN_PXPS2) for each in per_m]
    moved = kalman.predict(kalman.stacked(filters), dt_s, lively)
    if pan_change_pxps is not None:
        moved.mean[..., 0] += 0.5 * pan_change_pxps * dt_s
        moved.mean[..., 2] += pan_change_pxps
    return kalman.unstacked(moved)


def update(
    filters: Sequence[CvState], boxes: Sequence[Box], expected: Sequence[Box], params: VisionTrackingParams
) -> list[CvState]:
    """The filters, updated together by one box each. expected: the predicted boxes."""
    noise = [_noise(box, params, predicted) for box, predicted in zip(boxes, expected, strict=True)]
    after = kalman.update(kalman.stacked(filters), [centre(box) for box in boxes], np.array(noise).reshape(-1, 2, 2))
    return kalman.unstacked(after)


def centre_variance(box: Box, params: VisionTrackingParams) -> float:
    """Variance of a box's centre along each axis of the image, as far as its width tells."""
    return float(max(_CENTRE_NOISE * width(box), _EDGE_PX) ** 2 + params.shift_px**2)


def slip_px(box: Box, expected: Box, axis: int) -> float:
    """How far the centre may be off because the box covers only a part of the object, or more than the object: one edge
    is then correct, and the centre is off by half the difference in size (axis 0: width, 1: height)."""
    return abs((box[axis + 2] - box[axis]) - (expected[axis + 2] - expected[axis])) / 2


def around(middle: F64, box: Box, scale: float) -> Box:
    """A box of the size of ``box``, times ``scale``, around another centre (u, v)."""
    half_w, half_h = width(box) / 2 * scale, (box[3] - box[1]) / 2 * scale
    u, v = float(middle[0]), float(middle[1])
    return u - half_w, v - half_h, u + half_w, v + half_h


def centre(box: Box) -> tuple[float, float]:
    """u, v of a box's middle."""
    return (box[0] + box[2]) / 2, (box[1] + box[3]) / 2


def width(box: Box) -> float:
    """Width of a box, pixels."""
    return box[2] - box[0]


def _noise(box: Box, params: VisionTrackingParams, expected: Box) -> tuple[tuple[float, float], ...]:
    """Covariance (2, 2) of a box's centre, including the deviation of its size from the expected size."""
    variance = centre_variance(box, params)
    across, down = (variance + slip_px(box, expected, axis) ** 2 for axis in (0, 1))
    return (across, 0.0), (0.0, down)


def _speed_sigma_pxps(box: Box) -> float:
    return SPEED_SIGMA_MPS * width(box) / CAR_WIDTH_M
