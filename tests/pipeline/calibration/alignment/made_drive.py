"""Frames of a made-up drive as a fit sees them: cars around a known camera, boxes that are off as a detector's are."""

from __future__ import annotations

import numpy as np

from pipeline.alignment.projection import Alignment
from pipeline.calibration.alignment.scenes import OUTLINE, FitScene
from pipeline.types import F64, CameraCalibration

SIZE = (1280, 400)
CAMERA = CameraCalibration(
    K=np.array([[800.0, 0.0, 640.0], [0.0, 800.0, 190.0], [0.0, 0.0, 1.0]]),
    distortion=np.zeros(0),
    T_camera_ego=np.array([[0.0, -1, 0, 0.1], [0, 0, -1, 0.4], [1, 0, 0, -0.3], [0, 0, 0, 1]]),
    width=SIZE[0],
    height=SIZE[1],
)
ROAD_M = -1.5
GAP_RAD = np.radians(2.0)


def drive(
    true: Alignment,
    frames: int = 20,
    cars: int = 4,
    walls: int = 5,
    ranges_m: tuple[float, float] = (8.0, 35.0),
    bearing_deg: float = 25.0,
    seed: int = 0,
    camera: CameraCalibration | None = CAMERA,
) -> list[FitScene]:
    """Frames one second apart. walls: number of clusters without a box, and of boxes without a cluster."""
    rng = np.random.default_rng(seed)
    scenes = []
    for k in range(frames):
        parts = [_seen(rng, ranges_m, bearing_deg, 1.75, 1.5) for _ in range(cars)]
        boxes = np.array([_box(true, *part) for part in parts]).reshape(-1, 4)
        boxes += rng.normal(0.0, 0.03, boxes.shape) * (boxes[:, 2:] - boxes[:, :2])[:, [0, 1, 0, 1]]
        others = [_seen(rng, (6.0, 50.0), 30.0, rng.uniform(0.3, 6.0), rng.uniform(0.8, 3.0)) for _ in range(walls)]
        corner = rng.uniform([0.0, 0.0], [SIZE[0] - 100.0, SIZE[1] - 80.0], (walls, 2))
        stray = np.hstack([corner, corner + rng.uniform(20.0, 80.0, (walls, 2))])
        outline, roof, foot = (np.array(each) for each in zip(*parts, *others, strict=True))
        boxes = np.clip(np.vstack([boxes, stray]), 0.0, [*SIZE, *SIZE])
        whole = np.abs(boxes - [0.0, 0.0, *SIZE]) > 3.0
        range_m = np.hypot(foot[:, 1, 0], foot[:, 1, 1])
        scenes.append(FitScene(boxes, whole, outline, roof, foot, range_m, SIZE, camera, k * 1_000_000_000))
    return scenes


def _seen(
    rng: np.random.Generator, ranges_m: tuple[float, float], bearing_deg: float, width_m: float, height_m: float
) -> tuple[F64, F64, F64]:
    """Outline, top and bottom of a flat rear as hit by rings 2° apart."""
    range_m, bearing = rng.uniform(*ranges_m), np.radians(rng.uniform(-bearing_deg, bearing_deg))
    middle = np.array([range_m * np.cos(bearing), range_m * np.sin(bearing)])
    side = np.array([-np.sin(bearing), np.cos(bearing)]) * width_m / 2
    top = np.arctan2(ROAD_M + height_m, range_m)
    hit = np.floor(top / GAP_RAD) * GAP_RAD
    high, above = range_m * np.tan([hit, hit + GAP_RAD])
    low = min(ROAD_M + 0.4, high)
    right, left = middle - side, middle + side
    corners = [(*right, high), (*left, high), (*middle, high), (*middle, low), (*right, low), (*left, low)]
    outline = np.array(corners + [corners[0]] * (OUTLINE - len(corners)))
    foot = np.array([(*left, ROAD_M), (*middle, ROAD_M), (*right, ROAD_M)])
    roof = np.array([*middle, above])
    return outline, roof, foot


def _box(true: Alignment, outline: F64, roof: F64, foot: F64) -> F64:
    """The box that the camera sees; the roof is between two rings, here at a third of the gap."""
    sides = true.project(outline)[:, 0]
    top = true.project((outline[2] * 2 / 3 + roof / 3)[None])[0, 1]
    return np.array([sides.min(), top, sides.max(), true.project(foot)[:, 1].max()])
