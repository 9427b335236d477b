"""Rendered once per scenario: the sky with clouds and far hills, and the texture of the ground."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from pipeline.simulation.drawing.canvas import HAZE_BGR, HAZE_M
from pipeline.simulation.drawing.lens import undistorted
from pipeline.types import F32, F64, I64, U8, CameraCalibration

TILE_M = 24.0
_TILE_PX = 1024
_ZENITH_BGR = np.array([196.0, 142.0, 84.0])
_LEVELS_M = (
    (0.0, 0.0),
    (5.0, 0.6),
    (7.0, 0.9),
    (9.5, 1.4),
    (13.0, 2.0),
    (18.0, 3.0),
    (25.0, 4.2),
    (36.0, 6.0),
    (55.0, 9.0),
)
"""From this distance on, the ground's texture is blurred by this many pixels: a coarse mip chain."""
_GRAIN_ENDS_M = 110.0
_LEVEL = -1e-4  # slope at which a ray counts as looking down
_CLEAREST_FAR = 0.5  # fields at the horizon keep a colour, or they would look like water


@lru_cache(maxsize=4)
def sky(width: int, horizon: int, seed: int) -> U8:
    """(horizon + 2, 3·width, 3): a panorama three images wide, cropped by the heading."""
    rng = np.random.default_rng([seed, 3])
    rows, columns = horizon + 2, 3 * width
    height = np.linspace(1.0, 0.0, rows, dtype=np.float32)[:, None]
    gradient = (HAZE_BGR + (_ZENITH_BGR - HAZE_BGR) * (height**0.75)[..., None]).astype(np.float32)
    image = np.broadcast_to(gradient, (rows, columns, 3)).copy()
    stretched = cv2.resize(_octaves(rng, 256, (4, 8, 16, 32, 64)), (columns, rows * 2))[:rows]
    cloud = np.clip((stretched - 0.55) * 3.2, 0.0, 1.0) * np.clip(height * 2.2, 0.0, 1.0) * 0.8
    image += (np.array([252.0, 250.0, 247.0], dtype=np.float32) - image) * cloud[..., None]
    for distance_m, size_px, colour in ((2600, 34, (120, 128, 96)), (1300, 22, (84, 112, 78)), (600, 15, (60, 92, 66))):
        _ridge(image, rng, horizon, size_px, np.array(colour, dtype=float), distance_m)
    painted: U8 = np.clip(image, 0, 255).astype(np.uint8)
    return painted


