"""The LiDAR branch compared with the usual alternatives: plain numpy for the ground, Open3D for the rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import cycle
from typing import Any

import numpy as np
import numpy.typing as npt

from app.bench.ground_reference import fit_ground_numpy
from app.bench.timing import figures, interleaved
from pipeline.common.clips import begins_clip
from pipeline.lidar import warm_up
from pipeline.lidar.boxes import fit_obstacles
from pipeline.lidar.cluster import candidates, cluster
from pipeline.lidar.downsample import keep_mask
from pipeline.lidar.ground import fit_ground
from pipeline.lidar.tracking import LidarTrackerState, track
from pipeline.params import Params, with_changes
from pipeline.types import F32, Obstacle, Sweep

OURS = "ours"
VOXEL_M = 0.2
RANSAC_POINTS, RANSAC_ITERATIONS = 3, 1000
"""As in Open3D's own tutorial."""
SYSTEM_LIBRARIES = "on slim systems Open3D needs libegl1 libgl1 libx11-6 libusb-1.0-0"


@dataclass(frozen=True)
class Prepared:
    """One sweep with the results of the stages before clustering."""

    sweep: Sweep
    """The sweep as recorded."""
    keep: npt.NDArray[np.bool_]
    """(N,) whether downsampling keeps the point."""
    chosen: npt.NDArray[np.bool_]
    """(N,) whether the point is to be clustered."""


def stages(sweeps: list[Sweep], budget_s: float, params: Params) -> dict[str, dict[str, Any]]:
    """``ground``, ``cluster`` and ``lidar_chain`` as ``cipv bench --json`` prints them. Every contestant processes
    every sweep in turn.

    For a peer that cannot be measured, ``absent`` gives the reason instead of figures.
    """
    if not sweeps:
        return {}
    warm_up()
    params = with_changes(params, {"cluster.front_only": False})  # the whole rotation, as in peers' benchmarks
    prepared = [_prepare(sweep, params) for sweep in sweeps]
    open3d, reason = _open3d()
    ground: dict[str, Callable[[], object]] = {
        OURS: _each(prepared, lambda p: fit_ground(p.sweep.points, p.keep, params.ground)),
        "numpy": _each(prepared, lambda p: fit_ground_numpy(p.sweep.points, p.keep, params.ground)),
    }
    clusters: dict[str, Callable[[], object]] = {
        OURS: _each(prepared, lambda p: cluster(p.sweep.points, p.chosen, params.cluster))
    }
    chain: dict[str, Callable[[], object]] = {OURS: _chain(prepared, params)}
    if open3d is not None:
        peer = Open3dPeer(open3d, params)
        clusters["open3d cluster_dbscan"] = _each(prepared, peer.cluster)
        chain["open3d, 0.2 m voxels"] = _each(prepared, lambda p: peer.chain(p, VOXEL_M))
        chain["open3d"] = _each(prepared, lambda p: peer.chain(p, None))
    return {
        "ground": _row(interleaved(ground, budget_s * 0.15), {}),
        "cluster": _row(interleaved(clusters, budget_s * 0.3), {} if open3d else {"open3d cluster_dbscan": reason}),
        "lidar_chain": _row(
            interleaved(chain, budget_s * 0.55),
            {} if open3d else dict.fromkeys(("open3d, 0.2 m voxels", "open3d"), reason),
        ),
    }


def _prepare(sweep: Sweep, params: Params) -> Prepared:
    keep = keep_mask(sweep, params.downsample)
    ground = fit_ground(sweep.points, keep, params.ground)
    chosen = candidates(sweep.points, ground, keep, params.cluster)
    range_m = np.hypot(sweep.points[:, 0], sweep.points[:, 1])
    return Prepared(sweep, keep, chosen & (range_m <= params.cluster.max_range_m))


def _each(prepared: list[Prepared], run: Callable[[Prepared], object]) -> Callable[[], object]:
    """A contestant for ``interleaved``; each call processes the next sweep."""
    turn = cycle(prepared)
    return lambda: run(next(turn))


