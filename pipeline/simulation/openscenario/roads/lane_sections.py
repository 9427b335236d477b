"""Lanes of an OpenDRIVE road: which there are at a distance along it, and where their edges run."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.xml_files import XmlElement
from pipeline.types import F64

_RAMPS = ("entry", "exit", "onRamp", "offRamp", "connectingRamp", "slipLane", "mwyEntry", "mwyExit")
_DRIVEN = frozenset(("driving", "bidirectional", "HOV", "bus", "taxi", *_RAMPS))
"""Types of lanes on which motor vehicles drive."""
_SCOPE = ParameterScope()


class Cubics:
    """A quantity along a road: cubic polynomials, each from a start on; constant 0 before the first."""

    def __init__(self, elements: list[XmlElement], start: str = "s", from_m: float = 0.0) -> None:
        """start: the attribute with the distance, to which ``from_m`` is added."""
        rows = [
            (_SCOPE.number(each, start, 0.0) + from_m, *(_SCOPE.number(each, key, 0.0) for key in "abcd"))
            for each in elements
        ]
        self._rows = np.array(sorted(rows)).reshape(-1, 5)

    @property
    def starts_m(self) -> F64:
        """(K,) where the polynomials begin."""
        return self._rows[:, 0]

    @property
    def is_constant(self) -> bool:
        return bool(not len(self._rows) or (not self._rows[:, 2:].any() and np.ptp(self._rows[:, 1]) == 0.0))

    def at(self, s_m: F64) -> F64:
        """(N,) values at (N,) distances."""
        if not len(self._rows):
            return np.zeros(len(s_m))
        index = np.searchsorted(self._rows[:, 0], s_m, side="right") - 1
        start, a, b, c, d = self._rows[np.maximum(index, 0)].T
        ds = np.maximum(s_m - start, 0.0)
        return np.where(index < 0, 0.0, a + ds * (b + ds * (c + ds * d)))


@dataclass(frozen=True)
class FileLane:
    """A lane of one section."""

    at: XmlElement
    """In the file."""
    id: int
    """Negative to the right of the reference line, positive to its left."""
    is_driven: bool
    """Whether motor vehicles drive on it."""
    before: int | None
    """The lane before it: in the section before, or on the road before the first one."""
    after: int | None
    """The lane after it."""
    width: Cubics
    """Along the road."""
    is_painted: bool
    """Whether a line is painted at its outer edge."""


class LaneSection:
    """The lanes of one stretch of a road."""

    def __init__(self, at: XmlElement) -> None:
        self.from_m = _SCOPE.number(at, "s")
        self.lanes = {
            lane.id: lane for name, sign in (("left", 1), ("right", -1)) for lane in self._side(at, name, sign)
        }
        center = at.find("center")
        self.is_painted = any(lane.is_painted for lane in self.lanes.values()) or any(
            _has_paint(lane) for lane in (center.all("lane") if center is not None else [])
        )

    def _side(self, at: XmlElement, name: str, sign: int) -> list[FileLane]:
        found = at.find(name)
        lanes = sorted(
            (_lane(each, self.from_m) for each in (found.all("lane") if found else [])), key=lambda x: abs(x.id)
        )
        if [lane.id for lane in lanes] != [sign * (i + 1) for i in range(len(lanes))]:
            raise (found or at).refusal(f"the lanes of the {name} side are not numbered from {sign} outwards")
        return lanes

    def beside(self, lane: int) -> list[int]:
        """The lanes from the reference line outwards to this one."""
        sign = 1 if lane > 0 else -1
        return [sign * (i + 1) for i in range(abs(lane))]


class RoadLanes:
    """All lanes of one road."""

    def __init__(self, road: XmlElement) -> None:
        lanes = road.one("lanes")
        self.sections = sorted((LaneSection(each) for each in lanes.all("laneSection")), key=lambda each: each.from_m)
        if not self.sections:
            raise lanes.refusal("no laneSection")
        self.centre = Cubics(lanes.all("laneOffset"))

    @cached_property
    def starts_m(self) -> list[float]:
        """Where the sections begin."""
        return [each.from_m for each in self.sections]

    def section_at(self, s_m: float) -> LaneSection:
        return self.sections[max(bisect_right(self.starts_m, s_m + 1e-9) - 1, 0)]

    def edges(self, section: LaneSection, lane: int, s_m: F64) -> tuple[F64, F64]:
        """t of the edge towards the reference line and of the outer edge of a lane, each (N,), at (N,) s."""
        sign = 1.0 if lane > 0 else -1.0
        inner = outer = self.centre.at(s_m)
        for each in section.beside(lane):
            inner, outer = outer, outer + sign * np.maximum(section.lanes[each].width.at(s_m), 0.0)
        return inner, outer

    def edges_at(self, lane: int, s_m: float) -> tuple[float, float]:
        """The same at one place."""
        inner, outer = self.edges(self.section_at(s_m), lane, np.array([s_m]))
        return float(inner[0]), float(outer[0])

    def driven_at(self, s_m: float) -> list[int]:
        """Lanes on which motor vehicles drive there, from right to left."""
        return sorted(lane.id for lane in self.section_at(s_m).lanes.values() if lane.is_driven)


def _lane(at: XmlElement, from_m: float) -> FileLane:
    number, is_driven = _SCOPE.integer(at, "id"), at.attributes.get("type") in _DRIVEN
    widths = at.all("width")
    if is_driven and not widths:
        raise at.refusal("a driving lane without width")
    link = at.find("link")
    before, after = (link.find(name) if link is not None else None for name in ("predecessor", "successor"))
    return FileLane(
        at,
        number,
        is_driven,
        _SCOPE.integer(before, "id") if before is not None else None,
        _SCOPE.integer(after, "id") if after is not None else None,
        Cubics(widths, "sOffset", from_m),
        _has_paint(at),
    )


def _has_paint(lane: XmlElement) -> bool:
    return any(mark.attributes.get("type", "none") != "none" for mark in lane.all("roadMark"))
