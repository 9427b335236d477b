"""The way of the ego vehicle through an OpenDRIVE file as one road of the simulator.

Its reference line is where lane 0 runs at the ego vehicle's start, and stays parallel to the ego vehicle's lane from
there on: along several roads, through junctions, where lanes begin and end. In left-hand traffic everything is
mirrored, as the simulator drives on the right.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import cos, sin

import numpy as np

from pipeline.simulation.openscenario.roads.network import FileRoad, Network
from pipeline.simulation.openscenario.roads.track import TrackedStretch
from pipeline.simulation.openscenario.xml_files import OpenScenarioError, XmlElement, shown
from pipeline.simulation.world.lines import WorldPose
from pipeline.simulation.world.roads import Road
from pipeline.types import F64

_SEARCH_STEP_M = 0.5
_CONVERGED_M = 1e-9
_MOST_STEPS, _SLOWEST = 20, 0.2
"""Of the search for the nearest place: steps, and by how much a bend may lengthen one."""
_PARALLEL_RAD = 0.09
"""Roads that are turned against a trajectory by more than this, 5°, are left by it."""


class OffTheWay(OpenScenarioError):
    """A place on a road that the ego vehicle does not drive along."""


@dataclass(frozen=True)
class DrivenRoad:
    """The road on which a scenario takes place."""

    network: Network
    """All roads of the file."""
    tracks: tuple[TrackedStretch, ...]
    """The stretches of the way, in its order."""
    road: Road
    """As simulated; its world begins at s = 0 with heading 0."""
    start: WorldPose
    """x, y and heading of s = 0 in the file's world."""
    hand: int
    """+1: left in the file is left in the simulator. −1: mirrored."""
    notes: tuple[str, ...] = ()
    """What is simulated in another way than the file says."""

    @property
    def length_m(self) -> float:
        return self.tracks[-1].ends_m

    @property
    def last_road(self) -> str:
        """Id of the road on which the way ends."""
        return self.tracks[-1].road.id

    @cached_property
    def road_ids(self) -> frozenset[str]:
        """The roads of the way."""
        return frozenset(track.road.id for track in self.tracks)

    def track_at(self, s_m: float) -> TrackedStretch:
        """The stretch at this distance along the way."""
        return next((track for track in self.tracks if s_m <= track.ends_m), self.tracks[-1])

    def heading(self, s_m: float) -> float:
        """Heading of the way in the file's world."""
        return self.start[2] + self.hand * float(self.road.to_world(s_m, 0.0)[0, 2])

    def height_m(self, s_m: float) -> float:
        """Height of the file's road there."""
        track = self.track_at(s_m)
        return float(track.road.heights_m(np.array([track.road_m(s_m)]))[0])

    def nearest_m(self, points: F64) -> tuple[F64, F64]:
        """(N,) s of the samples of the way nearest to (N, 2) points of the file's world, and (N,) their distances."""
        s, line = self._samples
        x0, y0, turned = self.start
        away = points - (x0, y0)
        x = away[:, 0] * cos(turned) + away[:, 1] * sin(turned)
        y = (away[:, 1] * cos(turned) - away[:, 0] * sin(turned)) * self.hand
        apart = np.hypot(line[:, 0] - x[:, None], line[:, 1] - y[:, None])
        nearest = apart.argmin(axis=1)
        return s[nearest], apart[np.arange(len(points)), nearest]

    def to_file_world(self, s_m: float, d_m: float) -> tuple[float, float]:
        """x and y in the file's world."""
        x, y, _ = self.road.to_world(s_m, d_m)[0].tolist()
        x0, y0, turned = self.start
        y *= self.hand
        return x0 + x * cos(turned) - y * sin(turned), y0 + x * sin(turned) + y * cos(turned)

    def project(self, x_m: float, y_m: float, near_m: float | None = None) -> tuple[float, float]:
        """s and d of the nearest place on the way to a point in the file's world; near_m: where to begin to look."""
        x0, y0, turned = self.start
        away_x, away_y = x_m - x0, y_m - y0
        x, y = away_x * cos(turned) + away_y * sin(turned), (away_y * cos(turned) - away_x * sin(turned)) * self.hand
        s_m, d_m = near_m, 0.0
        if s_m is None:
            s, line = self._samples
            s_m = float(s[int(np.argmin(np.hypot(line[:, 0] - x, line[:, 1] - y)))])
        for _ in range(_MOST_STEPS):  # Newton's steps converge within a micrometre
            px, py, heading = self.road.to_world(s_m, 0.0)[0].tolist()
            d_m = (y - py) * cos(heading) - (x - px) * sin(heading)
            step_m = (x - px) * cos(heading) + (y - py) * sin(heading)
            step_m /= max(1.0 - self.road.curvature_per_m(s_m) * d_m, _SLOWEST)
            s_m += step_m
            if abs(step_m) < _CONVERGED_M:
                break
        return s_m, d_m

    def place(self, road: FileRoad, s_m: float, t_m: float, at: XmlElement) -> tuple[float, float, int]:
        """s and d on the way of a place on a road of the file, and the direction of that road along the way. OffTheWay
        if the way does not lead there."""
        tracks = [track for track in self.tracks if track.road is road]
        track = min(tracks, key=lambda each: each.beyond(s_m)) if tracks else None
        off = OffTheWay(
            f"{at.file}, line {at.line}: {at.tag} lies on road {shown(road.id)} at s = {s_m:.4g} m, off the way of "
            "the ego vehicle"
        )
        if track is None or track.beyond(s_m) > 1e-6:
            raise off
        x, y = road.line.offset(np.array([s_m]), np.array([t_m]))[0].tolist()
        along, across = self.project(x, y, track.way_m(s_m))
        if track.is_free:
            turned = float(road.line.at(np.array([s_m]))[0, 2]) - self.heading(along)
            if abs(np.sin(turned)) > _PARALLEL_RAD:
                raise off
        return along, across, track.way

    def lanes_at(self, s_m: float) -> dict[int, float]:
        """Lane of the file → d of its middle, of all lanes on which motor vehicles drive here."""
        return self.track_at(s_m).lanes(s_m, self.hand)

    def left_of_file(self, s_m: float) -> int:
        """+1 if the left of the file's road is the left of the way there, else −1."""
        return self.hand * self.track_at(s_m).way

    def traffic_way(self, s_m: float, lane: int) -> int:
        """Direction of a lane's traffic along the way."""
        track = self.track_at(s_m)
        return track.way * track.road.traffic_way(lane)

    def lane_or_refusal(self, s_m: float, lane: int, at: XmlElement) -> float:
        """d of the middle of a lane of the file."""
        lanes = self.lanes_at(s_m)
        if lane not in lanes:
            known, track = ", ".join(map(str, sorted(lanes))), self.track_at(s_m)
            there = f"road {shown(track.road.id)} has no driving lane {lane} at s = {track.road_m(s_m):.4g} m"
            raise at.refusal(f"{there}; there are {known}")
        return lanes[lane]

    @cached_property
    def _samples(self) -> tuple[F64, F64]:
        s = np.arange(0.0, self.length_m + _SEARCH_STEP_M, _SEARCH_STEP_M)
        return s, self.road.to_world(s, 0.0)
