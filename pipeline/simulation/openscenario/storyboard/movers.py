"""The entities of a scenario in motion: each has a script of the simulator, to which actions add speeds and lane
changes as the storyboard is played. An entity follows the lanes of a road, its own or that of the ego vehicle, or a
line of its own."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from copy import copy
from dataclasses import replace
from math import atan2, ceil, cos, pi

import numpy as np
from pydantic import ValidationError

from pipeline.common.files.user_file_errors import first_complaint
from pipeline.simulation.openscenario.entities import VehicleBody
from pipeline.simulation.openscenario.roads.driven_road import DrivenRoad
from pipeline.simulation.openscenario.roads.free_line import FreeLine, through_poses
from pipeline.simulation.openscenario.storyboard.positions import RoadPlace
from pipeline.simulation.openscenario.xml_files import XmlElement, shown
from pipeline.simulation.world.actors import LaneChange, Motion, Script, motion
from pipeline.simulation.world.lines import WorldPose
from pipeline.simulation.world.roads import Road

_AT_ONCE_S = 1e-3
"""Duration of a jump in speed: a script's speed is piecewise linear."""
_PIECES = 8
"""Linear pieces in which a smooth change of speed is divided: within 1 % of the change."""
_STEERED_MPS = 1e-3
_SAMPLE_S = 0.05
"""Between two places of a vehicle whose way is traced."""
_SHAPES: dict[str, tuple[Callable[[float], float], float]] = {
    "linear": (lambda p: p, 1.0),
    "cubic": (lambda p: p * p * (3.0 - 2.0 * p), 1.5),
    "sinusoidal": (lambda p: (1.0 - cos(pi * p)) / 2.0, pi / 2.0),
}
"""Share of a change after a share of its time, and its highest rate relative to the mean rate."""
SHAPES = (*_SHAPES, "step")
"""Names of the dynamics that are supported."""


