"""Turns proposed cars that stand across the direction they were proposed in, as in parking lots.

Of a parked car, often only one face is seen, and a box around it lies along that face or along the road. Two things
tell that it stands across: a face wider than any car is its side, and cars beside each other are parallel. Neither is
applied to vehicles whose motion shows their heading.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import median

import numpy as np

from pipeline.common.geometry import Cuboid
from pipeline.labels.cuboids.aggregate import Sweeps, aggregated
from pipeline.labels.cuboids.outline import extent
from pipeline.labels.cuboids.points_of import whole_cluster
from pipeline.labels.headings import Pose
from pipeline.labels.model import LabelTrack, Sighting
from pipeline.types import VEHICLES

WIDEST_CAR_M = 2.2
"""No car's body is wider: the widest measure 2.05 m, and the edges of a cluster vary by a beam's spacing. Of 1,175
labelled cars (Astyx, its further frames, KITTI drives 0009 and 0052), 3 are."""
LONGEST_CAR_M = 5.5
"""No car is longer; longer ones in this class are vans (11 of the same 1,175), and clusters along a wall or hedge."""
_BESIDE_M = 4.5
"""Of 255 pairs of labelled vehicles with centres closer than this, 254 are parallel to within 20° (Astyx, its further
frames, KITTI drives 0009 and 0052); of 476 pairs up to 6 m apart, 475."""
_ACROSS_RAD = math.radians(45.0)
_FEWEST_POINTS = 5
"""Of the cluster whose sides are measured."""


@dataclass
class _AxisOfTrack:
    """A track and what is known of its direction."""

    track: LabelTrack
    is_known: bool
    """Whether its motion or a long side shows its axis."""

    @property
    def cuboids(self) -> dict[int, Cuboid]:
        """By frame."""
        return {each.frame: each.cuboid for each in self.track.sightings if each.cuboid is not None}


def turned_across(tracks: Sequence[LabelTrack], sweeps: Sweeps, poses: Mapping[int, Pose]) -> tuple[LabelTrack, ...]:
    """The tracks, with those that stand across turned by 90° about the corner nearest to the sensor.

    sweeps: of every frame. poses: own motion by frame, if known.
    """
    bodies = [
        _by_shape(track, sweeps, poses) if _may_turn(track) else _AxisOfTrack(track, _drives(track)) for track in tracks
    ]
    waiting = [each for each in bodies if not each.is_known and _may_turn(each.track)]
    known = [each for each in bodies if each.is_known]
    while found := [each for each in waiting if _follows(each, known)]:
        known = found
        waiting = [each for each in waiting if not each.is_known]
    return tuple(each.track for each in bodies)


def _may_turn(track: LabelTrack) -> bool:
    return track.label == "car" and track.heading != "motion"


def _drives(track: LabelTrack) -> bool:
    """Whether its motion shows the axis of a vehicle. People walk in any direction between cars."""
    return track.label in VEHICLES and track.heading == "motion"


def _by_shape(track: LabelTrack, sweeps: Sweeps, poses: Mapping[int, Pose]) -> _AxisOfTrack:
    """Turned if its points show a face across that is wider than a car, and consistently in all frames."""
    seen = {each.frame: _seen(each, sweeps) for each in track.sightings}
    with_points = {frame: each for frame, each in seen.items() if each is not None}
    if not with_points:
        return _AxisOfTrack(track, False)
    best = max(with_points, key=lambda frame: (with_points[frame].is_long, with_points[frame].points))
    if not with_points[best].is_alone:
        return _AxisOfTrack(track, False)
    track = _parallel(track, best, poses)
    whole = aggregated(track.sightings, best, sweeps, poses)
    cuboid = next(each.cuboid for each in track.sightings if each.frame == best)
    if whole is None or cuboid is None:
        return _AxisOfTrack(track, False)
    along, across = extent(whole.points, cuboid.yaw_rad)
    if _is_side(across, along):
        return _AxisOfTrack(_turned(track), True)
    return _AxisOfTrack(track, _is_side(along, across))


def _is_side(side_m: float, other_m: float) -> bool:
    """Whether the longer of two extents is a car's length."""
    return other_m <= WIDEST_CAR_M < side_m <= LONGEST_CAR_M