def _ridge(image: F32, rng: np.random.Generator, horizon: int, size_px: int, bgr: F64, distance_m: float) -> None:
    """A line of hills or woods along the horizon, seen through the haze."""
    columns = image.shape[1]
    knots = rng.random(columns // 90 + 2)
    fine = rng.random(columns // 7 + 2)
    at = np.arange(columns)
    line = np.interp(at, np.linspace(0, columns, len(knots)), knots) * 0.8
    line += np.interp(at, np.linspace(0, columns, len(fine)), fine) * 0.22
    clear = np.exp(-distance_m / (HAZE_M * 2.2))
    colour = bgr * clear + HAZE_BGR * (1 - clear)
    top = horizon - line * size_px
    first = max(int(top.min()), 0)
    rows = np.arange(first, image.shape[0])[:, None]
    cover = np.clip(rows - top[None, :], 0.0, 1.0)[..., None]
    image[first:] += (colour - image[first:]) * cover


def _octaves(rng: np.random.Generator, size: int, steps: tuple[int, ...]) -> F32:
    """(size, size) tileable noise from 0 to 1, the sum of ever finer grids."""
    total = np.zeros((size, size), dtype=np.float32)
    for weight, step in zip(0.62 ** np.arange(len(steps)), steps, strict=True):
        grid = rng.random((step, step)).astype(np.float32)
        wrapped = np.pad(grid, 2, mode="wrap")
        scale = size // step
        large = cv2.resize(wrapped, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
        total += weight * large[2 * scale : 2 * scale + size, 2 * scale : 2 * scale + size]
    total -= total.min()
    return np.asarray(total / total.max(), dtype=np.float32)


class GroundTexture:
    """Texture and haze of a flat ground under a fixed camera; only the position along the road changes."""

    def __init__(self, camera: CameraCalibration, ground_z_m: float, seed: int) -> None:
        self.horizon, x, y, distance = _ground_under(camera, ground_z_m)
        tile = _grain(seed)
        self._bands = []
        row_distance = np.median(distance, axis=1)
        starts = [d for d, _ in _LEVELS_M]
        for (start, blur), end in zip(_LEVELS_M, [*starts[1:], _GRAIN_ENDS_M], strict=True):
            rows = np.flatnonzero((row_distance >= start) & (row_distance < end))
            if len(rows):
                band = slice(int(rows[0]), int(rows[-1]) + 1)
                self._bands.append((band, _wrapped(tile, blur), *_tile_maps(x[band], y[band])))
        clear = np.maximum(np.exp(-distance / HAZE_M), _CLEAREST_FAR)[..., None]
        self._clear = np.repeat(np.round(255 * clear), 3, axis=2).astype(np.uint8)
        self._haze = np.round(HAZE_BGR * (1 - clear)).astype(np.uint8)
        self._gain = np.full((*distance.shape, 3), 128, dtype=np.uint8)

    def finish(self, below_horizon: U8, along_m: float, left_m: float) -> None:
        """Apply texture and haze to flat-coloured ground, in place."""
        gain = self._gain.copy()
        row, column = (int((way % TILE_M) / TILE_M * _TILE_PX) for way in (along_m, left_m))
        for band, tile, map1, map2 in self._bands:
            cut = tile[row : row + _TILE_PX + 2, column : column + _TILE_PX + 2]
            grain = cv2.remap(cut, map1, map2, cv2.INTER_LINEAR)
            cv2.cvtColor(grain, cv2.COLOR_GRAY2BGR, gain[band])
        cv2.multiply(below_horizon, gain, below_horizon, scale=1 / 128)
        cv2.multiply(below_horizon, self._clear, below_horizon, scale=1 / 255)
        cv2.add(below_horizon, self._haze, below_horizon)


def _ground_under(camera: CameraCalibration, ground_z_m: float) -> tuple[int, F64, F64, F64]:
    """The row of the horizon, and ego x, y and distance of the ground in every pixel below it."""
    R, t = camera.T_camera_ego[:3, :3], camera.T_camera_ego[:3, 3]
    place = -R.T @ t
    edges = _rays(camera, np.arange(camera.height), np.array([0, camera.width // 2, camera.width - 1])) @ R
    horizon = int(np.argmax(edges[..., 2].max(axis=1) < _LEVEL))
    ray = _rays(camera, np.arange(horizon, camera.height), np.arange(camera.width)) @ R
    reach = (ground_z_m - place[2]) / ray[..., 2]
    x, y = place[0] + reach * ray[..., 0], place[1] + reach * ray[..., 1]
    return horizon, x, y, np.hypot(x - place[0], y - place[1])


def _rays(camera: CameraCalibration, rows: I64, columns: I64) -> F64:
    """(rows, columns, 3) viewing directions of pixels, camera axes, z = 1."""
    v, u = np.meshgrid(rows, columns, indexing="ij")
    K = camera.K
    seen = np.column_stack([((u - K[0, 2]) / K[0, 0]).ravel(), ((v - K[1, 2]) / K[1, 1]).ravel()])
    ideal = undistorted(seen, camera.distortion)
    return np.column_stack([ideal, np.ones(len(ideal))]).reshape(*u.shape, 3)


def _grain(seed: int) -> U8:
    rng = np.random.default_rng([seed, 4])
    coarse = _octaves(rng, _TILE_PX, (4, 8, 16, 64)) - 0.5
    fine = rng.standard_normal((_TILE_PX, _TILE_PX)).astype(np.float32)
    grain: U8 = np.clip(128 + 34 * coarse + 15 * fine, 40, 220).astype(np.uint8)
    return grain


def _wrapped(tile: U8, blur_px: float) -> U8:
    """The tile repeated twice in both directions, so that any shift can be cropped from it."""
    if blur_px > 0.0:
        rim = int(4 * blur_px) + 1
        padded = cv2.GaussianBlur(np.pad(tile, rim, mode="wrap"), (0, 0), blur_px)
        tile = np.asarray(padded[rim:-rim, rim:-rim], dtype=np.uint8)
    return np.pad(np.tile(tile, (2, 2)), ((0, 2), (0, 2)), mode="wrap")


def _tile_maps(x: F64, y: F64) -> tuple[np.ndarray, np.ndarray]:
    """Position of each pixel's ground in the tile, as OpenCV's fixed-point maps."""
    rows, columns = (np.mod(way, TILE_M) / TILE_M * _TILE_PX for way in (x, y))
    return cv2.convertMaps(columns.astype(np.float32), rows.astype(np.float32), cv2.CV_16SC2)
