"""Extends a track beyond its first and last frame, sweep by sweep.

From the frame at an end, set by a person or the pipeline, the vehicle is predicted over the ground (constant velocity;
a single frame is tried both standing and moving with the ego vehicle), and fitted to the points found there. It keeps
its size and its position relative to its points at the end, so what a person added beyond the points is preserved.
Where there are no points, the prediction is used, for at most ``_BLIND_S``; then the track ends.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.common.clips import begins_clip
from pipeline.common.geometry import Cuboid
from pipeline.labels.cuboids.aggregate import Sweeps
from pipeline.labels.cuboids.outline import misfit_m, outline, placed
from pipeline.labels.cuboids.points_of import Clustered, points_of
from pipeline.labels.headings import Pose, in_ego, over_ground
from pipeline.labels.link_identities import MAX_GAP_S
from pipeline.labels.model import Sighting
from pipeline.types import F32, F64

MOST_FRAMES = 100
"""Maximum frames per call and direction: a person reviews the result."""
FARTHEST_M = 60.0
"""Farther away, sixteen beams hit a car too rarely to track it."""
_FEWEST_POINTS = 6
_BLIND_S = 1.0
_NEAR_M, _NEAR_MPS = 0.6, 1.0
"""A cuboid found farther from the predicted position is a different vehicle; the limit increases with the time since
the last one."""
_LONGER_M = 0.9
_LOOSEST_M = 0.45
"""If points are farther from its sides on average, they do not belong to a vehicle of its size."""
_GAIN = 0.6
"""Weight of the measured position relative to the prediction: points on a bumper vary by 10 cm."""
_STEPS = 6
"""Number of last frames used for the velocity."""
_HELD_M = 0.4
"""Maximum offset of a hand-drawn cuboid from the points that is preserved."""
_FEWEST_COMMON = 3
"""Standing and moving are compared over the frames in which both were found; over fewer, either may fit by chance.
Afterwards, one that follows a row of bushes may well go farther than the parked car that is soon hidden."""
_ORIGIN = np.zeros((1, 2))


@dataclass(frozen=True)
class _At:
    """Position of the vehicle over ground at a time."""

    t_s: float
    xy: F64
    yaw_rad: float


@dataclass(frozen=True)
class _Run:
    """Result of tracking, and the deviation from the prediction in each frame with points."""

    found: tuple[Sighting, ...]
    off_m: tuple[float, ...]


def propagated(
    sightings: Sequence[Sighting], t_ns: Sequence[int], sweeps: Sweeps, poses: Mapping[int, Pose], *, forward: bool
) -> tuple[Sighting, ...]:
    """The frames after the last cuboid of a track, or before the first, in which it was found; none is a keyframe.

    Args:
        sightings: of the track, by ascending frame.
        t_ns: of every frame of the recording.
        sweeps: of every frame.
        poses: own motion, if known; otherwise standing objects are assumed to keep their position relative to us.
        forward: in time.
    """
    cuboids = [(each.frame, each.cuboid) for each in sightings if each.cuboid is not None]
    if not cuboids:
        return ()
    ends = cuboids[-_STEPS:] if forward else cuboids[:_STEPS][::-1]
    start, cuboid = ends[-1]
    step = 1 if forward else -1
    frames = _reachable(start, step, t_ns, poses)
    if len(cuboids) > 1:
        past = [_over_ground(each, _pose(poses, at), t_ns[at]) for at, each in ends if _joins(at, start, t_ns, poses)]
        return _carried(start, cuboid, past, frames, t_ns, sweeps, poses).found
    stands = _over_ground(cuboid, _pose(poses, start), t_ns[start])
    runs = [
        _carried(start, cuboid, past, frames, t_ns, sweeps, poses)
        for past in ([stands], [stands, _along_with_us(cuboid, start, frames, t_ns, poses)])
    ]
    common = min(len(each.off_m) for each in runs)
    if common < _FEWEST_COMMON:
        return max(runs, key=lambda each: len(each.off_m)).found
    return min(runs, key=lambda each: sum(each.off_m[:common])).found


def _carried(
    start: int,
    cuboid: Cuboid,
    past: list[_At],
    frames: Sequence[int],
    t_ns: Sequence[int],
    sweeps: Sweeps,
    poses: Mapping[int, Pose],
) -> _Run:
    """past: earlier positions, oldest first; a position ahead in time is a prediction."""
    foreseen_by = sorted(past, key=lambda each: abs(each.t_s - t_ns[start] / 1e9), reverse=True)
    held = _held_off(cuboid, sweeps(start))
    found: list[Sighting] = []
    seen = 0
    off_m: list[float] = []
    last_seen_s = t_ns[start] / 1e9
    track = list(foreseen_by)
    for frame in frames:
        t_s, pose = t_ns[frame] / 1e9, _pose(poses, frame)
        expected = _in_ego(_foreseen(track, t_s), pose, cuboid)
        if math.hypot(*expected.center[:2]) > FARTHEST_M or abs(t_s - last_seen_s) > _BLIND_S:
            break
        sweep = sweeps(frame)
        points = points_of(sweep, expected) if sweep is not None else None
        since_s = abs(t_s - track[-1].t_s)
        laid = _laid(expected, points, held, _NEAR_M + _NEAR_MPS * since_s)
        if laid is not None:
            last_seen_s, seen = t_s, len(found) + 1
            off_m.append(math.dist(laid.center[:2], expected.center[:2]))
        now = _mixed(expected, laid, _GAIN) if laid is not None else expected
        found.append(Sighting(frame, _stood(now, sweep), keyframe=False))
        track = [*track[-_STEPS + 1 :], _over_ground(now, pose, t_ns[frame])]
    return _Run(tuple(found[:seen]), tuple(off_m))


def _laid(expected: Cuboid, points: F32 | None, held: F64, near_m: float) -> Cuboid | None:
    """The cuboid fitted to its points; None if they are too few or belong to something else."""
    if points is None or len(points) < _FEWEST_POINTS:
        return None
    found = outline(points, _ORIGIN, expected.yaw_rad)
    if (found.span > np.array(expected.size[:2]) + _LONGER_M).any():
        return None
    x, y = np.array(placed(found, expected, expected.size[:2], found.seen)) + found.axes.T @ held
    laid = expected._replace(center=(float(x), float(y), expected.center[2]))
    off_m = math.dist(laid.center[:2], expected.center[:2])
    is_it = off_m <= near_m and misfit_m(points, _ORIGIN, laid) <= _LOOSEST_M
    return laid if is_it else None


def _held_off(cuboid: Cuboid, sweep: Clustered | None) -> F64:
    """(2,) offset of a cuboid from its points along its axes."""
    points = points_of(sweep, cuboid) if sweep is not None else None
    if points is None or len(points) < _FEWEST_POINTS:
        return np.zeros(2)
    found = outline(points, _ORIGIN, cuboid.yaw_rad)
    off = found.axes @ (np.array(cuboid.center[:2]) - placed(found, cuboid, cuboid.size[:2], found.seen))
    return np.asarray(np.where(np.abs(off) <= _HELD_M, off, 0.0))


def _foreseen(track: Sequence[_At], t_s: float) -> _At:
    """Linear extrapolation of the last positions."""
    last = track[-1]
    if len(track) < 2:
        return _At(t_s, last.xy, last.yaw_rad)
    times = np.array([each.t_s for each in track]) - last.t_s
    if np.ptp(times) <= 0.0:
        return _At(t_s, last.xy, last.yaw_rad)
    speed = np.polyfit(times, np.array([each.xy for each in track]), 1)[0]
    return _At(t_s, last.xy + speed * (t_s - last.t_s), last.yaw_rad)


def _reachable(start: int, step: int, t_ns: Sequence[int], poses: Mapping[int, Pose]) -> list[int]:
    """The frames beyond a frame in the same clip."""
    frames: list[int] = []
    at = start
    while len(frames) < MOST_FRAMES and 0 <= at + step < len(t_ns) and _joins(at + step, at, t_ns, poses):
        at += step
        frames.append(at)
    return frames


def _joins(a: int, b: int, t_ns: Sequence[int], poses: Mapping[int, Pose]) -> bool:
    """Whether two frames are in one clip and their positions over ground are comparable."""
    first, last = sorted((a, b))
    if any(begins_clip(t_ns[at], t_ns[at + 1], MAX_GAP_S) for at in range(first, last)):
        return False
    here, there = poses.get(a), poses.get(b)
    return (here.stretch if here else None) == (there.stretch if there else None)


def _along_with_us(
    cuboid: Cuboid, start: int, frames: Sequence[int], t_ns: Sequence[int], poses: Mapping[int, Pose]
) -> _At:
    """Its position in the next frame if it kept its distance."""
    at = frames[0] if frames else start
    return _over_ground(cuboid, _pose(poses, at), t_ns[at])


def _pose(poses: Mapping[int, Pose], frame: int) -> Pose:
    return poses.get(frame) or Pose(0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _over_ground(cuboid: Cuboid, pose: Pose, t_ns: int) -> _At:
    return _At(t_ns / 1e9, np.array(over_ground(cuboid, pose)), cuboid.yaw_rad + pose.yaw_rad)


def _in_ego(place: _At, pose: Pose, cuboid: Cuboid) -> Cuboid:
    x, y = in_ego(float(place.xy[0]), float(place.xy[1]), pose)
    yaw_rad = math.remainder(place.yaw_rad - pose.yaw_rad, math.tau)
    return Cuboid((x, y, cuboid.center[2]), cuboid.size, yaw_rad)


def _mixed(a: Cuboid, b: Cuboid, share: float) -> Cuboid:
    x, y = (u + share * (v - u) for u, v in zip(a.center[:2], b.center[:2], strict=True))
    return a._replace(center=(x, y, a.center[2]))


def _stood(cuboid: Cuboid, sweep: Clustered | None) -> Cuboid:
    """Placed on the road, if the road is known there."""
    if sweep is None:
        return cuboid
    x, y, _ = cuboid.center
    bottom = float(sweep.ground.height(np.array([[x, y]]))[0])
    return cuboid._replace(center=(x, y, bottom + cuboid.size[2] / 2)) if math.isfinite(bottom) else cuboid
