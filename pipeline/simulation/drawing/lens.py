"""The imperfections of a real camera: lens distortion, blur, varying exposure, noise."""

from __future__ import annotations

import cv2
import numpy as np
from pydantic import Field, model_validator

from pipeline.simulation.world.roads import ScenarioPart
from pipeline.types import F64, U8, CameraCalibration

_EXPOSURE_PERIOD_S = 7.3
_NOISE_ROOM_PX = 64
_WIDEST_TAN = 1.1  # tangent of the angle off the axis to which the lens is modelled; the image's corner is at 0.81


class CameraModel(ScenarioPart):
    """The camera's imperfections; all zero is a perfect pinhole."""

    k1: float = Field(default=-0.08, ge=-0.3, le=0.3)
    """Radial distortion in OpenCV's form: r_d = r·(1 + k1·r² + k2·r⁴)."""
    k2: float = Field(default=0.012, ge=-0.1, le=0.1)
    """The fourth-order term of the same."""
    blur_px: float = Field(default=0.4, ge=0.0, le=8.0)
    """Standard deviation of the blur."""
    noise: float = Field(default=1.5, ge=0.0, le=40.0)
    """Standard deviation in grey levels of 255."""
    exposure_stops: float = Field(default=0.12, ge=0.0, le=3.0)
    """Amplitude of the exposure's variation."""

    @model_validator(mode="after")
    def _sees_its_corners(self) -> CameraModel:
        radius = np.linspace(0.0, _WIDEST_TAN, 200)
        if np.any(1.0 + 3.0 * self.k1 * radius**2 + 5.0 * self.k2 * radius**4 <= 0.1):
            raise ValueError(
                f"k1 = {self.k1:g}, k2 = {self.k2:g}: the lens model folds over at the corners of the image"
            )
        return self


ORDINARY = CameraModel()
"""A decent webcam."""


def distorted(flat: F64, distortion: F64) -> F64:
    """(N, 2) distorted directions from directions x/z, y/z, as in OpenCV; distortion: k1 and k2 first, or empty. Beyond
    the modelled angle the distortion stays constant, so that nothing outside folds back inside."""
    if not distortion.size:
        return flat
    k1, k2 = distortion[:2]
    r2 = np.minimum(np.sum(flat**2, axis=1), _WIDEST_TAN**2)
    return np.asarray(flat * (1.0 + k1 * r2 + k2 * r2**2)[:, None], dtype=np.float64)


def undistorted(flat: F64, distortion: F64) -> F64:
    """The inverse of ``distorted`` within the image. The radial law has no closed-form inverse, so it is tabulated
    and interpolated backwards."""
    if not distortion.size:
        return flat
    ideal = np.linspace(0.0, _WIDEST_TAN, 4000)
    bent = distorted(np.column_stack([ideal, np.zeros(len(ideal))]), distortion)[:, 0]
    radius = np.hypot(flat[:, 0], flat[:, 1])
    return np.asarray(flat * (np.interp(radius, bent, ideal) / np.maximum(radius, 1e-9))[:, None], dtype=np.float64)


class ImageSensor:
    """Blur, exposure and noise of one camera. seed: for the noise and the exposure's phase."""

    def __init__(self, camera: CameraCalibration, model: CameraModel, seed: int) -> None:
        self._model, self._seed = model, seed
        self._grain = _grain(camera, model.noise, seed)

    def expose(self, seen: U8, t_s: float) -> U8:
        """(H, W, 3) uint8 as the camera delivers it at time t, from the ideal image."""
        if self._model.blur_px > 0.0:
            seen = np.asarray(cv2.GaussianBlur(seen, (0, 0), self._model.blur_px), dtype=np.uint8)
        gain = 2.0 ** (self._model.exposure_stops * np.sin(2 * np.pi * t_s / _EXPOSURE_PERIOD_S + self._seed))
        rng = np.random.default_rng([self._seed, 5, round(t_s * 1e6)])
        row, column = rng.integers(0, _NOISE_ROOM_PX, 2)
        grain = self._grain[row : row + seen.shape[0], column : column + seen.shape[1]]
        return np.asarray(cv2.addWeighted(seen, gain, grain, 1.0, -128.0), dtype=np.uint8)


def _grain(camera: CameraCalibration, sigma: float, seed: int) -> U8:
    """Noise around 128, somewhat larger than an image, so that every image gets its own crop."""
    rng = np.random.default_rng([seed, 6])
    shape = (camera.height + _NOISE_ROOM_PX, camera.width + _NOISE_ROOM_PX, 3)
    return np.clip(np.round(128.0 + sigma * rng.standard_normal(shape, dtype=np.float32)), 0, 255).astype(np.uint8)
