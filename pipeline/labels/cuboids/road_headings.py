"""Aligns proposed vehicles with the road if their shape nearly is.

The yaw of a box around a few points of a car has a random error of 3° to 5°. The road does not: a vehicle that drives
or is parked along it has the heading of the ego vehicle at the nearest point of its own trajectory. On KITTI drive 0009
that is within 0.7° of the labels (median), the boxes' own yaw within 3.6°; on Astyx 1.8° and 2.5°.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from statistics import median

from pipeline.common.geometry import Cuboid
from pipeline.labels.headings import Pose
from pipeline.labels.model import LabelTrack, Sighting

_ALONG_RAD = math.radians(15.0)
"""Cuboids rotated by more than this stand across the road or turn."""
_OFFSET_RAD = math.radians(10.0)
_FEW = 50
"""With this many sightings, half of the measured rotation of the sensors relative to the car is applied."""
_OWN_SHARE = 0.15
"""Share of the track's own heading that is kept: lanes are not exactly parallel."""


def along_road(tracks: Sequence[LabelTrack], poses: Mapping[int, Pose]) -> tuple[LabelTrack, ...]:
    """The tracks with their cuboids aligned with the road, keeping their direction. poses: own motion by frame."""
    every = [_beside_road(each, poses) for track in tracks for each in track.sightings if each.cuboid is not None]
    near = [turn for turn in every if abs(turn) < _OFFSET_RAD]
    # the rotation of the sensors relative to the car affects all sightings equally
    offset = median(near) * len(near) / (len(near) + _FEW) if near else 0.0
    return tuple(replace(track, sightings=_turned(track.sightings, poses, offset)) for track in tracks)


def _turned(sightings: Sequence[Sighting], poses: Mapping[int, Pose], offset: float) -> tuple[Sighting, ...]:
    turns = [_beside_road(each, poses) - offset for each in sightings if each.cuboid is not None]
    own = median(turns) if turns else 0.0
    if abs(own) >= _ALONG_RAD:
        return tuple(sightings)
    out = []
    for each in sightings:
        if each.cuboid is not None:
            turn = _OWN_SHARE * own - (_beside_road(each, poses) - offset)
            yaw_rad = math.remainder(each.cuboid.yaw_rad + turn, math.tau)
            each = replace(each, cuboid=each.cuboid._replace(yaw_rad=yaw_rad))
        out.append(each)
    return tuple(out)


def _beside_road(sighting: Sighting, poses: Mapping[int, Pose]) -> float:
    """Rotation of a cuboid to the left of the road's direction, in (−90°, 90°]: it may face either way."""
    assert sighting.cuboid is not None
    road_rad = _road_rad(sighting.cuboid, poses.get(sighting.frame), poses)
    return (sighting.cuboid.yaw_rad - road_rad + math.pi / 2) % math.pi - math.pi / 2


def _road_rad(cuboid: Cuboid, here: Pose | None, poses: Mapping[int, Pose]) -> float:
    """Direction of the road at a cuboid, in the ego frame of its sighting; straight ahead without own motion."""
    if here is None:
        return 0.0
    c, s = math.cos(here.yaw_rad), math.sin(here.yaw_rad)
    x, y, _ = cuboid.center
    there = (here.x + c * x - s * y, here.y + s * x + c * y)
    same = (each for each in poses.values() if each.stretch == here.stretch)
    nearest = min(same, key=lambda each: math.dist((each.x, each.y), there))
    return nearest.yaw_rad - here.yaw_rad
