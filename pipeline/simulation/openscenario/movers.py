"""The entities of a scenario in motion: each has a script of the simulator, to which actions add speeds and lane
changes as the storyboard is played."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from math import cos, pi

from pydantic import ValidationError

from pipeline.common.files.user_file_errors import first_complaint
from pipeline.simulation.openscenario.entities import VehicleBody
from pipeline.simulation.openscenario.opendrive import DrivenRoad
from pipeline.simulation.openscenario.positions import RoadPlace, lane_at
from pipeline.simulation.openscenario.xml_files import XmlElement, shown
from pipeline.simulation.world.actors import LaneChange, Motion, Script, motion
from pipeline.simulation.world.roads import Road

_AT_ONCE_S = 1e-3
"""Duration of a jump in speed: a script's speed is piecewise linear."""
_PIECES = 8
"""Linear pieces in which a smooth change of speed is divided: within 1 % of the change."""
_SHAPES: dict[str, tuple[Callable[[float], float], float]] = {
    "linear": (lambda p: p, 1.0),
    "cubic": (lambda p: p * p * (3.0 - 2.0 * p), 1.5),
    "sinusoidal": (lambda p: (1.0 - cos(pi * p)) / 2.0, pi / 2.0),
}
"""Share of a change after a share of its time, and its highest rate relative to the mean rate."""
SHAPES = (*_SHAPES, "step")
"""Names of the dynamics that are supported."""


class Mover:
    """One entity. Its place is kept as the centre of the vehicle."""

    def __init__(self, body: VehicleBody, place: RoadPlace, road: DrivenRoad, at: XmlElement) -> None:
        self.body, self.way, self._road, self._at = body, place.way, road, at
        self._corners: list[tuple[float, float]] = [(0.0, 0.0)]
        self._changes: list[LaneChange] = []
        self.speed_version = 0  # counts the changes of speed
        self.place(place)
        self._known: tuple[float, Motion, float] | None = None

    def place(self, place: RoadPlace) -> None:
        """Put its reference point there at time 0."""
        self.way = place.way
        self.start_s_m = place.s_m + self.way * self.body.centre_m
        self._start_d_m = place.d_m
        self._lane, self._offset_m = self._lane_and_offset(place.d_m, self._at)
        self._renew(self._at)

    def now(self, t_s: float) -> tuple[float, Motion]:
        """s of its centre, and its motion, at time t."""
        if self._known is None or self._known[0] != t_s:
            moved = motion(self.script, self._road.road, t_s)
            s_m = self._road.road.line.advance(self.start_s_m, self.way * moved.travelled_m, self._start_d_m)
            self._known = (t_s, moved, s_m)
        return self._known[2], self._known[1]

    def place_now(self, t_s: float) -> RoadPlace:
        """The place of its reference point."""
        s_m, moved = self.now(t_s)
        return RoadPlace(s_m - self.way * self.body.centre_m, moved.d_m, self.way)

    def lane_now(self, t_s: float) -> int:
        """The nearest driving lane of the file."""
        return lane_at(self._road, self.now(t_s)[1].d_m)

    def change_speed(self, t_s: float, to_mps: float, shape: str, duration_s: float, at: XmlElement) -> float:
        """A change of speed that starts at time t and replaces what was planned; returns when it ends. Shape as in
        ``SHAPES``."""
        if not 0.0 <= to_mps <= 100.0:
            raise at.refusal(f"{shown(self.body.name)}: {to_mps:.4g} m/s; the simulator drives forward, up to 100 m/s")
        self.speed_version += 1
        self._corners, from_mps = self._corners_until(t_s), self.now(t_s)[1].speed_mps
        if t_s == 0.0 and (shape == "step" or duration_s == 0.0):
            self._corners = [(0.0, to_mps)]
            return self._renewed(0.0, at)
        if shape == "step" or duration_s < _AT_ONCE_S:
            self._corners += [(t_s, from_mps), (t_s + _AT_ONCE_S, to_mps)]
            return self._renewed(t_s, at)
        pieces = 1 if shape == "linear" else _PIECES
        share_after = _SHAPES[shape][0]
        self._corners += [
            (t_s + duration_s * i / pieces, from_mps + (to_mps - from_mps) * share_after(i / pieces))
            for i in range(pieces + 1)
        ]
        return self._renewed(t_s + duration_s, at)

    def change_lane(self, t_s: float, d_m: float, duration_s: float, at: XmlElement) -> float:
        """A move to another offset from the reference line; returns when it ends."""
        lane, offset = self._lane_and_offset(d_m, at)
        try:
            change = LaneChange(start_s=t_s, duration_s=duration_s, lane=lane, offset_m=offset)
        except ValidationError as error:
            raise at.refusal(first_complaint(error, LaneChange)) from None
        self._changes.append(change)
        return self._renewed(t_s + duration_s, at)

    def _corners_until(self, t_s: float) -> list[tuple[float, float]]:
        return self._corners[: bisect_left(self._corners, (t_s, -1.0))]

    def _renewed(self, ends_s: float, at: XmlElement) -> float:
        self._renew(at)
        return ends_s

    def _renew(self, at: XmlElement) -> None:
        self._known = None
        try:
            self.script = Script(
                speed_mps=dict(self._corners or [(0.0, 0.0)]),
                lane=self._lane,
                offset_m=self._offset_m,
                lane_changes=tuple(self._changes),
            )
        except ValidationError as error:
            raise at.refusal(f"{shown(self.body.name)}: {first_complaint(error, Script)}") from None

    def _lane_and_offset(self, d_m: float, at: XmlElement) -> tuple[int, float]:
        """The simulator's lane whose traffic drives in this direction, and the offset from its middle: a vehicle may
        drive on the other side."""
        road: Road = self._road.road
        lanes = range(-road.lanes_forward, 0) if self.way > 0 else range(1, road.lanes_oncoming + 1)
        if not lanes:
            raise at.refusal(f"{shown(self.body.name)} drives against a road that has no oncoming lane")
        lane = min(lanes, key=lambda each: abs(road.lane_offset_m(each) - d_m))
        return lane, d_m - road.lane_offset_m(lane)


def seconds_for(shape: str, dimension: str, value: float, change: float, speed_mps: float, at: XmlElement) -> float:
    """Duration of a change of speed (m/s) or offset (m) from its dynamics. speed_mps: mean speed meanwhile, for a
    distance."""
    if shape not in SHAPES:
        raise at.refusal(f"dynamicsShape={shown(shape)!r} is not supported; {', '.join(SHAPES)} are")
    if shape == "step" or change == 0.0:
        return 0.0
    if value < 0.0 or (value == 0.0 and dimension != "time"):
        raise at.refusal(f"{at.tag} value={value:g}: expected a positive number")
    if dimension == "time":
        return value
    if dimension == "rate":
        return abs(change) * _SHAPES[shape][1] / value
    if dimension == "distance":
        if speed_mps <= 0.0:
            raise at.refusal("a change along a distance needs a speed")
        return value / speed_mps
    raise at.refusal(f"dynamicsDimension={shown(dimension)!r} is not supported; time, rate and distance are")
