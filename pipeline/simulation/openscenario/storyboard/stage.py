"""What conditions look at and actions change: the entities on the road, variables, and states of the storyboard."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import cos, sin
from typing import NamedTuple

from pipeline.common.geometry import Cuboid
from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.roads.driven_road import DrivenRoad
from pipeline.simulation.openscenario.roads.free_line import overlaps
from pipeline.simulation.openscenario.roads.network import Network
from pipeline.simulation.openscenario.storyboard.movers import Mover
from pipeline.simulation.openscenario.storyboard.poses import pose_at
from pipeline.simulation.openscenario.storyboard.positions import RoadPlace
from pipeline.simulation.openscenario.storyboard.running import SpeedControl
from pipeline.simulation.openscenario.xml_files import XmlElement, shown
from pipeline.simulation.world.lines import WorldPose
from pipeline.types import F64

_KEPT_M = 0.05
_FASTEST_MPS = 300.0
"""Nothing closes a gap faster, not even measured along the middle of a bend: two cars at 250 km/h do so at 140 m/s."""


@dataclass
class PlayedScenario:
    """The state of a scenario that is being played."""

    road: DrivenRoad
    """Where it takes place."""
    movers: dict[str, Mover] = field(default_factory=dict)
    """Entities that have a place, by name."""
    ego: str = ""
    """Name of the ego vehicle."""
    left_out: set[str] = field(default_factory=set)
    """Entities that are not simulated, as the notes say; their actions do nothing."""
    controlled: set[str] = field(default_factory=set)
    """Entities to which the file gives a controller."""
    controls: list[SpeedControl] = field(default_factory=list)
    """Speeds that are controlled at every step."""
    watched: list[tuple[Mover, float, XmlElement]] = field(default_factory=list)
    """Entities whose offset others keep relative to it, that offset, and the actions that do."""
    variables: dict[str, str] = field(default_factory=dict)
    """Their present values."""
    states: dict[tuple[str, str], str] = field(default_factory=dict)
    """(type of a storyboard element, its name) → its present state, without the suffix ``State``."""
    changed: dict[tuple[str, str], tuple[str, float]] = field(default_factory=dict)
    """The same → its latest transition and when that was."""
    ambiguous: set[tuple[str, str]] = field(default_factory=set)
    """The same of names that several elements have, which no condition can refer to."""
    notes: list[str] = field(default_factory=list)
    """What is left out, each sentence once."""
    has_trajectory: bool = False
    """Whether the ego vehicle's way is that of its trajectory in the Init."""
    assigned: dict[str, str] = field(default_factory=dict)
    """Parameters that actions have set, and their present values."""
    t_s: float = 0.0
    """Simulation time."""
    _apart_until_s: dict[tuple[str, str], float] = field(default_factory=dict)
    """Two entities → the time before which they cannot touch."""

    def mover(self, name: str, at: XmlElement) -> Mover:
        """An entity by name."""
        if name in self.left_out:
            raise at.refusal(f"{shown(name)} is not simulated, so nothing can refer to it")
        if name not in self.movers:
            raise at.refusal(f"no entity {shown(name)!r} with a position")
        return self.movers[name]

    def watch_offset(self, other: Mover, at: XmlElement) -> None:
        """An action keeps its offset from ``other``, which must therefore keep its own."""
        self.watched.append((other, other.now(self.t_s)[1].d_m, at))

    def step_controls(self) -> None:
        """Set the controlled speeds for the step that begins now."""
        self.controls = [each for each in self.controls if not each.is_over(self.t_s)]
        for each in self.controls:
            each.step(self.t_s)
        for other, d_m, at in self.watched:
            if abs(other.now(self.t_s)[1].d_m - d_m) > _KEPT_M:
                raise at.refusal(
                    f"{at.tag} with continuous=true relative to {shown(other.body.name)}, which moves sideways "
                    "meanwhile, is not supported"
                )

    @property
    def network(self) -> Network:
        """All roads of the file."""
        return self.road.network

    def place_of(self, name: str, at: XmlElement, road: DrivenRoad | None = None) -> RoadPlace:
        """Where an entity is now on a road, by default the ego vehicle's; the nearest place if it is elsewhere."""
        return self.mover(name, at).place_on(road or self.road, self.t_s)

    def pose_of(self, name: str, at: XmlElement) -> WorldPose:
        """x, y and heading of an entity's reference point in the file's world."""
        return self.mover(name, at).pose(self.t_s)

    def follows(self, name: str, at: XmlElement, road: DrivenRoad) -> bool:
        """Whether an entity follows the lanes of a road."""
        mover = self.mover(name, at)
        return mover.line is None and mover.road is road

    def road_of(self, name: str, at: XmlElement) -> DrivenRoad:
        """The road whose lanes an entity follows."""
        mover = self.mover(name, at)
        return mover.road if mover.line is None else self.road

    def pose_at(self, position: XmlElement, scope: ParameterScope) -> WorldPose:
        """x, y and heading of a position in the file's world."""
        return pose_at(position, scope, self)

    def speed(self, name: str, at: XmlElement) -> float:
        """Its present speed."""
        return self.mover(name, at).now(self.t_s)[1].speed_mps

    def is_beyond_road(self, name: str, at: XmlElement) -> bool:
        """Whether an entity has left its way at one of its ends."""
        mover = self.mover(name, at)
        length_m = mover.road.length_m if mover.line is None else mover.line.length_m
        return not 0.0 <= mover.now(self.t_s)[0] <= length_m

    def note(self, sentence: str) -> None:
        """Remember that something is left out."""
        if sentence not in self.notes:
            self.notes.append(sentence)

    def register(self, kind: str, name: str) -> None:
        """A storyboard element exists, in standby."""
        if (kind, name) in self.states:
            self.ambiguous.add((kind, name))
        self.states[kind, name] = "standby"

    def enter(self, kind: str, name: str, state: str, transition: str) -> None:
        """A storyboard element changes its state."""
        self.states[kind, name] = state
        self.changed[kind, name] = (transition, self.t_s)

    def gap_m(self, one: str, other: str, kind: str, freespace: bool, at: XmlElement) -> float:
        """Distance between two entities along the ego vehicle's road (``longitudinal``), across it (``lateral``) or
        both (``euclidianDistance``): between their faces, or between their reference points."""
        if freespace:
            along, across = self._faces_apart_m(self.mover(one, at), self.mover(other, at))
        else:
            place, there = self.place_of(one, at), self.place_of(other, at)
            along, across = abs(place.s_m - there.s_m), abs(place.d_m - there.d_m)
        if kind == "longitudinal":
            return along
        if kind == "lateral":
            return across
        if kind in ("euclidianDistance", "cartesianDistance"):
            return float((along * along + across * across) ** 0.5)
        raise at.refusal(
            f"distance type {shown(kind)!r} is not supported; longitudinal, lateral, euclidianDistance are"
        )

    def _faces_apart_m(self, one: Mover, other: Mover) -> tuple[float, float]:
        """Distances between the faces of two entities along and across the road; 0 where they overlap."""
        first, second = self._extent(one), self._extent(other)
        along = max(abs(first.s_m - second.s_m) - (first.along_m + second.along_m) / 2, 0.0)
        return along, max(abs(first.d_m - second.d_m) - (first.across_m + second.across_m) / 2, 0.0)

    def _extent(self, mover: Mover) -> _Extent:
        length, width, _ = mover.body.size_m
        if self._is_along(mover):
            s_m, now = mover.now(self.t_s)
            return _Extent(s_m, now.d_m, length, width)
        x, y, heading = mover.pose(self.t_s, at_centre=True)
        s_m, d_m = self.road.project(x, y)
        turned = heading - self.road.heading(s_m)
        c, s = abs(cos(turned)), abs(sin(turned))
        return _Extent(s_m, d_m, length * c + width * s, length * s + width * c)

    def _is_along(self, mover: Mover) -> bool:
        """Whether an entity follows the lanes of the ego vehicle's road."""
        return mover.line is None and mover.road is self.road

    def closing_mps(self, one: str, other: str, at: XmlElement) -> float:
        """How fast two entities approach each other along the road."""
        first, second = self.mover(one, at), self.mover(other, at)
        s1, s2 = (self._extent(mover).s_m for mover in (first, second))
        speeds = self._along_mps(first) - self._along_mps(second)
        return speeds if s2 > s1 else -speeds

    def _along_mps(self, mover: Mover) -> float:
        """Speed along the ego vehicle's road."""
        speed_mps = mover.now(self.t_s)[1].speed_mps
        if self._is_along(mover):
            return mover.way * speed_mps
        x, y, heading = mover.pose(self.t_s)
        return speed_mps * cos(heading - self.road.heading(self.road.project(x, y)[0]))

    def touch(self, one: str, other: str, at: XmlElement) -> bool:
        """Whether two entities overlap."""
        movers = self.mover(one, at), self.mover(other, at)
        if self.t_s < self._apart_until_s.get((one, other), 0.0):
            return False
        gap_m = max(self._faces_apart_m(*movers))
        if gap_m > 0.0:
            self._apart_until_s[one, other] = self.t_s + gap_m / _FASTEST_MPS
            return False
        return all(map(self._is_along, movers)) or overlaps(*(self._footprint(mover) for mover in movers))

    def _footprint(self, mover: Mover) -> F64:
        """(4, 2) corners in the file's world."""
        x, y, heading = mover.pose(self.t_s, at_centre=True)
        return Cuboid((x, y, 0.0), mover.body.size_m, heading).footprint()


class _Extent(NamedTuple):
    """The rectangle along the road around an entity."""

    s_m: float
    """Of its middle."""
    d_m: float
    """The same."""
    along_m: float
    """Length along the road."""
    across_m: float
    """Width across it."""
