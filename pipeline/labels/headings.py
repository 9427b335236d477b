"""Determines which end of a proposed vehicle is its front.

A box around points is the same after half a turn, and a LiDAR of 16 beams cannot tell a bonnet from a boot. A vehicle's
motion over the ground can, because it drives forwards. A vehicle that stands in the ego lane faces in the direction of
the lane. One that stands elsewhere along the road is assumed to face in the direction of traffic on its side; this is a
guess and is marked as unknown: parked cars face either way (of the labelled ones to the left on KITTI drive 0009 and
Astyx, 77 % and 62 % face the ego vehicle).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from statistics import median

from pipeline.common.clips import begins_clip
from pipeline.common.geometry import Cuboid
from pipeline.labels.link_identities import MAX_GAP_S
from pipeline.labels.model import Heading, Sighting
from pipeline.params import MotionParams

_HELD_S = 1.0
"""Time for which a known own speed is used in place of an unknown one: no car's speed changes by more than a few m/s in
that time."""
_TRAVELLED_M = 2.0
"""Half a car's length: a box may move this far along a parked car as other sides become visible."""
_OWN_SHARE = 0.1
"""Share of our own way that is added to that: an error of own speed moves all standing objects."""
_FEWEST_STEPS = 2
"""A single step may be a switch between vehicles under the same id."""
_STEADY_SHARE = 0.8
"""For a moving vehicle, this share of the steps is in its direction; those of a flickering cluster are random."""
_LANE_M = 1.75
"""Half a lane: an object closer to our axis is on neither side."""
_ALONG = 0.5
"""Cosine of 60°: an object rotated by more than this stands across the road."""
_MOVING_MPS = MotionParams().moving_mps
_NEVER_NS = 2**63


@dataclass(frozen=True)
class Moment:
    """Own motion at a frame."""

    t_ns: int
    """The frame's tick."""
    speed_mps: float | None
    """Own speed, positive forwards; None if not measured."""
    yaw_rate_radps: float | None
    """Own yaw rate, positive to the left; None is treated as driving straight."""
    reach_m: float
    """How far ahead a vehicle in the path would be detected; 0 for not at all."""


@dataclass(frozen=True)
class Pose:
    """Pose of the ego frame by dead reckoning: comparable only within one stretch."""

    stretch: int
    """Number of the stretch of uninterrupted own motion."""
    x: float
    """Metres from the start of the stretch, along its initial heading."""
    y: float
    """Metres to the left of that."""
    yaw_rad: float
    """Rotation to the left since the start."""
    way_m: float
    """Distance driven since the start."""
    t_s: float
    """Time since the start."""


@dataclass(frozen=True)
class Travelled:
    """Motion of a track over ground."""

    along_m: float
    """Forwards along its own axis; negative for backwards."""
    proven: bool
    """Whether it moved steadily and farther than errors of boxes and ego motion can explain."""


def own_poses(moments: Mapping[int, Moment]) -> dict[int, Pose]:
    """By frame. A gap in the recording or in own motion starts another stretch."""
    frames = sorted(moments)
    speeds = _speeds(frames, moments)
    poses: dict[int, Pose] = {}
    stretch = 0
    for before, frame in pairwise([None, *frames]):
        assert frame is not None
        speed = speeds.get(frame)
        last = poses.get(before) if before is not None else None
        if speed is None:
            continue
        if last is None or before is None or begins_clip(moments[before].t_ns, moments[frame].t_ns, MAX_GAP_S):
            stretch += 1
            poses[frame] = Pose(stretch, 0.0, 0.0, 0.0, 0.0, 0.0)
            continue
        dt_s = (moments[frame].t_ns - moments[before].t_ns) / 1e9
        step_m = speed * dt_s
        turn_rad = (moments[frame].yaw_rate_radps or 0.0) * dt_s
        toward_rad = last.yaw_rad + turn_rad / 2
        poses[frame] = Pose(
            stretch,
            last.x + step_m * math.cos(toward_rad),
            last.y + step_m * math.sin(toward_rad),
            last.yaw_rad + turn_rad,
            last.way_m + abs(step_m),
            last.t_s + dt_s,
        )
    return poses


def faced(
    sightings: Sequence[Sighting], in_lane: Collection[int], poses: Mapping[int, Pose]
) -> tuple[tuple[Sighting, ...], Heading]:
    """The sightings of a track with their cuboids rotated to its heading, and the source of the heading; empty for a
    track without cuboids. in_lane: the frames in which it is in the ego path. A cuboid's yaw is assumed to be correct
    except for half turns."""
    aligned = _aligned(sightings, poses)
    if all(each.cuboid is None for each in aligned):
        return tuple(aligned), ""
    moved = travelled(aligned, poses)
    if moved.proven:
        return tuple(aligned if moved.along_m > 0 else map(_turned, aligned)), "motion"
    placed = [each.frame for each in aligned if each.cuboid is not None]
    if 2 * sum(frame in in_lane for frame in placed) > len(placed):
        return tuple(each if _faces_our_way(each) else _turned(each) for each in aligned), "lane"
    return tuple(aligned), "unknown"


