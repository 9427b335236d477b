"""What conditions look at and actions change: the entities on the road, variables, and states of the storyboard."""

from __future__ import annotations

from dataclasses import dataclass, field

from pipeline.simulation.openscenario.roads.driven_road import DrivenRoad
from pipeline.simulation.openscenario.storyboard.movers import Mover
from pipeline.simulation.openscenario.storyboard.positions import RoadPlace
from pipeline.simulation.openscenario.storyboard.running import SpeedControl
from pipeline.simulation.openscenario.xml_files import XmlElement, shown

_KEPT_M = 0.05


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
    t_s: float = 0.0
    """Simulation time."""

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

    def place_of(self, name: str, at: XmlElement) -> RoadPlace:
        """Where an entity is now."""
        return self.mover(name, at).place_now(self.t_s)

    def speed(self, name: str, at: XmlElement) -> float:
        """Its present speed."""
        return self.mover(name, at).now(self.t_s)[1].speed_mps

    def is_beyond_road(self, name: str, at: XmlElement) -> bool:
        """Whether an entity has left the way at one of its ends."""
        s_m = self.mover(name, at).now(self.t_s)[0]
        return not 0.0 <= s_m <= self.road.length_m

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
        """Distance between two entities along the road (``longitudinal``), across it (``lateral``) or both
        (``euclidianDistance``): between their faces, or between their reference points."""
        first, second = self.mover(one, at), self.mover(other, at)
        if freespace:
            (s1, now1), (s2, now2) = first.now(self.t_s), second.now(self.t_s)
            along = max(abs(s1 - s2) - (first.body.size_m[0] + second.body.size_m[0]) / 2, 0.0)
            across = max(abs(now1.d_m - now2.d_m) - (first.body.size_m[1] + second.body.size_m[1]) / 2, 0.0)
        else:
            place, there = first.place_now(self.t_s), second.place_now(self.t_s)
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

    def closing_mps(self, one: str, other: str, at: XmlElement) -> float:
        """How fast two entities approach each other along the road."""
        (s1, now1), (s2, now2) = (self.mover(name, at).now(self.t_s) for name in (one, other))
        speeds = self.mover(one, at).way * now1.speed_mps - self.mover(other, at).way * now2.speed_mps
        return speeds if s2 > s1 else -speeds

    def touch(self, one: str, other: str, at: XmlElement) -> bool:
        """Whether two entities overlap."""
        return (
            self.gap_m(one, other, "longitudinal", True, at) <= 0.0
            and self.gap_m(one, other, "lateral", True, at) <= 0.0
        )
