"""Exports a clip's LiDAR points as one PLY file for CloudCompare or MeshLab. ICP aligns every sweep with the first one.

Open3D does the registration and writes the file. It is imported on use, because slim systems lack libraries it needs.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from app.clips.clip import Clip
from pipeline.common.errors import BadInput
from pipeline.common.progress import Progress
from pipeline.types import F32, F64

MOST_SWEEPS = 300
_VOXEL_M = 0.1
"""Many sweeps of a longer clip hit the same surface; one point per voxel keeps the file small."""
_ICP_VOXEL_M = 0.5
_ICP_REACH_M = 2.0
_NORMAL_RADIUS_M = 2.0
_NORMAL_NEIGHBOURS = 30
_LEAST_FITNESS = 0.3
_FEWEST_POINTS = 100
"""With fewer points than this, or a smaller share of matched points, the motion of the previous sweep is assumed."""


def load_open3d() -> Any:
    """The Open3D module. BadInput, in one sentence, if it or a system library that it needs is missing."""
    try:
        import open3d
    except (ImportError, OSError) as error:
        reason = str(error).splitlines()[0]
        raise BadInput(
            f"Open3D cannot be loaded ({reason}); install the system packages libegl1 libgl1 libx11-6 libusb-1.0-0"
        ) from None
    return open3d


def write(clip: Clip, path: Path, progress: Progress) -> None:
    """Write a clip's sweeps as one cloud. BadInput if the clip is too long or has no LiDAR, or if Open3D is missing."""
    total = clip.last + 1 - clip.first
    if total > MOST_SWEEPS:
        raise BadInput(f"a point cloud can have at most {MOST_SWEEPS} frames")
    progress(0, total)

    def sweeps() -> Iterator[F32 | None]:
        for index in range(clip.first, clip.last + 1):
            with clip.scheduler.background(to_the_end=True):
                sweep = clip.recording.as_read(index).sweep
            yield sweep.points if sweep is not None else None
            progress(index + 1 - clip.first, total)

    write_ply(sweeps(), path)


def write_ply(sweeps: Iterable[F32 | None], path: Path) -> None:
    """Write sweeps as one cloud in the ego frame of the first one.

    Each is (N, 4) float32 x y z intensity in its own ego frame. A frame without a sweep is left out.
    BadInput if no frame has one, or if Open3D cannot be loaded.
    """
    open3d = load_open3d()
    clouds: list[F32] = []
    poses: list[F64] = []
    before: Any = None
    for points in sweeps:
        if points is None or not len(points):
            continue
        # start from the motion of the previous sweep, as a car's speed hardly changes within 0.1 s
        guess = np.linalg.inv(poses[-2]) @ poses[-1] if len(poses) > 1 else np.eye(4)
        target, before = before, _thinned(open3d, points)
        moved = np.eye(4) if target is None else _registered(open3d, before, target, guess)
        poses.append(poses[-1] @ moved if poses else np.eye(4))
        clouds.append(points)
    if not clouds:
        raise BadInput("no frame of this clip has LiDAR points")
    _write(open3d, clouds, poses, path)


def _thinned(open3d: Any, points: F32) -> Any:
    """The points as ICP needs them: a cloud with normals and one point per voxel."""
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points[:, :3].astype(np.float64)))
    cloud = cloud.voxel_down_sample(_ICP_VOXEL_M)
    cloud.estimate_normals(open3d.geometry.KDTreeSearchParamHybrid(_NORMAL_RADIUS_M, _NORMAL_NEIGHBOURS))
    return cloud


def _registered(open3d: Any, source: Any, target: Any, guess: F64) -> F64:
    """T_target_source (4, 4) by point-to-plane ICP (Chen and Medioni 1991); the guess if too few points match."""
    if min(len(source.points), len(target.points)) < _FEWEST_POINTS:
        return guess
    registration = open3d.pipelines.registration
    found = registration.registration_icp(
        source, target, _ICP_REACH_M, guess, registration.TransformationEstimationPointToPlane()
    )
    T: F64 = np.asarray(found.transformation) if found.fitness >= _LEAST_FITNESS else guess
    return T


def _write(open3d: Any, clouds: list[F32], poses: list[F64], path: Path) -> None:
    xyz = np.concatenate([cloud[:, :3] @ T[:3, :3].T + T[:3, 3] for cloud, T in zip(clouds, poses, strict=True)])
    intensity = np.concatenate([cloud[:, 3:4] for cloud in clouds])
    cloud = open3d.t.geometry.PointCloud(open3d.core.Tensor(xyz.astype(np.float32)))
    cloud.point["intensity"] = open3d.core.Tensor(np.ascontiguousarray(intensity))
    if len(clouds) > 1:
        cloud = cloud.voxel_down_sample(_VOXEL_M)
    named = path.with_suffix(".ply")  # Open3D chooses the format by the file's name
    if not open3d.t.io.write_point_cloud(str(named), cloud):
        raise BadInput("Open3D could not write the point cloud")
    named.replace(path)
