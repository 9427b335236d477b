"""Actors on the road, and their scripted positions at any time.

Speed is piecewise linear in time, so the distance driven is piecewise quadratic and exact. A lane change is a smooth
step (quintic, no jump in lateral acceleration) between the centres of two lanes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from pipeline.simulation.world.roads import Road, ScenarioPart

Extent = Annotated[float, Field(ge=0.2, le=30.0)]
ActorKind = Literal["car", "van", "truck", "bus", "motorcycle", "bicycle", "pedestrian"]
"""A bicycle has its rider on it."""
SIZES_M: dict[ActorKind, tuple[float, float, float]] = {
    "car": (4.5, 1.82, 1.48),
    "van": (5.3, 2.0, 2.05),
    "truck": (12.0, 2.5, 3.8),
    "bus": (11.5, 2.5, 3.1),
    "motorcycle": (2.2, 0.8, 1.45),
    "bicycle": (1.85, 0.55, 1.78),
    "pedestrian": (0.62, 0.52, 1.72),
}
"""Length, width and height of each kind as simulated, in metres. Deliberately different from
``pipeline.fusion.vehicle_sizes``, which the pipeline assumes for unmeasured sizes: equal values would make results too
good."""


_SLOPE_S = 0.05


class Brake(ScenarioPart):
    """Constant deceleration down to a speed, which is then held. It starts at a time, or when the gap between the ego
    origin and the vehicle's nearest face has first shrunk to ``at_gap_m``: this is the gap of the drive as scripted, so
    a closed loop meets the same traffic whatever its ego vehicle does."""

    at_s: float | None = Field(default=None, ge=0.0, le=3600.0)
    """When it starts; None if ``at_gap_m`` is used."""
    at_gap_m: float | None = Field(default=None, gt=0.0, le=1000.0)
    """Gap at which it starts; None if ``at_s`` is used."""
    decel_mps2: float = Field(gt=0.0, le=12.0)
    """Positive slows down."""
    to_mps: float = Field(default=0.0, ge=0.0, le=100.0)
    """Speed that is then held."""

    @model_validator(mode="after")
    def _one_start(self) -> Brake:
        if (self.at_s is None) == (self.at_gap_m is None):
            raise ValueError("braking starts either at_s or at_gap_m: give one of the two")
        return self


class Speeds(ScenarioPart):
    """speed_mps: time in seconds → speed, linear in between, constant outside. brake: replaces it from its start on."""

    speed_mps: dict[float, float] = Field(min_length=1)
    """Time in seconds → speed, linear in between, constant outside."""
    brake: Brake | None = None
    """Replaces the speeds from its start on."""

    @field_validator("speed_mps")
    @classmethod
    def _in_order(cls, speeds: dict[float, float]) -> dict[float, float]:
        if min(speeds.values()) < 0.0 or max(speeds.values()) > 100.0:
            raise ValueError("speeds must lie between 0 and 100 m/s")
        return dict(sorted(speeds.items()))

    @property
    def corners(self) -> list[tuple[float, float]]:
        """(time, speed) points with linear speed in between, including braking. A brake whose gap has not been
        converted to a time yet has no effect."""
        planned = list(self.speed_mps.items())
        if self.brake is None or self.brake.at_s is None:
            return planned
        at_s = self.brake.at_s
        speed = _speed_mps(planned, at_s)
        slower = min(self.brake.to_mps, speed)
        end = (at_s + (speed - slower) / self.brake.decel_mps2, slower)
        return [*(corner for corner in planned if corner[0] < at_s), (at_s, speed), end]

    def travelled_m(self, t_s: float) -> float:
        """Distance driven from time 0 to t."""
        return _travelled_m(self.corners, t_s)

    def speed_and_accel(self, t_s: float) -> tuple[float, float]:
        """m/s and m/s² at time t."""
        corners = self.corners
        slope = (_speed_mps(corners, t_s + _SLOPE_S) - _speed_mps(corners, t_s - _SLOPE_S)) / (2 * _SLOPE_S)
        return _speed_mps(corners, t_s), slope


class LaneChange(ScenarioPart):
    """One move to another lane."""

    start_s: float = Field(ge=0.0)
    """When it starts."""
    duration_s: float = Field(gt=0.2, le=30.0)
    """From lane centre to lane centre."""
    lane: int
    """Target lane; numbered as in OpenDRIVE."""
    offset_m: float | None = Field(default=None, ge=-20.0, le=20.0)
    """Offset to the road's left from the target lane's centre, afterwards; None keeps the script's."""
    until_s: float | None = Field(default=None, ge=0.0)
    """When it is broken off: the offset reached then is kept. None: it is completed."""

    def ends_s(self) -> float:
        """When it is over."""
        completed = self.start_s + self.duration_s
        return completed if self.until_s is None else min(max(self.until_s, self.start_s), completed)


