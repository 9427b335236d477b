"""Random views of a training image: a window at a random scale, mirrored, with other exposure, blur and noise."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.inference.graph import Size
from pipeline.types import F32, U8
from pipeline.vision.detector import PADDING

_NEAREST_SCALE, _FARTHEST_SCALE = 1.35, 0.75
_AIMED = 0.75


def view(rng: np.random.Generator, image: U8, rows: F32, size: Size) -> tuple[U8, F32]:
    """A window of (height, width) of an image and its label rows (``dataset.COLUMNS``), boxes and visible shares cut
    to the window. A vertical shift simulates a pitching car, a scale another distance."""
    scale = float(rng.uniform(_FARTHEST_SCALE, _NEAREST_SCALE))
    left, top = _corner(rng, image, rows, size, scale)
    to_window = np.array([[scale, 0.0, -left], [0.0, scale, -top]])
    border = (PADDING, PADDING, PADDING)
    shrink = cv2.INTER_AREA if scale < 1.0 else cv2.INTER_LINEAR
    window = cv2.warpAffine(image, to_window, size[::-1], flags=shrink, borderValue=border)
    cut = rows.copy()
    cut[:, 2:6] = cut[:, 2:6] * scale - np.array([left, top, left, top], dtype=np.float32)
    whole = (cut[:, 4] - cut[:, 2]) * (cut[:, 5] - cut[:, 3])
    cut[:, 2:6:2] = np.clip(cut[:, 2:6:2], 0.0, size[1])
    cut[:, 3:6:2] = np.clip(cut[:, 3:6:2], 0.0, size[0])
    kept = (cut[:, 4] - cut[:, 2]) * (cut[:, 5] - cut[:, 3])
    cut[:, 6] *= kept / np.maximum(whole, 1e-6)
    if rng.random() < 0.5:
        window = window[:, ::-1]
        cut[:, [2, 4]] = size[1] - cut[:, [4, 2]]
    return other_light(rng, np.ascontiguousarray(window)), cut


def _corner(rng: np.random.Generator, image: U8, rows: F32, size: Size, scale: float) -> tuple[float, float]:
    """Upper left corner of the window in the scaled image, mostly such that it contains a vehicle."""
    free = np.array([image.shape[1] * scale - size[1], image.shape[0] * scale - size[0]])
    if len(rows) and rng.random() < _AIMED:
        box = rows[int(rng.integers(len(rows))), 2:6] * scale
        corner = (box[:2] + box[2:]) / 2 - rng.uniform(0.1, 0.9, 2) * (size[1], size[0])
    else:
        corner = rng.uniform(0.0, 1.0, 2) * free
    corner = np.clip(corner, np.minimum(0.0, free), np.maximum(0.0, free))
    return float(corner[0]), float(corner[1])


def other_light(rng: np.random.Generator, image: U8) -> U8:
    """Random exposure, white balance and contrast, sometimes blur and noise."""
    gamma, gain = np.exp(rng.normal(0.0, 0.25)), np.exp(rng.normal(0.0, 0.2, 3) * 0.4 + rng.normal(0.0, 0.25))
    levels = (np.arange(256)[:, None] / 255.0) ** gamma * gain * 255.0 + rng.normal(0.0, 8.0)
    table = np.clip(levels, 0, 255).astype(np.uint8).reshape(1, 256, 3)
    lit = cv2.LUT(image, table)
    if rng.random() < 0.25:
        lit = cv2.GaussianBlur(lit, (0, 0), float(rng.uniform(0.3, 0.9)))
    if rng.random() < 0.4:
        noise = rng.standard_normal(lit.shape, dtype=np.float32) * np.float32(rng.uniform(1.0, 8.0))
        lit = np.clip(lit + noise, 0, 255).astype(np.uint8)
    return np.asarray(lit, dtype=np.uint8)