def oncoming_side(tracks: Iterable[tuple[Sequence[Sighting], Heading]]) -> int:
    """1 if oncoming traffic drives on our left, −1 if on our right; 1 if there is none.

    tracks: as returned by ``faced``.
    """
    sides = [
        math.copysign(1.0, each.cuboid.center[1])
        for sightings, heading in tracks
        if heading == "motion"
        for each in sightings
        if each.cuboid is not None and math.cos(each.cuboid.yaw_rad) < -_ALONG
    ]
    return -1 if sum(sides) < 0 else 1


def guessed(sightings: Sequence[Sighting], side: int) -> tuple[Sighting, ...]:
    """A track of unknown heading gets the heading of traffic on its side of the road, if it stands along the road.
    side: of oncoming traffic, as returned by ``oncoming_side``."""
    placed = [each.cuboid for each in sightings if each.cuboid is not None]
    if not placed:
        return tuple(sightings)
    aside_m = side * median(cuboid.center[1] for cuboid in placed)
    ahead = median(math.cos(cuboid.yaw_rad) for cuboid in placed)
    if abs(aside_m) < _LANE_M or abs(ahead) < _ALONG or (ahead < 0) == (aside_m > 0):
        return tuple(sightings)
    return tuple(map(_turned, sightings))


def travelled(sightings: Sequence[Sighting], poses: Mapping[int, Pose]) -> Travelled:
    """Motion over ground. sightings: by ascending frame, with consistent headings."""
    along_m = own_m = time_s = 0.0
    steps: list[float] = []
    placed = [each for each in sightings if each.cuboid is not None and each.frame in poses]
    for a, b in pairwise(placed):
        at, to = poses[a.frame], poses[b.frame]
        if at.stretch != to.stretch or a.cuboid is None or b.cuboid is None:
            continue
        (ax, ay), (bx, by) = over_ground(a.cuboid, at), over_ground(b.cuboid, to)
        yaw_rad = b.cuboid.yaw_rad + to.yaw_rad
        step_m = (bx - ax) * math.cos(yaw_rad) + (by - ay) * math.sin(yaw_rad)
        along_m += step_m
        steps.append(step_m)
        own_m += to.way_m - at.way_m
        time_s += to.t_s - at.t_s
    agree = sum(step * along_m > 0 for step in steps)
    is_far = abs(along_m) >= _TRAVELLED_M + _OWN_SHARE * own_m and abs(along_m) >= _MOVING_MPS * time_s
    return Travelled(along_m, is_far and len(steps) >= _FEWEST_STEPS and agree >= _STEADY_SHARE * len(steps))


def _speeds(frames: Sequence[int], moments: Mapping[int, Moment]) -> dict[int, float | None]:
    """Own speed at every frame; if not measured, the one nearest in time within ``_HELD_S``."""
    found: dict[int, float | None] = {}
    away_ns: dict[int, int] = {}
    for order in (frames, frames[::-1]):
        last: Moment | None = None
        for frame in order:
            moment = moments[frame]
            last = moment if moment.speed_mps is not None else last
            apart_ns = abs(moment.t_ns - last.t_ns) if last is not None else _NEVER_NS
            if last is not None and apart_ns <= _HELD_S * 1e9 and apart_ns < away_ns.get(frame, _NEVER_NS):
                found[frame], away_ns[frame] = last.speed_mps, apart_ns
    return found


def _aligned(sightings: Sequence[Sighting], poses: Mapping[int, Pose]) -> list[Sighting]:
    """Every cuboid rotated so that its front is on the same side as in the previous sighting: nothing reverses between
    frames."""
    aligned: list[Sighting] = []
    last: Sighting | None = None
    for each in sightings:
        if each.cuboid is not None:
            if last is not None and math.cos(_turn_rad(last, each, poses)) < 0:
                each = _turned(each)
            last = each
        aligned.append(each)
    return aligned


def _turn_rad(a: Sighting, b: Sighting, poses: Mapping[int, Pose]) -> float:
    """Rotation to the left from one sighting to a later one, over ground if own motion between them is known."""
    assert a.cuboid is not None
    assert b.cuboid is not None
    turn_rad = b.cuboid.yaw_rad - a.cuboid.yaw_rad
    at, to = poses.get(a.frame), poses.get(b.frame)
    return turn_rad + to.yaw_rad - at.yaw_rad if at and to and at.stretch == to.stretch else turn_rad


def half_turned(cuboid: Cuboid) -> Cuboid:
    """The same box facing the other way; yaw in (−π, π]."""
    yaw_rad = cuboid.yaw_rad - math.pi if cuboid.yaw_rad > 0 else cuboid.yaw_rad + math.pi
    return Cuboid(cuboid.center, cuboid.size, yaw_rad)


def _turned(sighting: Sighting) -> Sighting:
    return sighting if sighting.cuboid is None else replace(sighting, cuboid=half_turned(sighting.cuboid))


def _faces_our_way(sighting: Sighting) -> bool:
    return sighting.cuboid is None or math.cos(sighting.cuboid.yaw_rad) >= 0


def over_ground(cuboid: Cuboid, pose: Pose) -> tuple[float, float]:
    """Its centre in the frame of the poses."""
    c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    x, y, _ = cuboid.center
    return pose.x + c * x - s * y, pose.y + s * x + c * y


def in_ego(x: float, y: float, pose: Pose) -> tuple[float, float]:
    """A place in the frame of the poses, in the ego frame of one of them."""
    dx, dy = x - pose.x, y - pose.y
    c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    return c * dx + s * dy, c * dy - s * dx
