"""Projection of ego points into the image, and back: the paper's ``angular`` model, and ``pinhole``.

Both have the same interface, so every stage and view works with either:

``project``    (N, 3) ego points → (N, 2) pixels u, v; NaN for points that the camera cannot see (behind it).
``unproject``  (N, 2) pixels and (N,) horizontal ranges from the ego origin → (N, 3) ego points.
``rays``       (N, 2) pixels → the (3,) place they are seen from, and (N, 3) directions, not normalised.

Paper: section "The Alignment Method of the Camera and LiDAR point cloud" and "Transform the Image pixel to the BEV".
The printed inverse y = x_img·tan(x_img·h_res) has the wrong dimension; from the forward equation
y = −d·sin(x_img·h_res). The printed arctan(−y/x) is an atan2 here, and the pixel origin is explicit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar, Protocol

import cv2
import numpy as np

from pipeline.alignment.lens import through_lens
from pipeline.common.geometry import F64, inverse, origin, rotation
from pipeline.params import AlignmentParams
from pipeline.types import Box, CameraCalibration

_FAR_ASIDE = 0.01
_FAR_AHEAD = 1000.0 * np.array([[1.0, _FAR_ASIDE, 0.0], [1.0, -_FAR_ASIDE, 0.0]])
"""Two points straight ahead, this much to either side (as a tangent)."""


class Alignment(Protocol):
    """Interface of both models."""

    def project(self, points: F64) -> F64:
        """(N, 3) ego points → (N, 2) pixels u, v; NaN for points that the camera cannot see."""
        ...

    def unproject(self, pixels: F64, range_m: F64) -> F64:
        """(N, 2) pixels and (N,) horizontal ranges from the ego origin, metres → (N, 3) ego points."""
        ...

    is_metric: ClassVar[bool]
    """Whether its rays start at the camera's position, so that they hit objects where the camera sees them."""

    def rays(self, pixels: F64) -> tuple[F64, F64]:
        """(N, 2) pixels → (3,) ego point where the rays start, and (N, 3) directions, not normalised."""
        ...


@dataclass(frozen=True)
class Angular:
    """Pixels proportional to angles (paper, Eq. alignment). Exact only for an equirectangular image taken at the ego
    origin."""

    h_res_rad: float
    """Radians per pixel, horizontally."""
    v_res_rad: float
    """Radians per pixel, vertically."""
    cx: float
    """Column of the pixel in the direction of ego +x."""
    cy: float
    """Row of that pixel."""
    is_metric: ClassVar[bool] = False

    def project(self, points: F64) -> F64:
        points = np.asarray(points, dtype=np.float64).reshape(-1, 3)
        x, y, z = points.T
        azimuth = np.arctan2(-y, x)
        u = self.cx + azimuth / self.h_res_rad
        v = self.cy - np.arctan2(z, np.hypot(x, y)) / self.v_res_rad
        behind = np.abs(azimuth) >= np.pi / 2
        return np.where(behind[:, None], np.nan, np.column_stack([u, v]))

    def unproject(self, pixels: F64, range_m: F64) -> F64:
        pixels = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
        azimuth = (pixels[:, 0] - self.cx) * self.h_res_rad
        elevation = (self.cy - pixels[:, 1]) * self.v_res_rad
        return np.column_stack([range_m * np.cos(azimuth), -range_m * np.sin(azimuth), range_m * np.tan(elevation)])

    def rays(self, pixels: F64) -> tuple[F64, F64]:
        return np.zeros(3), self.unproject(pixels, np.ones(len(pixels)))


@dataclass(frozen=True)
class Pinhole:
    """A calibrated camera, including the parallax between the two mounts."""

    K: F64
    """(3, 3) intrinsics, pixels."""
    distortion: F64
    """OpenCV's coefficients; empty without distortion."""
    T_camera_ego: F64
    """(4, 4), takes ego points to the camera frame."""

    is_metric: ClassVar[bool] = True
    _NEAREST_M = 0.3

    def project(self, points: F64) -> F64:
        rows = np.asarray(points, dtype=np.float64).reshape(-1, 3)
        return through_lens(rows, self.T_camera_ego, self.K, self.distortion, self._NEAREST_M)

    def unproject(self, pixels: F64, range_m: F64) -> F64:
        """The point on the pixel's ray whose horizontal range from the ego origin is ``range_m``."""
        start, ray = self.rays(pixels)
        # |start_xy + t ray_xy| = range: the larger root is the one ahead of the camera
        a = np.sum(ray[:, :2] ** 2, axis=1)
        b = ray[:, :2] @ start[:2]
        c = float(start[:2] @ start[:2]) - np.asarray(range_m, dtype=np.float64) ** 2
        t = (-b + np.sqrt(np.maximum(b * b - a * c, 0.0))) / a
        return start + t[:, None] * ray

    def rays(self, pixels: F64) -> tuple[F64, F64]:
        pixels = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
        if self.distortion.size and len(pixels):
            flat = cv2.undistortPoints(pixels.reshape(-1, 1, 2), self.K, self.distortion).reshape(-1, 2)
        else:
            flat = (pixels - self.K[:2, 2]) / [self.K[0, 0], self.K[1, 1]]
        rotation, offset = self.T_camera_ego[:3, :3], self.T_camera_ego[:3, 3]
        return -offset @ rotation, flat @ rotation[:2] + rotation[2]


