"""Sensor faults of a car in one drive: the ``faults`` part of a scenario file. Their sizes are not measured; they are
the order of magnitude found in a fleet, which a pipeline must tolerate."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from pipeline.common.geometry import inverse, rotation
from pipeline.simulation.sensors.series import lasting
from pipeline.simulation.world.roads import ScenarioPart
from pipeline.types import F32, CameraCalibration, Sweep

Ring = Annotated[int, Field(ge=0, le=15)]
_BLOB_M, _BLOB_POINTS = 0.25, 12
_BLOBS_TO_M, _BLOBS_ASIDE_M = 30.0, 6.0
_NODS_FOR_S = 0.4


class Knock(ScenarioPart):
    """A camera that is turned during the drive, beyond its error from the start."""

    at_s: float = Field(ge=0.0)
    """When, seconds from the start."""
    yaw_deg: float = Field(default=0.0, ge=-5.0, le=5.0)
    """To the left."""
    pitch_deg: float = Field(default=0.0, ge=-5.0, le=5.0)
    """Downwards."""
    roll_deg: float = Field(default=0.0, ge=-5.0, le=5.0)
    """Clockwise."""


class Faults(ScenarioPart):
    """Faults of the camera, the LiDAR and their synchronisation; the LiDAR's own ``dropout`` is in its model."""

    camera_yaw_deg: float = Field(default=0.0, ge=-5.0, le=5.0)
    """Actual rotation of the camera to the left relative to its calibration."""
    camera_pitch_deg: float = Field(default=0.0, ge=-5.0, le=5.0)
    """The same downwards."""
    camera_roll_deg: float = Field(default=0.0, ge=-5.0, le=5.0)
    """The same clockwise."""
    knock: Knock | None = None
    """Rotation of the camera in the middle of the drive."""
    nods_deg: float = Field(default=0.0, ge=0.0, le=5.0)
    """Standard deviation by which the car, and both sensors with it, nods on bumps and when it brakes."""
    camera_skew_ms: float = Field(default=0.0, ge=-200.0, le=200.0)
    """Delay of the images after their nominal tick."""
    lost_rings: tuple[Ring, ...] = ()
    """Rings of the LiDAR that return nothing, 0 is the lowest."""
    spurious_clusters: float = Field(default=0.0, ge=0.0, le=10.0)
    """Mean number of clouds of exhaust, spray or snow per sweep, within 30 m ahead."""
    sweeps_lost: float = Field(default=0.0, ge=0.0, le=0.9)
    """Share of missing sweeps."""
    pictures_lost: float = Field(default=0.0, ge=0.0, le=0.9)
    """Share of missing images."""


NONE = Faults()


def most_turned_rad(faults: Faults) -> float:
    """Upper limit of the angle by which the faults turn the camera, about all axes together. For nods, which are
    normally distributed, five standard deviations."""
    knock = faults.knock or Knock(at_s=0.0)
    angles = (
        abs(faults.camera_yaw_deg) + abs(knock.yaw_deg),
        abs(faults.camera_pitch_deg) + abs(knock.pitch_deg) + 5.0 * faults.nods_deg,
        abs(faults.camera_roll_deg) + abs(knock.roll_deg),
    )
    return float(np.radians(np.hypot(np.hypot(*angles[:2]), angles[2])))


def nods_rad(faults: Faults, seed: int, frames: int, rate_hz: float) -> F32:
    """(frames,) downward pitch of the car in each frame."""
    kept = np.array([np.exp(-1.0 / (_NODS_FOR_S * rate_hz))])
    return np.radians(faults.nods_deg * lasting([seed, 20], frames, kept)[:, 0]).astype(np.float32)


def true_camera(camera: CameraCalibration, faults: Faults, nod_rad: float = 0.0, t_s: float = 0.0) -> CameraCalibration:
    """The camera with its actual orientation at ``t_s``, where ``camera`` is its calibration."""
    turned: tuple[float, ...] = (faults.camera_roll_deg, faults.camera_pitch_deg, faults.camera_yaw_deg)
    knock = faults.knock
    if knock is not None and t_s >= knock.at_s:
        by = (knock.roll_deg, knock.pitch_deg, knock.yaw_deg)
        turned = tuple(from_start + more for from_start, more in zip(turned, by, strict=True))
    if not any(turned) and not nod_rad:
        return camera
    angles = [float(np.radians(each)) for each in turned]
    place = inverse(camera.T_camera_ego)[:3, 3]
    turn = np.eye(4)
    turn[:3, :3] = rotation(angles[0], angles[1] + nod_rad, angles[2])
    turn[:3, 3] = place - turn[:3, :3] @ place
    T_camera_ego = camera.T_camera_ego @ inverse(turn)
    return CameraCalibration(camera.K, camera.distortion, T_camera_ego, camera.width, camera.height, camera.road_z_m)


def disturb_sweep(sweep: Sweep, faults: Faults, seed: int, index: int, nod_rad: float = 0.0) -> Sweep | None:
    """The sweep with points removed, added and tilted by the faults; None if it is lost."""
    rng = np.random.default_rng([seed, 21, index])
    if rng.random() < faults.sweeps_lost:
        return None
    points, ring, time_s = sweep.points, sweep.ring, sweep.time_s
    if faults.lost_rings:
        kept = ~np.isin(ring, faults.lost_rings)
        points, ring, time_s = points[kept], ring[kept], time_s[kept] if time_s is not None else None
    if nod_rad:
        points = points.copy()
        points[:, 2] += np.float32(np.tan(nod_rad)) * points[:, 0]
    for _ in range(rng.poisson(faults.spurious_clusters)):
        middle = np.array([rng.uniform(2.0, _BLOBS_TO_M), rng.normal(0.0, _BLOBS_ASIDE_M), rng.uniform(-0.3, 0.5)])
        count = int(rng.integers(3, _BLOB_POINTS))
        cloud = np.empty((count, 4), dtype=np.float32)
        cloud[:, :3] = middle + rng.normal(0.0, _BLOB_M, (count, 3))
        cloud[:, 3] = 3.0
        elevation = np.degrees(np.arctan2(cloud[:, 2], np.hypot(cloud[:, 0], cloud[:, 1])))
        rings = np.clip(np.round((elevation + 15.0) / 2.0), 0, 15).astype(np.uint8)
        points, ring = np.vstack([points, cloud]), np.concatenate([ring, rings])
        time_s = np.concatenate([time_s, np.zeros(count, np.float32)]) if time_s is not None else None
    return Sweep(sweep.t_ns, np.ascontiguousarray(points), ring, sweep.channels, time_s, sweep.origin)
