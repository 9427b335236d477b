"""Overlays a vehicle's points of several sweeps in the ego frame of one of them.

Sixteen beams show a few dozen points of a car in one sweep; a dozen sweeps show its outline. A standing vehicle's
points are moved by ego motion, those of a moving one by its own track. Both are tried, and the one that aligns the
points better is used, so nobody has to say whether the vehicle stands. Each sweep is then registered to those already
overlaid by point-to-point ICP (Besl and McKay 1992), in the plane, because beams hit a body at different heights in
each sweep. It is written here because Open3D's needs system libraries (X11, OpenGL, USB) that many machines lack.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from pipeline.common.geometry import Cuboid
from pipeline.labels.cuboids.points_of import Clustered, points_of
from pipeline.labels.headings import Pose
from pipeline.labels.model import Sighting
from pipeline.types import F32, F64

MOST_SWEEPS = 12
"""More sweeps blur the outline, because registration errors accumulate."""
_FEWEST_POINTS = 6
"""Minimum points of a sweep for registration."""
_MOST_REGISTERED = 150
"""Maximum points of a sweep that are used; a nearby car has a thousand, which add nothing."""
_REACHES_M = (0.5, 0.35)
"""Matching radii. If a sweep shows a side that previous ones did not, its points must not be pulled to the corner of
theirs: in the last pass only close points count."""
_CARRIED_REACHES_M = (0.3,)
"""With own motion, the initial guess is already this close."""
_ICP_STEPS, _ICP_STILL = 30, 1e-4
"""Maximum number of steps; change of a step, in metres and radians, below which it has converged."""
_CAP_M = 0.5
_MOST_MOVED_M, _MOST_TURNED_RAD = 0.8, math.radians(8.0)
"""A registration with a larger correction has slid along a side."""
_TIGHTER = 0.95
"""If a vehicle stands still, its points are more compact when aligned by own motion than when aligned by its track;
required ratio."""

Planar = tuple[float, float, float]
"""x, y, yaw of one frame relative to another, seen from above."""
Sweeps = Callable[[int], Clustered | None]
"""The sweep of a frame; None if there is none."""


@dataclass(frozen=True)
class Aggregate:
    """A vehicle's points from several sweeps."""

    frame: int
    """The frame whose ego frame is used for all data."""
    points: F32
    """(N, 4) x y z intensity."""
    eyes: F64
    """(K, 2) positions of the ego origin at each sweep, relative to the vehicle."""
    placed: Mapping[int, Planar]
    """Transform of each sweep's ego frame into this one that aligns the vehicle."""


def aggregated(
    sightings: Sequence[Sighting], frame: int, sweeps: Sweeps, poses: Mapping[int, Pose] | None = None
) -> Aggregate | None:
    """The points of a vehicle in the ego frame of a frame in which it has a cuboid; None without points.

    Args:
        sightings: of one track. Those without a cuboid are ignored.
        frame: the frame.
        sweeps: called for the frames that are used.
        poses: own motion, if known.
    """
    cuboids = {each.frame: each.cuboid for each in sightings if each.cuboid is not None}
    clouds: dict[int, F32] = {}
    for at in _chosen(sorted(cuboids), frame):
        sweep = sweeps(at)
        points = points_of(sweep, cuboids[at]) if sweep is not None else None
        if points is not None and len(points) >= _FEWEST_POINTS:
            clouds[at] = points
    if not clouds:
        return None
    along = {at: _between(cuboids[frame], cuboids[at]) for at in clouds}
    found = _laid(frame, clouds, along, _REACHES_M)
    carried = _by_own_motion(frame, clouds, poses or {})
    if carried is not None and len(clouds) > 1:
        standing = _laid(frame, clouds, carried, _CARRIED_REACHES_M)
        if _looseness_m(standing) < _TIGHTER * _looseness_m(found):
            found = standing
    points = np.vstack([_moved(clouds[at], found[at]) for at in found])
    return Aggregate(frame, points.astype(np.float32), np.array([found[at][:2] for at in found]), found.poses)


class _Laid(dict[int, Planar]):
    """Planar transforms by frame, and the clouds they apply to."""

    def __init__(self, clouds: Mapping[int, F32], poses: Mapping[int, Planar]) -> None:
        super().__init__(poses)
        self.clouds = clouds

    @property
    def poses(self) -> dict[int, Planar]:
        return dict(self)


def _chosen(frames: Sequence[int], frame: int) -> list[int]:
    """The frames nearest in time on both sides."""
    return sorted(sorted(frames, key=lambda each: abs(each - frame))[:MOST_SWEEPS])