def _chain(prepared: list[Prepared], params: Params) -> Callable[[], object]:
    """Our stages from points to tracks. The tracker's state is predicted from sweep to sweep by their timestamps."""
    turn = cycle(prepared)
    state = LidarTrackerState()

    last_ns = 0

    def run() -> object:
        nonlocal state, last_ns
        sweep = next(turn).sweep
        dt_s, continues = (sweep.t_ns - last_ns) / 1e9, not begins_clip(last_ns, sweep.t_ns, params.time.reset_gap_s)
        last_ns = sweep.t_ns
        state, tracks = track(state, obstacles_of(sweep, params), dt_s if continues else None, params.lidar_tracking)
        return tracks

    return run


def obstacles_of(sweep: Sweep, params: Params) -> tuple[Obstacle, ...]:
    """The obstacles of one sweep, after every stage before tracking."""
    keep = keep_mask(sweep, params.downsample)
    ground = fit_ground(sweep.points, keep, params.ground)
    labels = cluster(sweep.points, candidates(sweep.points, ground, keep, params.cluster), params.cluster)
    return fit_obstacles(sweep.points, labels, ground, params.box)


class Open3dPeer:
    """Does the same work with Open3D's functions."""

    def __init__(self, open3d: Any, params: Params) -> None:
        self._open3d = open3d
        self._params = params
        open3d.utility.set_verbosity_level(open3d.utility.VerbosityLevel.Error)
        open3d.utility.random.seed(0)

    def cluster(self, prepared: Prepared) -> npt.NDArray[np.int32]:
        """(M,) cluster labels of the chosen points. With z scaled and a minimum of one point, DBSCAN gives the same
        clusters as ours."""
        return self._dbscan(prepared.sweep.points[prepared.chosen, :3], min_points=1)

    def chain(self, prepared: Prepared, voxel_m: float | None) -> list[Any]:
        """From points to boxes: voxels, RANSAC plane, DBSCAN of the points in range, one box per cluster. This is less
        work than our stages do: boxes are not oriented (Open3D's oriented box prints a warning for every flat cluster)
        and not tracked."""
        cloud = self._cloud(prepared.sweep.points[:, :3])
        if voxel_m is not None:
            cloud = cloud.voxel_down_sample(voxel_m)
        _, ground = cloud.segment_plane(self._params.ground.distance_m, RANSAC_POINTS, RANSAC_ITERATIONS)
        rest = np.asarray(cloud.select_by_index(ground, invert=True).points)
        near = rest[np.hypot(rest[:, 0], rest[:, 1]) <= self._params.cluster.max_range_m]
        labels = self._dbscan(near, self._params.cluster.min_points)
        box = self._open3d.geometry.AxisAlignedBoundingBox
        return [
            box.create_from_points(self._open3d.utility.Vector3dVector(near[labels == c]))
            for c in range(labels.max(initial=-1) + 1)
        ]

    def _dbscan(self, xyz: npt.NDArray[np.floating], min_points: int) -> npt.NDArray[np.int32]:
        scaled = self._cloud(xyz * [1.0, 1.0, self._params.cluster.z_weight])
        return np.asarray(scaled.cluster_dbscan(self._params.cluster.tolerance_m, min_points), dtype=np.int32)

    def _cloud(self, xyz: npt.NDArray[np.floating] | F32) -> Any:
        return self._open3d.geometry.PointCloud(self._open3d.utility.Vector3dVector(xyz.astype(np.float64)))


def _open3d() -> tuple[Any, str]:
    """The module; or None with the reason why it is not available."""
    try:
        import open3d
    except (ImportError, OSError) as error:
        return None, f"{str(error).splitlines()[0]} ({SYSTEM_LIBRARIES})"
    return open3d, ""


def _row(times: dict[str, list[float]], absent: dict[str, str]) -> dict[str, Any]:
    median = {name: float(np.median(spent)) * 1e3 for name, spent in times.items()}
    peers: dict[str, dict[str, Any]] = {
        name: {"median_ms": ms, "ratio": ms / median[OURS]} for name, ms in median.items() if name != OURS
    }
    peers |= {name: {"median_ms": None, "ratio": None, "absent": reason} for name, reason in absent.items()}
    return {**figures(times[OURS]), "peers": peers}