@dataclass(frozen=True)
class _InSweep:
    """A vehicle in one sweep."""

    points: int
    """Number of its points."""
    is_long: bool
    """Whether exactly one of its sides is longer than a car is wide."""
    is_alone: bool
    """Whether its cluster is no longer than a car."""


def _seen(sighting: Sighting, sweeps: Sweeps) -> _InSweep | None:
    sweep = sweeps(sighting.frame)
    points = whole_cluster(sweep, sighting.cuboid) if sweep is not None and sighting.cuboid is not None else None
    if points is None or len(points) < _FEWEST_POINTS or sighting.cuboid is None:
        return None
    sides = extent(points, sighting.cuboid.yaw_rad)
    return _InSweep(len(points), _is_side(float(sides.max()), float(sides.min())), float(sides.max()) <= LONGEST_CAR_M)


def _parallel(track: LabelTrack, best: int, poses: Mapping[int, Pose]) -> LabelTrack:
    """Cuboids that are across the one of the best frame are turned: a vehicle does not change its axis."""
    cuboids = {each.frame: each.cuboid for each in track.sightings if each.cuboid is not None}
    off = {
        frame for frame, each in cuboids.items() if _is_across(each, cuboids[best], _own_turn_rad(best, frame, poses))
    }
    return replace(track, sightings=tuple(_turn(each) if each.frame in off else each for each in track.sightings))


def _own_turn_rad(a: int, b: int, poses: Mapping[int, Pose]) -> float:
    """Own rotation to the left between two frames; 0 if unknown."""
    at, to = poses.get(a), poses.get(b)
    return to.yaw_rad - at.yaw_rad if at and to and at.stretch == to.stretch else 0.0


def _follows(body: _AxisOfTrack, known: Sequence[_AxisOfTrack]) -> bool:
    """Whether known ones beside it show its direction; it is turned accordingly, and known from now on."""
    mine = body.cuboids
    beside = [
        _is_across(mine[frame], cuboid)
        for each in known
        for frame, cuboid in each.cuboids.items()
        if frame in mine and math.dist(mine[frame].center[:2], cuboid.center[:2]) < _BESIDE_M
    ]
    if not beside:
        return False
    if median(beside) > 0.5:
        body.track = _turned(body.track)
    body.is_known = True
    return True


def _is_across(cuboid: Cuboid, other: Cuboid, own_turn_rad: float = 0.0) -> bool:
    turn_rad = cuboid.yaw_rad + own_turn_rad - other.yaw_rad
    return abs(math.remainder(turn_rad, math.pi)) > _ACROSS_RAD


def _turned(track: LabelTrack) -> LabelTrack:
    return replace(track, sightings=tuple(map(_turn, track.sightings)), heading="unknown")


def _turn(sighting: Sighting) -> Sighting:
    """Turned by 90° about the corner nearest to the ego origin, which the sensors saw."""
    if sighting.cuboid is None:
        return sighting
    (x, y, z), size, yaw_rad = sighting.cuboid
    axes = np.array([[math.cos(yaw_rad), math.sin(yaw_rad)], [-math.sin(yaw_rad), math.cos(yaw_rad)]])
    middle = axes @ np.array([x, y])
    toward = -np.sign(middle)  # the near side along each axis
    half = np.array(size[:2]) / 2
    x, y = axes.T @ (middle + toward * (half - half[::-1]))
    turned = math.remainder(yaw_rad + math.pi / 2, math.tau)
    return replace(sighting, cuboid=Cuboid((float(x), float(y), z), size, turned))