def _laid(frame: int, clouds: Mapping[int, F32], guesses: Mapping[int, Planar], reaches_m: Sequence[float]) -> _Laid:
    """Each cloud registered to those that are nearer in time to the frame."""
    order = sorted(clouds, key=lambda each: abs(each - frame))
    first, *rest = order
    placed: dict[int, Planar] = {first: guesses[first]}
    model = _moved(clouds[first], guesses[first])[:, :2]
    for at in rest:
        placed[at] = _registered(clouds[at][:, :2].astype(np.float64), model, guesses[at], reaches_m)
        model = np.vstack([model, _moved(clouds[at], placed[at])[:, :2]])
    return _Laid(clouds, placed)


def _registered(points: F64, model: F64, guess: Planar, reaches_m: Sequence[float]) -> Planar:
    """Registers a cloud to others, seen from above; returns the guess if the result is not reliable."""
    moved, target = _turned(_some(points), guess), cKDTree(_some(model, MOST_SWEEPS))
    by: Planar = (0.0, 0.0, 0.0)
    for reach_m in reaches_m:
        by = _icp(moved, target, reach_m, by)
    middle = _turned(points, guess).mean(axis=0)
    shifted = _turned(middle, by) - middle
    if abs(by[2]) > _MOST_TURNED_RAD or float(np.hypot(*shifted)) > _MOST_MOVED_M:
        return guess
    x, y = _turned(np.array(guess[:2]), by)
    return float(x), float(y), guess[2] + by[2]


def _icp(points: F64, target: cKDTree, reach_m: float, by: Planar) -> Planar:
    """Point-to-point ICP in the plane from an initial transform; points farther than ``reach_m`` from the target are
    ignored."""
    known = target.data
    for _ in range(_ICP_STEPS):
        apart, nearest = target.query(_turned(points, by), distance_upper_bound=reach_m)
        near = np.isfinite(apart)
        count = np.count_nonzero(near)
        if count < 2:
            break
        here, there = points[near], known[np.asarray(nearest)[near]]
        # not np.mean, np.sum and np.allclose, which take twice as long as the query
        here_mean, there_mean = np.add.reduce(here, axis=0) / count, np.add.reduce(there, axis=0) / count
        here -= here_mean
        there -= there_mean
        turn_rad = math.atan2(
            float(np.add.reduce(here[:, 0] * there[:, 1] - here[:, 1] * there[:, 0])),
            float(np.add.reduce(here * there, axis=None)),
        )
        x, y = (there_mean - _turned(here_mean, (0.0, 0.0, turn_rad))).tolist()
        last, by = by, (x, y, turn_rad)
        if all(abs(a - b) <= _ICP_STILL for a, b in zip(last, by, strict=True)):
            break
    return by


def _by_own_motion(frame: int, clouds: Mapping[int, F32], poses: Mapping[int, Pose]) -> dict[int, Planar] | None:
    """Pose of each frame relative to the first one, if own motion is known between all of them."""
    here = poses.get(frame)
    there = {at: poses[at] for at in clouds if at in poses}
    if here is None or len(there) < len(clouds) or any(each.stretch != here.stretch for each in there.values()):
        return None
    c, s = math.cos(here.yaw_rad), math.sin(here.yaw_rad)
    return {
        at: (
            c * (each.x - here.x) + s * (each.y - here.y),
            c * (each.y - here.y) - s * (each.x - here.x),
            each.yaw_rad - here.yaw_rad,
        )
        for at, each in there.items()
    }


def _between(here: Cuboid, there: Cuboid) -> Planar:
    """The transform from a cuboid of another frame to this frame's."""
    turn_rad = math.remainder(here.yaw_rad - there.yaw_rad, math.tau)
    c, s = math.cos(turn_rad), math.sin(turn_rad)
    x, y = there.center[:2]
    return here.center[0] - (c * x - s * y), here.center[1] - (s * x + c * y), turn_rad


def _looseness_m(laid: _Laid) -> float:
    """Mean distance of a sweep's points from those of the others."""
    moved = [_moved(laid.clouds[at], laid[at])[:, :2] for at in laid]
    apart = []
    for index, each in enumerate(moved):
        # asked a few times only: a tree that is quick to build
        others = cKDTree(
            np.vstack([cloud for other, cloud in enumerate(moved) if other != index]),
            compact_nodes=False,
            balanced_tree=False,
        )
        apart.append(np.minimum(others.query(_some(each), distance_upper_bound=_CAP_M)[0], _CAP_M))
    return float(np.concatenate(apart).mean())


def _turned(points: F64, by: Planar) -> F64:
    c, s = math.cos(by[2]), math.sin(by[2])
    return np.asarray(points @ np.array([[c, s], [-s, c]]) + by[:2])


def _moved(points: F32, by: Planar) -> F64:
    out = points.astype(np.float64)
    out[:, :2] = _turned(out[:, :2], by)
    return out


def _some(points: F64, sweeps: int = 1) -> F64:
    """A subsample if there are more points than needed."""
    return points[:: -(-len(points) // (sweeps * _MOST_REGISTERED)) or 1]
