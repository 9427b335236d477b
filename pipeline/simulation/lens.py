"""What a real camera does to an ideal pinhole picture: lens distortion, blur, exposure that wanders, noise.

The ideal picture is drawn a little larger than the camera's own: a barrel-shaped lens gathers what lies beyond it.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from pydantic import Field, model_validator

from pipeline.simulation.roads import Strict
from pipeline.types import F64, U8, CameraCalibration

_EXPOSURE_PERIOD_S = 7.3
_NOISE_ROOM_PX = 64
_WIDEST_TAN = 1.1  # tangent of the angle off the axis to which the lens is modelled; the picture's corner is at 0.81


class CameraModel(Strict):
    """How far from ideal the camera is; all zero is a perfect pinhole.

    k1, k2: radial distortion as OpenCV has it, r_d = r·(1 + k1·r² + k2·r⁴). blur_px: standard deviation of the blur.
    noise: standard deviation in grey levels of 255. exposure_stops: how far the exposure wanders to either side."""

    k1: float = Field(default=-0.08, ge=-0.3, le=0.3)
    k2: float = Field(default=0.012, ge=-0.1, le=0.1)
    blur_px: float = Field(default=0.4, ge=0.0, le=8.0)
    noise: float = Field(default=1.5, ge=0.0, le=40.0)
    exposure_stops: float = Field(default=0.12, ge=0.0, le=3.0)

    @model_validator(mode="after")
    def _sees_its_corners(self) -> CameraModel:
        radius = np.linspace(0.0, _WIDEST_TAN, 200)
        if np.any(1.0 + 3.0 * self.k1 * radius**2 + 5.0 * self.k2 * radius**4 <= 0.1):
            raise ValueError(f"k1 = {self.k1:g}, k2 = {self.k2:g}: this lens folds the picture's corners over")
        return self


ORDINARY = CameraModel()
"""A decent webcam."""


class Lens:
    """Turns ideal pictures of ``drawn`` into the camera's own. seed: of the noise and of the exposure's phase."""

    def __init__(self, camera: CameraCalibration, model: CameraModel, seed: int) -> None:
        self._model, self._seed = model, seed
        ideal = _undistorted(camera, model)
        corner = np.array([camera.width - 1.0, camera.height - 1.0])
        beyond = max(0.0, float(np.max(-ideal.min(axis=(0, 1)))), float(np.max(ideal.max(axis=(0, 1)) - corner)))
        rim = int(np.ceil(beyond))
        shift = np.array([[0.0, 0.0, rim], [0.0, 0.0, rim], [0.0, 0.0, 0.0]])
        self.drawn = replace(
            camera,
            K=camera.K + shift,
            distortion=np.empty(0),
            width=camera.width + 2 * rim,
            height=camera.height + 2 * rim,
        )
        at = (ideal + rim).astype(np.float32)
        self._maps = cv2.convertMaps(at[..., 0], at[..., 1], cv2.CV_16SC2) if model.k1 or model.k2 else None
        self._grain = _grain(camera, model.noise, seed)

    def picture(self, ideal: U8, t_s: float) -> U8:
        """(H, W, 3) uint8 as the camera gives it at time t, from the ideal picture of ``drawn``."""
        seen = cv2.remap(ideal, *self._maps, cv2.INTER_LINEAR) if self._maps else ideal
        if self._model.blur_px > 0.0:
            seen = cv2.GaussianBlur(seen, (0, 0), self._model.blur_px)
        gain = 2.0 ** (self._model.exposure_stops * np.sin(2 * np.pi * t_s / _EXPOSURE_PERIOD_S + self._seed))
        rng = np.random.default_rng([self._seed, 5, round(t_s * 1e6)])
        row, column = rng.integers(0, _NOISE_ROOM_PX, 2)
        grain = self._grain[row : row + seen.shape[0], column : column + seen.shape[1]]
        return np.asarray(cv2.addWeighted(seen, gain, grain, 1.0, -128.0), dtype=np.uint8)


def _undistorted(camera: CameraCalibration, model: CameraModel) -> F64:
    """(H, W, 2): where in the ideal picture each pixel of the camera looks. The radial law has no inverse in closed
    form; it is tabulated and read backwards."""
    focal, center = np.array([camera.K[0, 0], camera.K[1, 1]]), camera.K[:2, 2]
    v, u = np.mgrid[0 : camera.height, 0 : camera.width].astype(np.float64)
    flat = (np.stack([u, v], axis=2) - center) / focal
    radius = np.hypot(flat[..., 0], flat[..., 1])
    ideal_radius = np.linspace(0.0, _WIDEST_TAN, 4000)
    distorted = ideal_radius * (1.0 + model.k1 * ideal_radius**2 + model.k2 * ideal_radius**4)
    stretch = np.interp(radius, distorted, ideal_radius) / np.maximum(radius, 1e-9)
    return np.asarray(flat * stretch[..., None] * focal + center, dtype=np.float64)


def _grain(camera: CameraCalibration, sigma: float, seed: int) -> U8:
    """Noise about 128, somewhat larger than a picture, so that every picture gets its own cut."""
    rng = np.random.default_rng([seed, 6])
    shape = (camera.height + _NOISE_ROOM_PX, camera.width + _NOISE_ROOM_PX, 3)
    return np.clip(np.round(128.0 + sigma * rng.standard_normal(shape, dtype=np.float32)), 0, 255).astype(np.uint8)
