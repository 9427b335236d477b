"""The way along the roads of a network: from where a vehicle starts, lane by lane, through junctions, in both
directions."""

from __future__ import annotations

from dataclasses import dataclass
from math import remainder, tau

import numpy as np

from pipeline.simulation.openscenario.roads.lane_sections import LaneSection
from pipeline.simulation.openscenario.roads.network import FileRoad, Network
from pipeline.simulation.openscenario.xml_files import OpenScenarioError, shown

AHEAD_M, BEHIND_M = 6_000.0, 1_000.0
"""How far roads are followed from the start."""
_EQUAL_RAD = 0.1
"""Two ways through a junction that turn by amounts closer than this are equally straight."""


@dataclass(frozen=True)
class Stretch:
    """The part of a way that lies in one lane section of one road."""

    road: FileRoad
    """On which it lies."""
    section: LaneSection
    """Its lanes there."""
    way: int
    """+1 along the road, −1 against it."""
    lane: int
    """The lane that is followed."""
    from_m: float
    """s where the stretch begins in the direction of the way."""
    to_m: float
    """s where it ends."""


class WayFinder:
    """Follows lanes."""

    def __init__(self, network: Network, wanted: frozenset[str]) -> None:
        """wanted: the roads to be taken at junctions, where one of them can be."""
        self._network, self._wanted = network, wanted
        self.notes: list[str] = []

    def follow(self, road: FileRoad, s_m: float, lane: int, way: int, reach_m: float) -> list[Stretch]:
        """The stretches from a place on, in the given direction, until the roads end, join badly or repeat."""
        found: list[Stretch] = []
        seen: set[tuple[str, int]] = set()
        there: tuple[FileRoad, int, int] | None = (road, way, lane)
        while there is not None and reach_m > 0.0 and (there[0].id, there[1]) not in seen:
            here, way, lane = there
            seen.add((here.id, way))
            try:
                added = self._along(here, s_m if not found else (0.0 if way > 0 else here.line.length_m), lane, way)
                there = self._next(here, way, added[-1].lane)
            except OpenScenarioError as error:
                if not found:
                    raise
                self.notes.append(f"The way ends before road {shown(here.id)}, which cannot be simulated ({error}).")
                break
            found += added
            reach_m -= sum(abs(each.to_m - each.from_m) for each in added)
        return found

    def _along(self, road: FileRoad, s_m: float, lane: int, way: int) -> list[Stretch]:
        """The stretches of one road."""
        sections, starts = road.lanes.sections, [*road.lanes.starts_m[1:], road.line.length_m]
        index = sections.index(road.lanes.section_at(s_m))
        found: list[Stretch] = []
        while 0 <= index < len(sections):
            section = sections[index]
            end = starts[index] if way > 0 else (section.from_m if index else 0.0)
            if found:
                before = found[-1]
                linked = before.section.lanes[lane].after if way > 0 else before.section.lanes[lane].before
                lane = _same_lane(section, linked, lane)
            found.append(Stretch(road, section, way, lane, s_m, end))
            s_m, index = end, index + way
        return found

    def _next(self, road: FileRoad, way: int, lane: int) -> tuple[FileRoad, int, int] | None:
        """The road after this one, the direction on it, and the lane that continues ours."""
        end = road.end(way)
        if end is None:
            return None
        if not end.is_junction:
            if end.id not in self._network.roads:
                return None
            there, there_way = self._network.roads[end.id], 1 if end.at_start else -1
            last = road.lanes.sections[-1 if way > 0 else 0].lanes[lane]
            linked = last.after if way > 0 else last.before
            first = there.lanes.sections[0 if there_way > 0 else -1]
            return there, there_way, _same_lane(first, linked, lane * way * there_way)
        choices = [
            _Choice(each, each_way, self._leads_to(each, each_way), *_linked(each, each_way, lane))
            for each in self._network.through(end.id)
            for each_way in (1, -1)
            if _comes_from(each, each_way, road, way)
        ]
        if not choices:
            return None
        best = min(choices, key=lambda each: (not each.is_wanted, not each.is_linked, each.turn_rad))
        rivals = [each for each in choices if (each.is_wanted, each.is_linked) == (best.is_wanted, best.is_linked)]
        if len(rivals) > 1:
            self.notes.append(
                f"At junction {shown(end.id)} several roads go on; the vehicles take the straightest, road "
                f"{shown(best.road.id)}."
            )
        return best.road, best.way, best.lane

    def _leads_to(self, road: FileRoad, way: int) -> bool:
        """Whether it is a wanted road, or the next one is."""
        after = road.end(way)
        return road.id in self._wanted or (after is not None and not after.is_junction and after.id in self._wanted)


@dataclass(frozen=True)
class _Choice:
    """One way through a junction."""

    road: FileRoad
    way: int
    is_wanted: bool
    lane: int
    is_linked: bool

    @property
    def turn_rad(self) -> float:
        """How much it turns, in steps, so that nearly equal ways are told apart by the order in the file."""
        ends = self.road.line.at(np.array([0.0, self.road.line.length_m]))[:, 2]
        return round(abs(remainder(float(ends[1] - ends[0]), tau)) / _EQUAL_RAD) * _EQUAL_RAD


def _comes_from(road: FileRoad, way: int, before: FileRoad, before_way: int) -> bool:
    """Whether a road begins where the one before it is left."""
    end = road.end(-way)
    return end is not None and not end.is_junction and end.id == before.id and end.at_start == (before_way < 0)


def _linked(road: FileRoad, way: int, lane: int) -> tuple[int, bool]:
    """The lane of a connecting road that continues ours, and whether a link says so."""
    first = road.lanes.sections[0 if way > 0 else -1]
    for each in first.lanes.values():
        if (each.before if way > 0 else each.after) == lane and each.is_driven:
            return each.id, True
    return _same_lane(first, None, lane), False


def _same_lane(section: LaneSection, linked: int | None, lane: int) -> int:
    """The linked lane, or else the one of the same number, or else the nearest on which vehicles drive."""
    for number in (linked, lane):
        if number is not None and number in section.lanes:
            return number
    driven = [each.id for each in section.lanes.values() if each.is_driven] or list(section.lanes)
    if not driven:
        raise OpenScenarioError("a lane section without lanes")
    return min(driven, key=lambda each: ((each > 0) != (lane > 0), abs(each - lane)))
