"""Registers a point cloud to a map of earlier ones: KISS-ICP's registration and voxel map (Vizzo et al., RA-L 2023).

The library's own odometry keeps its map internally. Here, a map is built from the last few clouds on every call, so ego
motion is a pure function of its inputs, can be computed again for any frame, and gives the same bytes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from pipeline.types import F32, F64

VOXEL_M = 1.0
"""KISS-ICP's default for a range of 100 m."""
_MAP_VOXEL_M, _MATCHED_VOXEL_M = 0.5 * VOXEL_M, 1.5 * VOXEL_M
_PER_VOXEL, _ITERATIONS = 20, 10
"""Ten iterations are as close to KITTI's reference as fifty: 0.13 and 0.15 m/s."""
_CONVERGED = 1e-3
_KERNEL_M = 0.5
"""Points farther off than this get little weight, beyond three times this none."""
_MOST_MATCHED = 1500
"""Limits the computing time; a VLP-16's sweep has 300 to 900."""
_FITS_M = 0.5
"""Maximum distance between points of one surface in two sweeps of 16 rings."""
_JUDGED_BY = 2
"""A pose is scored against this many of the latest sweeps."""


class Registration(NamedTuple):
    """Pose of a cloud relative to earlier ones."""

    pose: F64
    """(4, 4) T_map_cloud."""
    fit: float
    """Share of its points, 0–1, that match the last clouds."""


def warm_up() -> None:
    """Load the library, where it is installed."""
    is_available()


@cache
def is_available() -> bool:
    """Whether KISS-ICP is installed: it has no package for every Python (``pyproject.toml``)."""
    try:
        _library()
    except ModuleNotFoundError:
        return False
    return True


def thinned(points: F32) -> F32:
    """(M, 3) float32, the first of (N, 3) points in each voxel at the map's resolution."""
    return _voxels(points, _MAP_VOXEL_M).astype(np.float32)


def align(cloud: F32, clouds: Sequence[F32], poses: Sequence[F64], guesses: Sequence[F64]) -> Registration:
    """The pose of a down-sampled cloud relative to earlier ones, from the best of the guesses.

    Args:
        cloud: (N, 3), in its own frame.
        clouds: earlier ones, each in its own frame, newest last.
        poses: T_map_cloud of each.
        guesses: initial T_map_cloud; several if the motion is not known yet.
    """
    library = _library()
    grid = library._VoxelHashMap(voxel_size=VOXEL_M, max_distance=100.0, max_points_per_voxel=_PER_VOXEL)
    for points, pose in zip(clouds, poses, strict=True):
        grid._update(library._Vector3dVector(points.astype(np.float64)), pose)
    matched = _voxels(cloud, _MATCHED_VOXEL_M)
    matched = matched[:: -(-len(matched) // _MOST_MATCHED) or 1]
    source = library._Vector3dVector(matched)
    # one thread: with several, the order of summation would vary
    method = library._Registration(max_num_iterations=_ITERATIONS, convergence_criterion=_CONVERGED, max_num_threads=1)

    def registered(guess: F64) -> F64:
        found = method._align_points_to_map(
            points=source,
            voxel_map=grid,
            initial_guess=guess,
            max_correspondance_distance=3.0 * _KERNEL_M,
            kernel=_KERNEL_M,
        )
        return np.asarray(found)

    found = [registered(guess) for guess in guesses]
    pairs = zip(clouds[-_JUDGED_BY:], poses[-_JUDGED_BY:], strict=True)
    around = np.vstack([_moved(points, pose) for points, pose in pairs])
    tree = cKDTree(around, balanced_tree=False, compact_nodes=False)  # not balanced: built twice as fast
    placed = [Registration(pose, _fit(tree, _moved(matched, pose))) for pose in found]
    best = max(placed, key=lambda each: each.fit)
    # from a distant guess, one round does not converge
    return best if len(guesses) == 1 else Registration(registered(registered(best.pose)), best.fit)


def _fit(tree: cKDTree, points: F64) -> float:
    """Share of the points that are close to one of the tree's points."""
    distance, _ = tree.query(points, distance_upper_bound=_FITS_M)
    return float(np.isfinite(distance).mean()) if len(points) else 0.0


def _moved(points: F32 | F64, pose: F64) -> F64:
    return np.asarray(points @ pose[:3, :3].T + pose[:3, 3], dtype=np.float64)


def _voxels(points: F32 | F64, size_m: float) -> F64:
    library = _library()
    return np.asarray(library._voxel_down_sample(library._Vector3dVector(points.astype(np.float64)), size_m))


@cache
def _library() -> Any:
    """KISS-ICP's compiled part; its Python part takes a second to import, for reading settings that are not used
    here."""
    from kiss_icp.pybind import kiss_icp_pybind

    return kiss_icp_pybind