class Mover:
    """One entity. Its place is kept as its centre."""

    def __init__(self, body: VehicleBody, place: RoadPlace, road: DrivenRoad, at: XmlElement) -> None:
        self.body, self.way, self.road, self._at = body, place.way, road, at
        self.line: FreeLine | None = None  # which it follows instead of the road
        self._line_start_m = 0.0
        self._corners: list[tuple[float, float]] = [(0.0, 0.0)]
        self._steered: list[tuple[float, float]] = []
        self._changes: list[LaneChange] = []
        self.speed_version = self.lane_version = 0  # count the changes of speed and of offset
        self._known: tuple[float, Motion, float] | None = None
        self.place(place)

    @classmethod
    def on_line(cls, body: VehicleBody, line: FreeLine, start_m: float, road: DrivenRoad, at: XmlElement) -> Mover:
        """An entity whose reference point follows a line, from s = start_m."""
        found = cls(body, RoadPlace(0.0, road.road.lane_offset_m(-1), 1), road, at)
        found.follow(line, start_m, 0.0)
        return found

    def place(self, place: RoadPlace) -> None:
        """Put its reference point there at time 0."""
        self.way, self.line = place.way, None
        self.start_s_m = place.s_m + self.way * self.body.centre_m
        self._start_d_m = place.d_m
        self._lane, self._offset_m = self._lane_and_offset(place.d_m, self._at)
        self._renew(self._at)

    def now(self, t_s: float) -> tuple[float, Motion]:
        """s of its centre, and its motion, at time t."""
        if self._known is None or self._known[0] != t_s:
            moved = motion(self.script, self.road.road, t_s)
            if self.line is not None:
                moved = replace(moved, d_m=0.0)
                s_m = self._line_start_m + moved.travelled_m + self.body.centre_m
            else:
                s_m = self.road.road.line.advance(self.start_s_m, self.way * moved.travelled_m, self._start_d_m)
            self._known = (t_s, moved, s_m)
        return self._known[2], self._known[1]

    def place_now(self, t_s: float) -> RoadPlace:
        """The place of its reference point on its road, or along its line."""
        s_m, moved = self.now(t_s)
        return RoadPlace(s_m - self.way * self.body.centre_m, moved.d_m, self.way)

    def place_on(self, road: DrivenRoad, t_s: float) -> RoadPlace:
        """The place of its reference point on any road: the nearest there if it is elsewhere."""
        if self.line is None and road is self.road:
            return self.place_now(t_s)
        x, y, heading = self.pose(t_s)
        s_m, d_m = road.project(x, y)
        return RoadPlace(s_m, d_m, 1 if cos(heading - road.heading(s_m)) >= 0.0 else -1)

    def left_m(self, to_m: float, t_s: float) -> float:
        """What its reference point still has to drive to s of its road or line; negative beyond it."""
        here = self.place_now(t_s)
        if self.line is not None or self.road.road.line.straight:
            return self.way * (to_m - here.s_m)
        return self.way * self.road.road.line.driven_m(here.s_m, to_m, here.d_m)

    def pose(self, t_s: float, at_centre: bool = False) -> WorldPose:
        """x, y and heading of its reference point, or of its centre, in the file's world."""
        s_m, moved = self.now(t_s)
        if not at_centre:
            s_m -= self.way * self.body.centre_m
        if self.line is not None:
            return self.line.pose(s_m)
        x, y = self.road.to_file_world(s_m, moved.d_m)
        drift = atan2(moved.d_rate_mps, moved.speed_mps) if moved.d_rate_mps else 0.0
        turned = self.way * self.road.hand * drift + (0.0 if self.way > 0 else pi)
        return x, y, self.road.heading(s_m) + turned

    def follow(self, line: FreeLine, start_m: float, t_s: float) -> None:
        """From time t on, its reference point follows a line, from s = start_m; what was driven until then is kept."""
        if t_s > 0.0:
            driven = self.driven_line(t_s, at_centre=False)
            line, start_m = driven.then(line.from_m(start_m)), driven.length_m - self.now(t_s)[1].travelled_m
        self.line, self._line_start_m, self.way, self._changes = line, start_m, 1, []
        self.lane_version += 1
        self._renew(self._at)

    def driven_line(self, until_s: float, at_centre: bool = True) -> FreeLine:
        """Where its centre or reference point moves from time 0 to a time, in the file's world."""
        if self.line is not None:
            start_m = self._line_start_m + (self.body.centre_m if at_centre else 0.0)
            return self.line.from_m(start_m).until_m(self.now(until_s)[1].travelled_m)
        times_s = np.linspace(0.0, until_s, max(ceil(until_s / _SAMPLE_S), 1) + 1).tolist()
        poses = np.array([self.pose(t_s, at_centre) for t_s in times_s])
        poses[:, 2] = np.unwrap(poses[:, 2])
        return through_poses(poses)

    def trial(self) -> Mover:
        """A copy on which a manoeuvre can be tried."""
        tried = copy(self)
        tried._corners, tried._changes, tried._steered = [*self._corners], [*self._changes], [*self._steered]
        return tried

    @property
    def changes_lanes(self) -> bool:
        """Whether it ever moves sideways on its road."""
        return bool(self._changes)

    def offsets_m(self) -> list[float]:
        """d at the start and after each lane change."""
        times_s = [0.0, *(change.ends_s() for change in self._changes)]
        return [motion(self.script, self.road.road, t_s).d_m for t_s in times_s]

    def change_speed(self, t_s: float, to_mps: float, shape: str, duration_s: float, at: XmlElement) -> float:
        """A change of speed that starts at time t and replaces what was planned; returns when it ends. Shape as in
        ``SHAPES``."""
        pieces = 1 if shape == "linear" else _PIECES
        from_mps = self._replan_speed(t_s)
        if shape == "step" or duration_s < _AT_ONCE_S:
            return self.plan_speed([(t_s, from_mps), (t_s + _AT_ONCE_S, to_mps)] if t_s else [(0.0, to_mps)], at, t_s)
        corners = [
            (t_s + duration_s * i / pieces, from_mps + (to_mps - from_mps) * share_of(shape, i / pieces))
            for i in range(pieces + 1)
        ]
        return self.plan_speed(corners, at, t_s + duration_s)

    def plan_speed(self, corners: list[tuple[float, float]], at: XmlElement, ends_s: float) -> float:
        """Speeds (time, m/s) from the first corner's time on, linear in between; returns when the change ends."""
        if not all(0.0 <= speed <= 100.0 for _, speed in corners):
            worst = max((speed for _, speed in corners), key=lambda speed: max(-speed, speed - 100.0))
            raise at.refusal(f"{shown(self.body.name)}: {worst:.4g} m/s; the simulator drives forward, up to 100 m/s")
        self._replan_speed(corners[0][0])
        self._corners = [*self._corners_until(corners[0][0]), *corners]
        self._renew(at)
        return ends_s

    def begin_control(self, t_s: float) -> None:
        """Hold the present speed, to be steered from now on."""
        speed_mps = self._replan_speed(t_s)
        self._corners.append((t_s, speed_mps))
        self._renew(self._at)

    def steer_speed(self, t_s: float, until_s: float, to_mps: float, at: XmlElement) -> None:
        """A speed that a control sets for the end of a step; linear from the present one. Corners that a straight line
        passes within 1 mm/s are left out."""
        if not self._steered:
            self._corners = [*self._corners_until(t_s), (t_s, self.now(t_s)[1].speed_mps)]
        start_s, start_mps = self._corners[-1 if not self._steered else -2]
        slope = (to_mps - start_mps) / (until_s - start_s)
        if self._steered and all(
            abs(start_mps + slope * (time - start_s) - speed) < _STEERED_MPS for time, speed in self._steered
        ):
            self._corners.pop()
        else:
            self._steered = []
        self._steered.append((until_s, to_mps))
        self._corners.append((until_s, to_mps))
        self._renew(at)

    def change_lane(self, t_s: float, d_m: float, duration_s: float, at: XmlElement) -> float:
        """A move to another offset from the reference line, which breaks off one that is not complete; returns when it
        ends."""
        if self.line is not None:
            raise at.refusal(f"{at.tag} of {shown(self.body.name)} is not supported: it follows no lane there")
        self.break_off_lane_change(t_s, at)
        lane, offset = self._lane_and_offset(d_m, at)
        try:
            change = LaneChange(start_s=t_s, duration_s=duration_s, lane=lane, offset_m=offset)
        except ValidationError as error:
            raise at.refusal(first_complaint(error, LaneChange)) from None
        self._changes.append(change)
        self._renew(at)
        return t_s + duration_s

    def break_off_lane_change(self, t_s: float, at: XmlElement) -> None:
        """Keep the offset that was reached, if a change is not complete."""
        self.lane_version += 1
        if self._changes and self._changes[-1].ends_s() > t_s:
            self._changes[-1] = self._changes[-1].model_copy(update={"until_s": t_s})
            self._renew(at)

    def _replan_speed(self, t_s: float) -> float:
        """Forget what was planned from time t on; returns the speed then."""
        speed_mps = self.now(t_s)[1].speed_mps
        self.speed_version += 1
        self._corners, self._steered = self._corners_until(t_s), []
        return speed_mps

    def _corners_until(self, t_s: float) -> list[tuple[float, float]]:
        return self._corners[: bisect_left(self._corners, (t_s, -1.0))]

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
        road: Road = self.road.road
        lanes = [each for each in road.lanes() if (each < 0) == (self.way > 0)]
        if not lanes:
            raise at.refusal(f"{shown(self.body.name)} drives against a road that has no oncoming lane")
        lane = min(lanes, key=lambda each: abs(road.lane_offset_m(each) - d_m))
        return lane, d_m - road.lane_offset_m(lane)


def share_of(shape: str, share: float) -> float:
    """Share of a change that is done after a share of its time. Shape as in ``SHAPES``, but for a step."""
    return _SHAPES[shape][0](share)


def seconds_for(shape: str, dimension: str, value: float, change: float, speed_mps: float, at: XmlElement) -> float:
    """Duration of a change of speed (m/s) or offset (m) from its dynamics. speed_mps: mean speed meanwhile, for a
    distance."""
    if shape not in SHAPES:
        raise at.refusal(f"dynamicsShape={shown(shape)!r} is not supported; {', '.join(SHAPES)} are")
    if shape == "step" or change == 0.0:
        return 0.0
    if dimension == "rate":
        value = abs(value)  # many files give a negative rate for braking
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
