"""Painted lines on a flat road, as seen by a camera."""

from __future__ import annotations

import numpy as np

from pipeline.alignment.projection import Pinhole, resolve
from pipeline.common.geometry import rotation
from pipeline.params import AlignmentParams
from pipeline.types import CameraCalibration, RawLanes
from pipeline.types.lane import powers

WIDTH, HEIGHT, FOCAL_PX = 1280, 720, 1000.0
GROUND_M = -0.5
EYE_M = (-1.6, 0.1, 0.8)
FLAT = np.array([0.0, 0.0, GROUND_M])
STRAIGHT = ((1.75, 0.0, 0.0, 0.0), (-1.75, 0.0, 0.0, 0.0))


def camera(pitch_down_deg: float = 0.0, yaw_left_deg: float = 0.0) -> CameraCalibration:
    """A camera at ``EYE_M`` above the road, looking ahead."""
    axes = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    T_ego_camera = np.eye(4)
    T_ego_camera[:3, :3] = rotation(0.0, np.radians(pitch_down_deg), np.radians(yaw_left_deg)) @ axes
    T_ego_camera[:3, 3] = EYE_M
    K = np.array([[FOCAL_PX, 0.0, WIDTH / 2], [0.0, FOCAL_PX, HEIGHT / 2], [0.0, 0.0, 1.0]])
    return CameraCalibration(K, np.zeros(0), np.linalg.inv(T_ego_camera), WIDTH, HEIGHT)


def aligned(pitch_down_deg: float = 0.0, yaw_left_deg: float = 0.0) -> Pinhole:
    found = resolve(AlignmentParams(), camera(pitch_down_deg, yaw_left_deg))
    assert isinstance(found, Pinhole)
    return found


def paint(
    lines: tuple[tuple[float, float, float, float], ...] = STRAIGHT,
    *,
    through: Pinhole | None = None,
    noise_px: float = 0.0,
    numbered: bool = False,
    clutter: int = 0,
    seed: int = 0,
    x_m: tuple[float, float] = (4.0, 45.0),
) -> RawLanes:
    """Points of y(x) = Σ c_k·x^k, about one per row, as from a detector. clutter: number of random points below the
    horizon. numbered: whether each point has the number of its line."""
    random = np.random.default_rng(seed)
    seen, of = [np.zeros((0, 2))], [np.zeros(0, np.int64)]
    for number, coefficients in enumerate(lines):
        x = 1.0 / np.linspace(1.0 / x_m[0], 1.0 / x_m[1], 60)
        y = powers(x) @ np.array(coefficients)
        seen.append((through or aligned()).project(np.column_stack([x, y, np.full(len(x), GROUND_M)])))
        of.append(np.full(len(x), number))
    uv = np.concatenate(seen) + random.normal(0.0, noise_px, (sum(map(len, seen)), 2))
    away = random.uniform((0.0, 0.55 * HEIGHT), (WIDTH, HEIGHT), (clutter, 2))
    uv, line = np.concatenate([uv, away]), np.concatenate([*of, np.full(clutter, -1)])
    keep = (uv[:, 0] > 0) & (uv[:, 0] < WIDTH) & (uv[:, 1] < HEIGHT)
    uv, line = uv[keep], line[keep] if numbered else np.full(int(keep.sum()), -1)
    return RawLanes("drawn", uv.astype(np.float32), np.ones(len(uv), np.float32), line.astype(np.int32))