class Script(Speeds):
    """Script of a vehicle's motion along the road."""

    lane: int
    """Lane at the start; numbered as in OpenDRIVE."""
    offset_m: float = Field(default=0.0, ge=-20.0, le=20.0)
    """Offset to the road's left from the centre of its lane."""
    lane_changes: tuple[LaneChange, ...] = ()
    """In order of time."""

    @model_validator(mode="after")
    def _one_change_at_a_time(self) -> Script:
        free_at = 0.0
        lane = self.lane
        for change in self.lane_changes:
            if change.start_s < free_at:
                raise ValueError(f"the lane change at {change.start_s:g} s starts before the previous one ends")
            if (change.lane > 0) != (lane > 0):
                raise ValueError(f"the lane change at {change.start_s:g} s leads to the other carriageway")
            free_at, lane = change.ends_s(), change.lane
        return self


class RoadUser(ScenarioPart):
    """Properties of a vehicle or a pedestrian."""

    id: int = Field(ge=1)
    """Unique in the scenario; also used in labels."""
    kind: ActorKind
    """Defines shape and usual size."""
    colour: str = Field(default="#8090a0", pattern="^#[0-9a-fA-F]{6}$")
    """#rrggbb."""
    size_m: tuple[Extent, Extent, Extent] | None = None
    """Length, width, height; None uses the kind's usual size."""

    def size(self) -> tuple[float, float, float]:
        return self.size_m or SIZES_M[self.kind]


class Actor(RoadUser, Script):
    """A road user that follows lanes of the road."""

    ahead_m: float = Field(ge=-1000.0, le=5000.0)
    """From the ego origin to its nearest face along the road at time 0; negative when its nearest face is behind."""
    alongside: bool = False
    """Whether the ego origin lies between its faces at time 0; ``ahead_m`` is then its front face along the road."""

    def direction(self) -> float:
        """+1 along the road, −1 against it."""
        return -1.0 if self.lane > 0 else 1.0

    def place_m(self, road: Road, ego_start_m: float, travelled_m: float) -> float:
        """s of its centre after a driven distance."""
        half = self.size()[0] / 2 if self.ahead_m >= 0.0 and not self.alongside else -self.size()[0] / 2
        d_m = road.lane_offset_m(self.lane) + self.offset_m
        return road.line.advance(ego_start_m + self.ahead_m + half, self.direction() * travelled_m, d_m)


@dataclass(frozen=True)
class Motion:
    """State of a script at one moment."""

    travelled_m: float
    """Distance driven since time 0."""
    d_m: float
    """Offset to the left of the reference line."""
    speed_mps: float
    """Longitudinal speed."""
    accel_mps2: float
    """Longitudinal acceleration."""
    d_rate_mps: float
    """Rate of change of ``d_m``."""
    d_accel_mps2: float
    """Rate of change of ``d_rate_mps``."""


def motion(script: Script, road: Road, t_s: float) -> Motion:
    """State of a script at time t."""
    speed, accel = script.speed_and_accel(t_s)
    d_m, d_rate, d_accel = _offset(script, road, t_s)
    return Motion(
        travelled_m=script.travelled_m(t_s),
        d_m=d_m,
        speed_mps=speed,
        accel_mps2=accel,
        d_rate_mps=d_rate,
        d_accel_mps2=d_accel,
    )


def _speed_mps(corners: list[tuple[float, float]], t_s: float) -> float:
    """Speed at time t, linear between (time, speed) corners in order, constant outside them."""
    before_s, before = corners[0]
    for after_s, after in corners:
        if t_s <= after_s:
            share = (t_s - before_s) / (after_s - before_s) if after_s > before_s else 1.0
            return before + (after - before) * share
        before_s, before = after_s, after
    return before


def _travelled_m(corners: list[tuple[float, float]], t_s: float) -> float:
    """Integral of the speed from 0 to t, by trapezoids over the corners in between: exact for linear pieces."""
    travelled_m, at_s, speed, before = 0.0, 0.0, _speed_mps(corners, 0.0), corners[0][1]
    for time_s, after in corners:
        if time_s >= t_s:
            break
        there, before = before + (after - before), after  # rounded as ``_speed_mps`` is
        if time_s > 0.0:
            travelled_m += (time_s - at_s) * (speed + there) / 2
            at_s, speed = time_s, there
    return travelled_m + (t_s - at_s) * (speed + _speed_mps(corners, t_s)) / 2


def _offset(script: Script, road: Road, t_s: float) -> tuple[float, float, float]:
    """d in metres, its rate and its acceleration."""
    here = road.lane_offset_m(script.lane) + script.offset_m
    for change in script.lane_changes:
        there = road.lane_offset_m(change.lane) + (script.offset_m if change.offset_m is None else change.offset_m)
        ends_s = change.ends_s()
        if t_s <= change.start_s:
            break
        p = (min(t_s, ends_s) - change.start_s) / change.duration_s
        if p < 1.0:
            step = p**3 * (10.0 - 15.0 * p + 6.0 * p * p)
            if t_s > ends_s:
                here += (there - here) * step
                continue
            rate = 30.0 * p * p * (1.0 - p) ** 2 / change.duration_s
            accel = 60.0 * p * (1.0 - p) * (1.0 - 2.0 * p) / change.duration_s**2
            return here + (there - here) * step, (there - here) * rate, (there - here) * accel
        here = there
    return here, 0.0, 0.0