def pixels_per_radian(alignment: Alignment) -> float | None:
    """How far a distant object straight ahead moves to the right in the image, per radian that the car turns to the
    left; None if the camera does not look ahead."""
    (left, _), (right, _) = alignment.project(_FAR_AHEAD).tolist()
    shift = float(right - left) / (2.0 * _FAR_ASIDE)
    return shift if math.isfinite(shift) else None


def angular_from_calibration(camera: CameraCalibration) -> Angular:
    """The angular model that matches a calibrated camera at its centre: fx and fy pixels per radian, and the origin in
    the direction of ego +x (at infinity, since the model has no mounting position)."""
    forward = camera.T_camera_ego[:3, :3] @ np.array([1.0, 0.0, 0.0])
    u, v = (camera.K @ (forward / forward[2]))[:2]
    return Angular(1.0 / camera.K[0, 0], 1.0 / camera.K[1, 1], float(u), float(v))


def resolve(params: AlignmentParams, camera: CameraCalibration | None) -> Alignment | None:
    """The model to use: parameters if set, the recording's calibration for the rest. None if neither is known; then
    nothing can be projected. Pinhole needs a calibration; angular does not, if all four values are set.

    The last model is kept, because both arguments stay the same objects from frame to frame."""
    global _last
    last = _last
    if last is None or last[0] is not params or last[1] is not camera:
        last = _last = (params, camera, _resolved(params, camera))
    return last[2]


_last: tuple[AlignmentParams, CameraCalibration | None, Alignment | None] | None = None


def _resolved(params: AlignmentParams, camera: CameraCalibration | None) -> Alignment | None:
    if params.model == "pinhole" and camera is not None:
        return pinhole(params, camera)
    measured = angular_from_calibration(camera) if camera is not None else None
    typed = (params.h_res_deg, params.v_res_deg, params.cx_px, params.cy_px)
    if measured is None and any(value is None for value in typed):
        return None
    base = (
        (np.degrees(measured.h_res_rad), np.degrees(measured.v_res_rad), measured.cx, measured.cy)
        if measured is not None
        else typed
    )
    h_deg, v_deg, cx, cy = (b if t is None else t for t, b in zip(typed, base, strict=True))
    return Angular(float(np.radians(h_deg)), float(np.radians(v_deg)), float(cx), float(cy))


class Correction(Protocol):
    """The parameters that correct a calibration; see ``AlignmentParams``."""

    @property
    def roll_deg(self) -> float: ...
    @property
    def pitch_deg(self) -> float: ...
    @property
    def yaw_deg(self) -> float: ...
    @property
    def forward_m(self) -> float: ...
    @property
    def left_m(self) -> float: ...
    @property
    def up_m(self) -> float: ...
    @property
    def zoom(self) -> float: ...


def pinhole(correction: Correction, camera: CameraCalibration) -> Pinhole:
    """The camera as ``corrected`` describes it, without a calibration in between: a fit tries thousands."""
    return Pinhole(_intrinsics(correction, camera), camera.distortion, _mount(correction, camera))


def corrected(correction: Correction, camera: CameraCalibration) -> CameraCalibration:
    """The calibration with the parameters' correction of its mount and focal length."""
    return replace(camera, K=_intrinsics(correction, camera), T_camera_ego=_mount(correction, camera))


def _intrinsics(correction: Correction, camera: CameraCalibration) -> F64:
    """(3, 3) intrinsics with the corrected focal length, pixels."""
    if correction.zoom == 1.0:
        return camera.K
    K = camera.K.copy()
    K[:2, :2] *= correction.zoom
    return K


def _mount(correction: Correction, camera: CameraCalibration) -> F64:
    """(4, 4) from the ego frame to the camera: its rotation in its mount is corrected, in ego axes, about its position,
    and the position is then shifted."""
    angles = np.radians((correction.roll_deg, correction.pitch_deg, correction.yaw_deg)).tolist()
    turn, place = rotation(*angles), origin(camera.T_camera_ego)
    change = np.eye(4)
    change[:3, :3] = turn
    change[:3, 3] = place - turn @ place + [correction.forward_m, correction.left_m, correction.up_m]
    return np.asarray(camera.T_camera_ego @ inverse(change))


def project_cuboids(alignment: Alignment, corners: F64, width: int, height: int) -> list[Box | None]:
    """Image boxes around the (M, 8, 3) corners of cuboids, clipped to the image; None for a cuboid outside it.

    Paper: "the cuboid of the bounding box … is projected onto the image". All at once, because a sweep has dozens.
    """
    uv = alignment.project(corners.reshape(-1, 3)).reshape(-1, 8, 2)
    behind = np.isnan(uv)
    enough = np.sum(~behind[..., 0], axis=1) >= 4
    low = np.clip(np.where(behind, np.inf, uv).min(axis=1), 0.0, [width, height])
    high = np.clip(np.where(behind, -np.inf, uv).max(axis=1), 0.0, [width, height])
    inside = enough & np.all(high > low, axis=1)
    boxes = np.hstack([low, high]).tolist()
    return [(x1, y1, x2, y2) if ok else None for ok, (x1, y1, x2, y2) in zip(inside, boxes, strict=True)]


def project_cuboid(alignment: Alignment, corners: F64, width: int, height: int) -> Box | None:
    """The image box around one cuboid's (8, 3) corners; see ``project_cuboids``."""
    return project_cuboids(alignment, corners[None], width, height)[0]
