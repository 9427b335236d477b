"""Adds the tracks of further ranging sensors, such as a radar, to the objects that camera and LiDAR have."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline.common.fast_replace import evolve
from pipeline.fusion.rows import UNKNOWN, L, V, lidar_sigma_m, typical_footprint
from pipeline.ranging.further import Tracks
from pipeline.types import FusedObject, LidarTrack, Point2, RangedTrack, VisionTrack
from pipeline.types.sensors import joined

TrackIndices = dict[str, int]
"""One object: index of its track, by the sensor's letter."""

_GATE = 3.0
"""Standard deviations within which two positions may be of one object: 99.7 % of a normal distribution."""
_REFLECTS_M = 0.5
"""Standard deviation of where on a vehicle's face a sensor measures it: about half of a car's half width."""


class _Place(NamedTuple):
    """Where a track is."""

    position: Point2
    """Ego x, y."""
    sigma_m: Point2
    """Standard deviation along the line of sight and across it."""


def with_ranged(
    rows: list[TrackIndices], vision: Sequence[VisionTrack], lidar: Sequence[LidarTrack], ranged: Tracks
) -> list[TrackIndices]:
    """The rows with the indices of further sensors' tracks: of those at their place, one-to-one; every other track is
    a row of its own."""
    rows = [dict(row) for row in rows]
    places = [_place(lidar[row[L]] if L in row else vision[row[V]]) for row in rows]
    for letter, tracks in ranged.items():
        own = [_Place(track.position, track.sigma_m) for track in tracks]
        matched = _matches(places, own)
        for row, track in matched.items():
            rows[row][letter] = track
        alone = sorted(set(range(len(tracks))) - set(matched.values()))
        rows += [{letter: track} for track in alone]
        places += [own[track] for track in alone]
    return rows


def _place(track: LidarTrack | VisionTrack) -> _Place | None:
    """Across the line of sight, camera and LiDAR measure better than ``_REFLECTS_M``."""
    if isinstance(track, LidarTrack):
        return _Place(track.obstacle.closest_point[:2], (lidar_sigma_m(track), 0.0))
    return _Place(track.position, (track.sigma_m or 0.0, 0.0)) if track.position is not None else None


def _matches(places: Sequence[_Place | None], tracks: Sequence[_Place]) -> dict[int, int]:
    """Index of the place → index of the track of the same object; of all pairs, those that are closest together. An
    unmatched one costs as much as a pair at the gate, so that two poor pairs are not preferred to one that fits."""
    apart = np.array([[_apart(place, track) for track in tracks] for place in places])
    if not apart.size:
        return {}
    rows, columns = linear_sum_assignment(np.minimum(apart, _GATE))
    return {int(i): int(j) for i, j in zip(rows, columns, strict=True) if apart[i, j] < _GATE}


def _apart(place: _Place | None, track: _Place) -> float:
    """Distance of two positions in standard deviations, along the line of sight or across it, whichever is more."""
    if place is None:
        return math.inf
    range_m, turn_rad = math.hypot(*place.position), _bearing_rad(place) - _bearing_rad(track)
    along_m, across_m = range_m - math.hypot(*track.position), range_m * math.remainder(turn_rad, math.tau)
    along_sigma, across_sigma = (
        math.hypot(a, b, _REFLECTS_M) for a, b in zip(place.sigma_m, track.sigma_m, strict=True)
    )
    return max(abs(along_m) / along_sigma, abs(across_m) / across_sigma)


def _bearing_rad(place: _Place) -> float:
    return math.atan2(place.position[1], place.position[0])


def ranged_row(object_id: int, item: FusedObject | None, row: TrackIndices, ranged: Tracks) -> FusedObject:
    """An object with its further sensors' tracks. item: what camera and LiDAR know of it; None if they do not have
    it."""
    item = evolve(UNKNOWN, id=object_id, source="") if item is None else item
    for letter, tracks in ranged.items():
        if letter in row:
            item = _joined(item, letter, tracks[row[letter]])
    return item


def _joined(item: FusedObject, letter: str, track: RangedTrack) -> FusedObject:
    """The object with one more sensor's track. Its place, distance and velocity are this sensor's unless another
    ranging sensor has measured them in this frame, or has them as well and neither sees it."""
    both = evolve(
        item,
        source=joined(item.source, letter),
        seen_by=item.seen_by if track.carried else joined(item.seen_by, letter),
        hits=max(item.hits, track.hits),
        ranged_hits=max(item.ranged_hits, track.hits),
        ranged_steady=max(item.ranged_steady, track.steady),
    )
    if item.ranged_now or (item.ranged and track.carried):
        return both
    placed: dict[str, Any] = {
        "bev": item.bev if item.ranged else typical_footprint(track.position, item.label or "car"),
        "closest_point": (*track.position, 0.0),
        "distance_m": math.hypot(*track.position),
        "distance_sigma_m": track.sigma_m[0],
        "measured": not track.carried,
        "velocity_mps": track.velocity_mps if track.velocity_mps is not None else item.velocity_mps,
        "lidar_speed_sigma_mps": None if track.velocity_mps is not None else item.lidar_speed_sigma_mps,
        "height_from": None,
        "returns": 0,
    }
    return evolve(both, **placed)
