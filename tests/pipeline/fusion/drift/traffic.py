"""Vehicles as LiDAR tracks and boxes, where a camera that may be turned sees them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.alignment.projection import project_cuboid, resolve
from pipeline.common.geometry import Cuboid
from pipeline.fusion.drift.follow import Seen
from pipeline.params import AlignmentParams
from pipeline.types import Detection, LidarTrack, VisionMeasurement
from pipeline.types.measurements import Obstacle
from tests.pipeline.calibration.alignment.made_drive import CAMERA, ROAD_M, SIZE

PLACES = ((12.0, -3.0), (18.0, 0.5), (22.0, 4.0), (34.0, -2.2), (35.0, 3.0), (26.0, -8.0))
FRAME_NS = 100_000_000
WIDTH_M, HEIGHT_M, BEAM_M = 1.75, 1.5, 0.0035
"""Size of each car; a cluster ends half a beam step inside it, in metres per metre of range."""


def track(
    number: int, x: float, y: float, velocity: tuple[float, float] = (0.0, 0.0), heading_rad: float = 0.0
) -> LidarTrack:
    """The rear of a car."""
    hit_m = WIDTH_M - BEAM_M * float(np.hypot(x, y))
    cuboid = _behind_face(x, y, (0.2, hit_m, HEIGHT_M), heading_rad)
    return LidarTrack(
        number, Obstacle(number, cuboid, (x, y, ROAD_M), 40, 10.0, (0.1, 0.5, 0.4)), velocity, 9, 0, False
    )


def _behind_face(x: float, y: float, size: tuple[float, float, float], heading_rad: float) -> Cuboid:
    ahead_m = size[0] / 2
    center = (x + ahead_m * np.cos(heading_rad), y + ahead_m * np.sin(heading_rad), ROAD_M + HEIGHT_M / 2)
    return Cuboid(center, size, heading_rad)


def box(
    x: float,
    y: float,
    turned: AlignmentParams,
    off: Sequence[float] = (0.0, 0.0, 0.0, 0.0),
    length_m: float = 0.2,
    heading_rad: float = 0.0,
) -> VisionMeasurement:
    """Its box. off: error of each edge, as a share of its height."""
    aligned = resolve(turned, CAMERA)
    assert aligned is not None
    cuboid = _behind_face(x, y, (length_m, WIDTH_M, HEIGHT_M), heading_rad)
    edges = project_cuboid(aligned, cuboid.corners(), *SIZE)
    assert edges is not None
    x1, y1, x2, y2 = (edge + share * (edges[3] - edges[1]) for edge, share in zip(edges, off, strict=True))
    return VisionMeasurement(Detection((x1, y1, x2, y2), "car", 0.8), None, None, None)


def seen(
    frame: int,
    turned: AlignmentParams,
    places: Sequence[tuple[float, float]] = PLACES,
    late_s: float = 0.0,
    speeds: Sequence[tuple[float, float]] | None = None,
) -> Seen:
    """A frame of these cars, with the lasting and the new errors of a detector. late_s: delay of the image."""
    speeds = speeds or [(0.0, 0.0)] * len(places)
    rng = np.random.default_rng(frame)
    tracks, boxes = [], []
    for k, ((x, y), (vx, vy)) in enumerate(zip(places, speeds, strict=True)):
        off = np.random.default_rng(1000 + k).normal(0.0, 0.04, 4) + rng.normal(0.0, 0.03, 4)
        tracks.append(track(k, x, y, (vx, vy)))
        boxes.append(box(x + late_s * vx, y + late_s * vy, turned, off.tolist()))
    return Seen(frame * FRAME_NS, f"{frame:06d}", tracks, boxes, None, SIZE)
