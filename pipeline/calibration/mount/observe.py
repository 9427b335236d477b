"""Collects what a drive shows of the LiDAR's mount: the road in every frame, and the LiDAR's motion.

Motion comes from LiDAR odometry, and the road is the plane through the returns in the ego lane, where a road is
flattest. No camera is needed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import atan2, cos, hypot, sin

import numpy as np

from pipeline.common.progress import Progress, silent
from pipeline.common.robust import mad_sigma
from pipeline.params import Params, with_changes
from pipeline.run import only
from pipeline.step import State, step
from pipeline.types import F32, F64, EgoState, Frame, Ground

FRAMES = 1200
"""Number of evaluated frames, from the middle of the drive: two minutes at 10 Hz."""
NEAREST_M, FARTHEST_M, HALF_WIDTH_M = 2.5, 20.0, 2.0
"""Bounds of the used road returns. Farther to the side there are kerbs and the other half of a crowned road: in a KITTI
street, a strip three times as wide tilts by 2.3° more."""
FEWEST_POINTS = 40
SEGMENT_M = 3.0
"""Length of a piece of the way: long enough that its direction is not mostly noise."""


@dataclass(frozen=True, eq=False)
class RoadPlane:
    """The road in one frame, as a plane z = ahead·x + left·y − height, ego frame."""

    t_ns: int
    """The tick."""
    ahead: float
    """Slope along x."""
    left: float
    """Slope along y."""
    height_m: float
    """Of the ego origin above the road."""


@dataclass(frozen=True, eq=False)
class Piece:
    """A piece of the LiDAR's way of at least ``SEGMENT_M``, in the ego frame at half of its rotation."""

    t_ns: int
    """Its beginning."""
    forward_m: float
    """Along x."""
    left_m: float
    """Along y."""
    up_m: float
    """Along z."""
    turn_rad: float
    """Change of heading, positive to the left."""
    driven_m: float | None
    """The same distance by the car's own speed; None unless it is known throughout."""


@dataclass(frozen=True, eq=False)
class MountRecord:
    """All observations of a drive."""

    frames: int
    """Frames with a sweep."""
    roads: tuple[RoadPlane, ...]
    """From the frames in which the road was found."""
    pieces: tuple[Piece, ...]
    """From the parts in which odometry was reliable."""


def observe(frame_of: Callable[[int], Frame], count: int, params: Params, progress: Progress = silent) -> MountRecord:
    """A drive of ``count`` frames, or the middle of a long one. An exception of ``progress`` ends it."""
    looked = looked_at(count)
    params = with_changes(params, {"motion.source": "lidar"})
    state, way = State(), _Way()
    roads: list[RoadPlane] = []
    frames = 0
    for number, index in enumerate(looked):
        progress(number, len(looked))
        frame = only(frame_of(index), "lidar")
        state, result = step(state, frame, params)
        assert result.layers is not None
        frames += frame.sweep is not None
        if result.layers.ground is not None:
            road = _road(frame.t_ns, result.layers.points, result.layers.ground)
            roads += [road] if road is not None else []
        poses = state.measured.odometry.poses
        way.add(frame.t_ns, poses[-1] if poses else None, len(poses) < 2, frame.ego)
    progress(len(looked), len(looked))
    return MountRecord(frames, tuple(roads), tuple(way.pieces))


def looked_at(count: int) -> range:
    """The evaluated frames of a drive with this many."""
    first = max(0, (count - FRAMES) // 2)
    return range(first, min(count, first + FRAMES))


class _Way:
    """Divides the sequence of poses into pieces."""

    def __init__(self) -> None:
        self.pieces: list[Piece] = []
        self._from: F64 | None = None
        self._from_ns = self._last_ns = 0
        self._driven_m: float | None = 0.0

    def add(self, t_ns: int, pose: F64 | None, begins: bool, ego: EgoState | None) -> None:
        """pose: (4, 4), T_start_ego; None without one. begins: it is not connected to earlier poses."""
        if pose is None or begins or self._from is None:
            self._begin(t_ns, pose)
            return
        dt_s = (t_ns - self._last_ns) / 1e9
        self._last_ns = t_ns
        if ego is None or self._driven_m is None:
            self._driven_m = None
        else:
            self._driven_m += ego.speed_mps * dt_s
        step = np.linalg.inv(self._from) @ pose
        if hypot(step[0, 3], step[1, 3]) < SEGMENT_M:
            return
        turn = atan2(step[1, 0], step[0, 0])
        c, s = cos(0.5 * turn), sin(0.5 * turn)
        forward, left = c * step[0, 3] + s * step[1, 3], c * step[1, 3] - s * step[0, 3]
        self.pieces.append(Piece(self._from_ns, float(forward), float(left), float(step[2, 3]), turn, self._driven_m))
        self._begin(t_ns, pose)

    def _begin(self, t_ns: int, pose: F64 | None) -> None:
        self._from, self._from_ns, self._last_ns, self._driven_m = pose, t_ns, t_ns, 0.0


def _road(t_ns: int, points: F32, ground: Ground) -> RoadPlane | None:
    """The plane through the returns of the own lane, without structures beside it; None with too few."""
    near = ground.mask[: len(points)] & (points[:, 0] > NEAREST_M) & (points[:, 0] < FARTHEST_M)
    near &= np.abs(points[:, 1]) < HALF_WIDTH_M
    x, y, z = points[near, :3].astype(np.float64).T
    if len(x) < FEWEST_POINTS:
        return None
    design = np.column_stack([x, y, np.ones(len(x))])
    kept = np.ones(len(x), dtype=bool)
    for _ in range(6):
        plane, *_ = np.linalg.lstsq(design[kept], z[kept], rcond=None)
        off = np.abs(design @ plane - z)
        kept = off <= 2.5 * (mad_sigma(off[kept]) + 1e-3)
    if np.count_nonzero(kept) < FEWEST_POINTS:
        return None
    # needs more than one ring to determine the slope ahead
    if np.ptp(x[kept]) < 2.0 or np.ptp(y[kept]) < 0.5 * HALF_WIDTH_M:
        return None
    return RoadPlane(t_ns, float(plane[0]), float(plane[1]), float(-plane[2]))
