"""Objects and tracks for tests, described by what matters to the test."""

from __future__ import annotations

import numpy as np

from pipeline.common.geometry import Cuboid
from pipeline.types import Box, EgoState, FusedObject, LidarTrack, Moment, ObjectSource, Obstacle, VisionTrack


def moment(ego: EgoState | None = None, dt_s: float | None = None) -> Moment:
    """A frame's time and ego motion; by default a first frame without known ego motion."""
    return Moment(0, dt_s, ego, ego)


def cuboid(x: float, y: float, length: float = 4.0, width: float = 1.8, height: float = 1.5) -> Cuboid:
    """A car whose rear face is at x, on its wheels 0.5 m below the bumper's height."""
    return Cuboid((x + length / 2, y, height / 2 - 0.5), (length, width, height), 0.0)


def lidar_track(
    track_id: int,
    x: float,
    y: float = 0.0,
    velocity: tuple[float, float] | None = (0.0, 0.0),
    hits: int = 5,
    **size: float,
) -> LidarTrack:
    obstacle = Obstacle(track_id - 1, cuboid(x, y, **size), (x, y, 0.0), 50, 10.0, (0.5, 0.5, 0.3))
    return LidarTrack(track_id, obstacle, velocity, hits, 0, False)


def vision_track(
    track_id: int, bbox: Box, distance_m: float | None = None, sigma_m: float = 1.0, label: str = "car", hits: int = 5
) -> VisionTrack:
    position = (distance_m, 0.0) if distance_m is not None else None
    sigma = sigma_m if distance_m is not None else None
    return VisionTrack(track_id, bbox, label, 0.9, distance_m, sigma, position, None, hits, 0, False)


def fused(
    object_id: int,
    x: float | None,
    y: float = 0.0,
    source: ObjectSource = "VL",
    velocity: tuple[float, float] | None = (0.0, 0.0),
    label: str | None = "car",
    hits: int = 5,
    **size: float,
) -> FusedObject:
    """A fused object with the middle of its nearest face at (x, y); x None: position unknown."""
    box = cuboid(x, y, **size) if x is not None else None
    corners = box.footprint() if box is not None else None
    return FusedObject(
        id=object_id,
        source=source,
        label=None if source == "L" else label,
        score=None if source == "L" else 0.9,
        bbox=(0.0, 0.0, 10.0, 10.0),
        bev=tuple((float(a), float(b)) for a, b in corners) if corners is not None else None,  # type: ignore[arg-type]
        cuboid=box if source != "V" else None,
        closest_point=(x, y, 0.0) if x is not None else None,
        distance_m=float(np.hypot(x, y)) if x is not None else None,
        distance_sigma_m=0.1 if x is not None else None,
        velocity_mps=velocity,
        seen_by=source,
        hits=hits,
        lidar_points=0 if source == "V" else 40,
        lidar_track=None,
        vision_track=None,
        ranged_hits=0 if source == "V" else hits,
        ranged_steady=0 if source == "V" else hits,
        camera_ranges=0 if source == "L" else hits,
    )
