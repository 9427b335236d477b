"""The roads of an OpenDRIVE file and how they join."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import ceil, inf

import numpy as np
import numpy.typing as npt

from pipeline.simulation.openscenario.roads.lane_sections import Cubics, RoadLanes
from pipeline.simulation.openscenario.roads.plan_view import PlanView
from pipeline.simulation.openscenario.xml_files import OpenScenarioError, XmlElement, shown
from pipeline.types import F64

_SEARCH_STEP_M, _COARSE_STEP_M = 0.5, 5.0
_NEAR_M = 40.0
"""Roads whose reference lines are farther than the nearest by more than this have no lane there."""
_NO_JUNCTION = ("", "-1")


@dataclass(frozen=True)
class RoadEnd:
    """What a road's ``predecessor`` or ``successor`` names."""

    is_junction: bool
    """Otherwise a road."""
    id: str
    """Of the junction or road."""
    at_start: bool
    """Whether the road is met at its beginning; False at its end."""


@dataclass
class FileRoad:
    """One road. Its parts are read when they are needed: a network may have roads that are not driven on."""

    at: XmlElement
    """In the file."""

    @property
    def id(self) -> str:
        return self.at.attributes.get("id", "")

    @property
    def junction(self) -> str | None:
        """The junction that it leads through."""
        found = self.at.attributes.get("junction", "")
        return None if found in _NO_JUNCTION else found

    @property
    def is_left_hand(self) -> bool:
        """Whether traffic keeps to the left."""
        return self.at.attributes.get("rule", "RHT") == "LHT"

    @cached_property
    def line(self) -> PlanView:
        return PlanView(self.at)

    @cached_property
    def lanes(self) -> RoadLanes:
        return RoadLanes(self.at)

    def end(self, way: int) -> RoadEnd | None:
        """What follows at its end (way +1) or its beginning (−1); None: nothing."""
        found = self.at.find("link", "successor" if way > 0 else "predecessor")
        if found is None or not found.attributes.get("elementId"):
            return None
        attributes = found.attributes
        return RoadEnd(
            attributes.get("elementType", "road") == "junction",
            attributes["elementId"],
            attributes.get("contactPoint", "start") == "start",
        )

    def heights_m(self, s_m: F64) -> F64:
        """(N,) heights of the reference line."""
        profile = self.at.find("elevationProfile")
        return Cubics(profile.all("elevation") if profile is not None else []).at(s_m)

    def traffic_way(self, lane: int) -> int:
        """Direction of a lane's traffic along this road."""
        return -1 if (lane > 0) != self.is_left_hand else 1


class Network:
    """All roads of a file."""

    def __init__(self, root: XmlElement) -> None:
        self.at = root
        self.roads = {road.id: road for road in (FileRoad(each) for each in root.all("road"))}

    def road(self, number: str, at: XmlElement) -> FileRoad:
        """A road by its id; ``at`` is for messages."""
        if number not in self.roads:
            raise at.refusal(f"no road {shown(number)!r} in {self.at.file}")
        return self.roads[number]

    def through(self, junction: str) -> list[FileRoad]:
        """The roads that lead through a junction."""
        return [road for road in self.roads.values() if road.junction == junction]

    def project(self, x_m: float, y_m: float) -> tuple[FileRoad, float, float]:
        """The road nearest to a point of the file's world, with s and t there. Of roads that are equally near, one that
        is not inside a junction."""
        points, owners, roads = self._points
        away_m = np.hypot(points[:, 0] - x_m, points[:, 1] - y_m)
        near = np.unique(owners[away_m < away_m.min(initial=inf) + _NEAR_M]).tolist()
        best: tuple[float, FileRoad, float, float] | None = None
        for road in sorted((roads[number] for number in near), key=lambda each: each.junction is not None):
            s, t, away = self._on_road(road, x_m, y_m)
            if best is None or away < best[0] - 0.01:
                best = away, road, s, t
        if best is None:
            raise self.at.refusal("no road that can be simulated")
        return best[1:]

    @cached_property
    def _points(self) -> tuple[F64, npt.NDArray[np.intp], list[FileRoad]]:
        """(N, 2) points on the reference lines of all roads that can be simulated, the number of each one's road, and
        these roads."""
        roads, points, owners = list[FileRoad](), [np.zeros((0, 2))], [np.zeros(0, dtype=np.intp)]
        for road in self.roads.values():
            try:
                line, _ = road.line, road.lanes
            except OpenScenarioError:
                continue  # it cannot be driven on either
            s = np.linspace(0.0, line.length_m, max(ceil(line.length_m / _COARSE_STEP_M), 1) + 1)
            points.append(line.at(s)[:, :2])
            owners.append(np.full(len(s), len(roads)))
            roads.append(road)
        return np.concatenate(points), np.concatenate(owners), roads

    @staticmethod
    def _on_road(road: FileRoad, x_m: float, y_m: float) -> tuple[float, float, float]:
        """s, t and the distance from the road's driving lanes."""
        s = np.arange(0.0, road.line.length_m + _SEARCH_STEP_M, _SEARCH_STEP_M)
        line = road.line.at(s)
        nearest = int(np.argmin(np.hypot(line[:, 0] - x_m, line[:, 1] - y_m)))
        s_m, t_m = float(s[nearest]), 0.0
        for _ in range(5):
            px, py, heading, _bend = road.line.at(np.array([s_m]))[0].tolist()
            s_m += (x_m - px) * np.cos(heading) + (y_m - py) * np.sin(heading)
            t_m = (y_m - py) * np.cos(heading) - (x_m - px) * np.sin(heading)
        beyond = max(-s_m, s_m - road.line.length_m, 0.0)
        gaps = [abs(t_m - t) for lane in road.lanes.driven_at(s_m) for t in road.lanes.edges_at(lane, s_m)]
        inside = any(
            min(edges) <= t_m <= max(edges)
            for edges in (road.lanes.edges_at(lane, s_m) for lane in road.lanes.driven_at(s_m))
        )
        return s_m, t_m, beyond + (0.0 if inside else min(gaps, default=inf))
