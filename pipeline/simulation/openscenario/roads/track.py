"""The reference line of a way on one stretch: parallel to the lane that is followed there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.simulation.openscenario.roads.free_line import FreeLine
from pipeline.simulation.openscenario.roads.network import FileRoad
from pipeline.simulation.openscenario.roads.way import Stretch
from pipeline.types import F64

_STEP_M = 1.0
_NARROW_M = 1.5
"""A lane that becomes narrower begins or ends here: its inner edge is followed, not its middle."""


@dataclass(frozen=True)
class TrackedStretch:
    """The reference line on one stretch, sampled in the direction of the way."""

    stretch: Stretch
    """The roads' part."""
    s_m: F64
    """(N,) s on the file's road, ascending or descending."""
    t_m: F64
    """(N,) t of the reference line there."""
    poses: F64
    """(N, 3) x, y and heading of the reference line, facing along the way, in the file's world."""
    lane_t_m: F64
    """(N,) t of the lane that is followed."""
    at_m: F64
    """(N,) distance along the way; zeros until it is known."""
    is_free: bool = False
    """Whether it follows a trajectory instead of the road, whose lanes are then taken along."""

    @property
    def road(self) -> FileRoad:
        return self.stretch.road

    @property
    def way(self) -> int:
        return self.stretch.way

    @property
    def ends_m(self) -> float:
        """Distance along the way where it ends."""
        return float(self.at_m[-1])

    def with_distances(self, at_m: F64) -> TrackedStretch:
        """The same with distances along the way."""
        return replace(self, at_m=at_m)

    def beyond(self, s_m: float) -> float:
        """How far a place on the road lies outside this stretch."""
        return max(float(self.s_m.min()) - s_m, s_m - float(self.s_m.max()), 0.0)

    def way_m(self, s_m: float) -> float:
        """Distance along the way at s of the road."""
        order = slice(None, None, self.way)
        return float(np.interp(s_m, self.s_m[order], self.at_m[order]))

    def road_m(self, at_m: float) -> float:
        """s of the road at a distance along the way."""
        s_m = float(np.interp(at_m, self.at_m, self.s_m))
        return min(max(s_m, 0.0), self.road.line.length_m) if self.is_free else s_m

    def lanes(self, at_m: float, hand: int) -> dict[int, float]:
        """Lane → d of its middle, of all lanes on which motor vehicles drive."""
        return {lane: (a + b) / 2 for lane, (a, b) in self.lane_edges(at_m, hand).items()}

    def lane_edges(self, at_m: float, hand: int, driven_only: bool = True) -> dict[int, tuple[float, float]]:
        """Lane → d of its edge towards lane 0 and of its outer edge."""
        s, lanes = self.road_m(at_m), self.road.lanes
        t = float(np.interp(at_m, self.at_m, self.t_m))
        side = hand * self.way
        found = {}
        for lane in self.stretch.section.lanes.values():
            if lane.is_driven or not driven_only:
                inner, outer = lanes.edges(self.stretch.section, lane.id, np.array([s]))
                found[lane.id] = side * (float(inner[0]) - t), side * (float(outer[0]) - t)
        return found


def track_along(stretch: Stretch, before: TrackedStretch | None, start_t_m: float | None = None) -> TrackedStretch:
    """The reference line on a stretch. It begins where the one before it ends, or at a t of the road."""
    s = _samples(stretch)
    lane_t = _followed_edge(stretch, s)
    line = stretch.road.line.at(s)
    if before is not None:
        x, y, _ = before.poses[-1].tolist()
        x0, y0, heading, _bend = line[0].tolist()
        start_t_m = (y - y0) * np.cos(heading) - (x - x0) * np.sin(heading)
    assert start_t_m is not None
    t = lane_t + (start_t_m - lane_t[0])
    slope = np.gradient(t, s) if len(s) > 1 else np.zeros(1)
    heading = line[:, 2] + np.arctan2(slope, 1.0 - line[:, 3] * t) + (np.pi if stretch.way < 0 else 0.0)
    poses = np.column_stack([stretch.road.line.offset(s, t), heading])
    return TrackedStretch(stretch, s, t, poses, lane_t, np.zeros(len(s)))


def track_of(line: FreeLine, stretch: Stretch, start_t_m: float, own_t_m: float) -> TrackedStretch:
    """The reference line beside a trajectory that leaves the road: as far to its side as lane 0 is at the start.
    start_t_m: t of lane 0 there; own_t_m: t of the trajectory."""
    at = np.append(np.arange(0.0, line.length_m, _STEP_M / 2), line.length_m)
    poses = line.line.to_world(at, stretch.way * (start_t_m - own_t_m))
    t, own_t = np.full(len(at), start_t_m), np.full(len(at), own_t_m)
    return TrackedStretch(stretch, stretch.from_m + stretch.way * at, t, poses, own_t, np.zeros(len(at)), is_free=True)


def _samples(stretch: Stretch) -> F64:
    """s every metre and where geometries meet."""
    low, high = sorted((stretch.from_m, stretch.to_m))
    joints = stretch.road.line.joints_m
    s = np.unique([low, high, *np.arange(low, high, _STEP_M), *joints[(joints > low) & (joints < high)]])
    s = s[np.concatenate([np.diff(s) > 1e-6, [True]])]
    return s if stretch.way > 0 else s[::-1]


def _followed_edge(stretch: Stretch, s_m: F64) -> F64:
    """t of the middle of the lane that is followed; of its inner edge where the lane begins or ends."""
    inner, outer = stretch.road.lanes.edges(stretch.section, stretch.lane, s_m)
    return inner if float(np.abs(outer - inner).min()) < _NARROW_M else (inner + outer) / 2.0
