"""Estimates the time offset between camera and LiDAR from ego motion: the lag at which depth edges match image edges
best.

If an image was taken later than its timestamp says, everything in it appears nearer: objects to the left have moved
further left, objects to the right further right, and in a bend everything has moved to one side. The depth edges are
therefore moved as ego motion moves a static world, for one lag after another, and the lag with the best match is the
time offset. A small yaw is fitted at the same time, since it moves both sides alike. Moving objects are included, but
most depth edges are static.

A camera that is farther ahead than its calibration says looks late, by 1 ms per centimetre at 10 m/s, unless the drive
has several speeds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.alignment.projection import Alignment, resolve
from pipeline.calibration.depth_edges import EdgeScene, edge_scene
from pipeline.calibration.speed_delay import SpeedPair, forward_m
from pipeline.common.errors import BadInput
from pipeline.common.progress import Progress, silent
from pipeline.common.robust import mad_sigma
from pipeline.lidar.deskew import deskew
from pipeline.params import AlignmentParams, DeskewParams, Params, with_changes
from pipeline.run import only
from pipeline.step import State, step
from pipeline.types import F64, EgoState, Frame

LONGEST, FRAMES = 1200, 150
"""Number of frames for own motion, from the middle of the drive, and number of frames whose images are evaluated."""
FEWEST_FRAMES = 12
SLOWEST_MPS, SLOWEST_RADPS = 2.0, 0.05
"""Below these, nothing moves in the image."""
REACH_MS, STEP_MS = 160.0, 4.0
YAWS_DEG = tuple(np.arange(-0.9, 0.91, 0.15).round(2).tolist())
BOOTSTRAPS = 60
STANDS_OUT = 4.0
"""Robust standard deviations by which the best lag must exceed the median."""
UNSURE_MS, TOLD_MS = 5.0, 15.0
"""Standard deviations from which a warning is given, and from which no result is given."""
NEAREST_M, FARTHEST_M = 3.0, 30.0
"""More distant depth edges hardly move."""
MOST = 500
"""Maximum number of evaluated depth edges per frame."""
_DESKEW = DeskewParams(enabled=True)
_NOT_CLEAR = "no lag between camera and LiDAR stands out as the best match; drive past parked cars"


class NoOffset(BadInput):
    """The drive does not determine the time offset between the sensors; the text says why."""


@dataclass(frozen=True)
class TimeOffset:
    """True exposure times of the images, relative to their timestamps."""

    camera_offset_ms: float
    """Offset to add to the images' timestamps; positive: images are later than their timestamps."""
    sigma_ms: float
    """Standard deviation."""
    sigmas: float
    """How far the best lag stands out from all lags."""
    frames: int
    """Number of frames with own motion, depth edges and an image."""
    warnings: tuple[str, ...] = ()
    """What the drive does not determine, as sentences."""


@dataclass(frozen=True, eq=False)
class MovingScene:
    """A frame's depth edges, its image edges, and own motion."""

    edges: EdgeScene
    """Depth edges of the deskewed sweep, and image edges."""
    aligned: Alignment
    """Projects them."""
    speed_mps: float
    """Forwards."""
    yaw_rate_radps: float
    """To the left."""
    skew_s: float
    """How much later the image is than the sweep, by their timestamps."""
    t_ns: int
    """The tick."""


def watch(
    frame_of: Callable[[int], Frame], count: int, params: Params, progress: Progress = silent
) -> tuple[list[MovingScene], list[SpeedPair]]:
    """The frames of a drive that help to determine the lag, and the speeds of car and LiDAR. An exception of
    ``progress`` ends it."""
    first = max(0, (count - LONGEST) // 2)
    looked = range(first, min(count, first + LONGEST))
    every = max(1, len(looked) // FRAMES)
    params = with_changes(params, {"motion.source": "lidar"})
    state, before = State(), State()
    scenes: list[MovingScene] = []
    speeds: list[SpeedPair] = []
    for number, index in enumerate(looked):
        progress(number, len(looked))
        frame = frame_of(index)
        before, (state, _) = state, step(state, only(frame, "lidar"), params)
        speeds += _speeds(before, state, frame)
        ego = frame.ego if frame.ego is not None and frame.ego.yaw_rate_radps is not None else state.own
        if number % every == 0 and ego is not None:
            scene = _scene(frame, ego, params.alignment)
            scenes += [scene] if scene is not None else []
    progress(len(looked), len(looked))
    return scenes, speeds


def _speeds(before: State, after: State, frame: Frame) -> list[SpeedPair]:
    """The speeds between two frames; empty if one is not known."""
    old, new = before.measured.odometry.poses, after.measured.odometry.poses
    if not old or len(new) < 2 or old[-1] is not new[-2] or frame.ego is None or before.t_ns is None:
        return []
    dt_s = (frame.t_ns - before.t_ns) / 1e9
    middle_ns = (frame.t_ns + before.t_ns) // 2
    return [SpeedPair(middle_ns, forward_m(old[-1], new[-1]) / dt_s, frame.ego.speed_mps, frame.ego.t_ns)]


def time_offset(scenes: Sequence[MovingScene]) -> TimeOffset:
    """The lag at which the scenes' depth edges match image edges best. Raises NoOffset if no lag stands out."""
    moving = [each for each in scenes if _moves(each)]
    if len(moving) < FEWEST_FRAMES:
        raise NoOffset(
            f"only {len(moving)} frames with an image while the car drives: the time between the sensors is unknown"
        )
    lags_s = np.arange(-REACH_MS, REACH_MS + STEP_MS / 2, STEP_MS) / 1e3
    strength = np.array([_strengths(each, lags_s) for each in moving])
    best, height = _best(strength.sum(axis=0), lags_s)
    if height < STANDS_OUT or abs(best) > (REACH_MS - 2 * STEP_MS) / 1e3:
        raise NoOffset(_NOT_CLEAR)
    blocks = np.array([each.t_ns // 1_000_000_000 for each in moving])
    groups = [np.flatnonzero(blocks == block) for block in np.unique(blocks)]
    groups = groups if len(groups) >= 8 else [np.array([k]) for k in range(len(moving))]
    rng = np.random.default_rng(0)
    sums = np.array([strength[group].sum(axis=0) for group in groups])
    drawn = [_best(sums[rng.integers(0, len(sums), len(sums))].sum(axis=0), lags_s)[0] for _ in range(BOOTSTRAPS)]
    sigma_ms = max(1e3 * float(np.std(drawn, ddof=1)), STEP_MS / 4)
    if sigma_ms > TOLD_MS:
        raise NoOffset(_NOT_CLEAR)
    warnings: tuple[str, ...] = (
        (f"the time offset is known only to ±{sigma_ms:.0f} ms",) if sigma_ms > UNSURE_MS else ()
    )
    speeds = np.array([each.speed_mps for each in moving])
    turning = np.array([abs(each.yaw_rate_radps) for each in moving])
    if np.std(speeds) < 1.0 and np.quantile(turning, 0.8) < SLOWEST_RADPS:
        cm = float(np.mean(speeds)) / 10.0
        warnings += (f"constant speed and no bends: a camera {cm:.1f} cm farther ahead looks like 1 ms later",)
    return TimeOffset(round(1e3 * best, 1), round(sigma_ms, 2), round(height, 1), len(moving), warnings)


def _scene(frame: Frame, ego: EgoState, params: AlignmentParams) -> MovingScene | None:
    aligned = resolve(params, frame.camera)
    sweep = deskew(frame.sweep, ego, _DESKEW)
    if sweep is None or frame.image is None or aligned is None:
        return None
    edges = edge_scene(sweep, frame.image.bgr)
    range_m = np.hypot(edges.points[:, 0], edges.points[:, 1])
    near = np.flatnonzero((range_m > NEAREST_M) & (range_m < FARTHEST_M))
    near = near[:: -(-len(near) // MOST) or 1]
    edges = EdgeScene(edges.points[near], edges.strength, edges.usual)
    skew_s = (frame.image.t_ns - sweep.t_ns) / 1e9 if frame.image.t_ns is not None else 0.0
    return MovingScene(edges, aligned, ego.speed_mps, ego.yaw_rate_radps or 0.0, skew_s, frame.t_ns)


def _moves(scene: MovingScene) -> bool:
    moves = abs(scene.speed_mps) > SLOWEST_MPS or abs(scene.yaw_rate_radps) > SLOWEST_RADPS
    return moves and len(scene.edges.points) > 0


def _strengths(scene: MovingScene, lags_s: F64) -> F64:
    """(L, Y) excess strength of image edges at the depth edges, by lag and yaw."""
    height, width = scene.edges.strength.shape
    points, found = scene.edges.points, np.zeros((len(lags_s), len(YAWS_DEG)))
    _, rays = scene.aligned.rays(np.array([[width / 2, height / 2], [width / 2 + 1, height / 2]]))
    per_px = abs(np.diff(np.arctan2(rays[:, 1], rays[:, 0]))[0])
    for k, lag in enumerate(lags_s):
        after = scene.skew_s + lag
        turn = -scene.yaw_rate_radps * after
        x = points[:, 0] - scene.speed_mps * after
        c, s = np.cos(turn), np.sin(turn)
        moved = np.column_stack([c * x - s * points[:, 1], s * x + c * points[:, 1], points[:, 2]])
        u, v = scene.aligned.project(moved).T
        is_in_rows = (v >= 0) & (v < height)
        u, row = u[is_in_rows], v[is_in_rows].astype(np.int64)
        usual = scene.edges.usual[row]
        for n, yaw_deg in enumerate(YAWS_DEG):
            shifted = u + np.radians(yaw_deg) / per_px
            seen = (shifted >= 0) & (shifted < width)
            met = scene.edges.strength[row[seen], shifted[seen].astype(np.int64)] - usual[seen]
            found[k, n] = float(met.sum(dtype=np.float64))
    return found


def _best(strength: F64, lags_s: F64) -> tuple[float, float]:
    """The best lag, s, at its best yaw, and by how many robust deviations it stands out. strength: (L, Y)."""
    curve = strength.max(axis=1)
    smooth = np.convolve(np.pad(curve, 1, mode="edge"), [0.25, 0.5, 0.25], mode="valid")
    at = int(np.argmax(smooth))
    usual = float(np.median(strength))
    noise = max(mad_sigma(strength - usual), 1e-6)
    low, high = max(at - 3, 0), min(at + 4, len(curve))
    a, b, _ = np.polyfit(lags_s[low:high], smooth[low:high], 2)
    best = -b / (2 * a) if a < 0 else lags_s[at]
    return float(np.clip(best, lags_s[low], lags_s[high - 1])), (float(smooth[at]) - usual) / noise
