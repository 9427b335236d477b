"""Actions that take time: changes whose end is known when they start, and speeds that are controlled at every step."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from math import inf, sqrt
from typing import Protocol

from pipeline.simulation.openscenario.storyboard.movers import Mover
from pipeline.simulation.openscenario.xml_files import XmlElement

STEP_S = 0.02
"""Triggers are examined and speeds controlled at this interval: at 130 km/h a vehicle drives 0.7 m meanwhile."""
_STIFFNESS_PER_S2 = 0.4
"""Of a vehicle that keeps a distance, critically damped: it settles within about 7 s. The standard names the distance
and the limits, not the course towards them."""
_ARRIVED_M, _ARRIVED_MPS = 0.1, 0.1
_AT_ONCE_S = 0.1


class Running(ABC):
    """An action of one entity that takes time."""

    mover: Mover
    """Whom it moves."""

    @abstractmethod
    def is_over(self, t_s: float) -> bool:
        """Whether it is complete, or another took its place."""

    @abstractmethod
    def stop(self, t_s: float, at: XmlElement) -> None:
        """End it before it is complete: the speed or offset that was reached is held."""


@dataclass(frozen=True)
class SpeedChange(Running):
    """A planned course of speed."""

    mover: Mover
    """Whom it moves."""
    ends_s: float
    """When it is complete."""
    version: int
    """``Mover.speed_version`` since it began: a later action on the speed ends it."""

    def is_over(self, t_s: float) -> bool:
        return t_s >= self.ends_s - 1e-9 or self.mover.speed_version != self.version

    def stop(self, t_s: float, at: XmlElement) -> None:
        if not self.is_over(t_s):
            self.mover.change_speed(t_s, self.mover.now(t_s)[1].speed_mps, "step", 0.0, at)


@dataclass(frozen=True)
class OffsetChange(Running):
    """A planned change of the lateral offset."""

    mover: Mover
    """Whom it moves."""
    ends_s: float
    """When it is complete; infinite if the offset is kept until another action takes its place."""
    version: int
    """``Mover.lane_version`` since it began."""

    def is_over(self, t_s: float) -> bool:
        return t_s >= self.ends_s - 1e-9 or self.mover.lane_version != self.version

    def stop(self, t_s: float, at: XmlElement) -> None:
        if not self.is_over(t_s):
            self.mover.break_off_lane_change(t_s, at)


@dataclass(frozen=True)
class TrajectoryRun(Running):
    """A trajectory that is followed to its end."""

    mover: Mover
    """Whom it moves."""
    until_m: float
    """Distance travelled at its end."""
    version: int
    """``Mover.lane_version`` since it began."""

    def is_over(self, t_s: float) -> bool:
        return self.mover.now(t_s)[1].travelled_m >= self.until_m - 1e-9 or self.mover.lane_version != self.version

    def stop(self, t_s: float, at: XmlElement) -> None:
        """The rest is followed all the same: there is no other way to go."""


class SpeedLaw(Protocol):
    """Speeds as a function of what the entities do."""

    def next_mps(self, mover: Mover, t_s: float) -> float | None:
        """The speed one step later; None when the aim is reached."""


@dataclass
class SpeedControl(Running):
    """A speed that is controlled at every step."""

    mover: Mover
    """Whom it moves."""
    law: SpeedLaw
    """What the speed follows."""
    at: XmlElement
    """The action, for messages."""
    version: int = 0
    """``Mover.speed_version`` since it began."""
    is_done: bool = False
    """Whether its aim is reached or it was stopped."""

    def step(self, t_s: float) -> None:
        """Set the speed at the end of the step that begins now."""
        if self.is_over(t_s):
            return
        speed = self.law.next_mps(self.mover, t_s)
        if speed is None:
            self.is_done = True
        else:
            self.mover.steer_speed(t_s, t_s + STEP_S, min(max(speed, 0.0), 100.0), self.at)

    def is_over(self, t_s: float) -> bool:
        return self.is_done or self.mover.speed_version != self.version

    def stop(self, t_s: float, at: XmlElement) -> None:
        self.is_done = True


@dataclass(frozen=True)
class RelativeSpeed:
    """Speed of another entity, plus or times a number, after a transition from the speed at the start."""

    other: Mover
    """The entity whose speed counts."""
    value: float
    """In m/s, or a factor."""
    is_factor: bool
    """Whether the speed is multiplied by it, not added."""
    from_mps: float
    """Own speed when the transition starts."""
    start_s: float
    """When it starts."""
    duration_s: float
    """How long the transition takes."""
    share_of: Callable[[float], float]
    """Share of the transition after a share of its time."""

    def next_mps(self, mover: Mover, t_s: float) -> float:
        then_s = t_s + STEP_S
        speed = self.other.now(then_s)[1].speed_mps
        target = speed * self.value if self.is_factor else speed + self.value
        share = min((then_s - self.start_s) / self.duration_s, 1.0) if self.duration_s > 0.0 else 1.0
        return self.from_mps + (target - self.from_mps) * (self.share_of(share) if share < 1.0 else 1.0)


@dataclass
class Limits:
    """``DynamicConstraints``; infinite where the file sets none."""

    accel_mps2: float = inf
    """Highest acceleration."""
    decel_mps2: float = inf
    """Highest deceleration, positive."""
    accel_rate_mps3: float = inf
    """Fastest rise of the acceleration."""
    decel_rate_mps3: float = inf
    """Fastest fall of the acceleration, positive."""
    speed_mps: float = inf
    """Highest speed."""

    def next_mps(self, now_mps: float, wanted_mps2: float, before_mps2: float) -> tuple[float, float]:
        """Speed and acceleration one step later."""
        accel = min(
            max(wanted_mps2, before_mps2 - self.decel_rate_mps3 * STEP_S), before_mps2 + self.accel_rate_mps3 * STEP_S
        )
        accel = min(max(accel, -self.decel_mps2), self.accel_mps2)
        speed = min(max(now_mps + accel * STEP_S, 0.0), max(self.speed_mps, now_mps - self.decel_mps2 * STEP_S))
        return speed, (speed - now_mps) / STEP_S


@dataclass
class KeepDistance:
    """A distance or time gap to another entity, within limits, by a critically damped approach."""

    other: Mover
    """The entity from which the distance counts."""
    side: int
    """+1: ahead of the other along the way, −1: behind."""
    distance_m: float | None
    """None: a time gap."""
    time_gap_s: float
    """Driven at one's own speed, it is the distance."""
    extra_m: float
    """Added between reference points for the lengths of the vehicles and where their reference points are."""
    limits: Limits
    """Of the approach."""
    is_continuous: bool
    """Whether the distance is kept when it is reached."""
    accel_mps2: float = 0.0
    """In the step before, for the limits of its rate."""

    def next_mps(self, mover: Mover, t_s: float) -> float | None:
        own, other = mover.place_now(t_s), self.other.place_on(mover.road, t_s)
        own_mps, other_mps = mover.now(t_s)[1].speed_mps, self.other.now(t_s)[1].speed_mps
        gap_m = self.time_gap_s * own_mps if self.distance_m is None else self.distance_m
        error_m = mover.way * (other.s_m + self.side * gap_m + self.extra_m - own.s_m)
        closing_mps = mover.way * other.way * other_mps - own_mps
        if not self.is_continuous and abs(error_m) < _ARRIVED_M and abs(closing_mps) < _ARRIVED_MPS:
            return None
        wanted = _STIFFNESS_PER_S2 * error_m + 2.0 * sqrt(_STIFFNESS_PER_S2) * closing_mps
        speed, self.accel_mps2 = self.limits.next_mps(own_mps, wanted, self.accel_mps2)
        return speed


@dataclass(frozen=True)
class Arrive:
    """Reach a place on the way when another entity reaches its own, at a given speed if there is one: the least mean
    square of the acceleration. It is complete when the other is there."""

    other: Mover
    """The master of the synchronisation."""
    other_to_m: float
    """s of its target on the road or line that it follows."""
    to_m: float
    """The same of one's own target."""
    final_mps: float | None
    """Speed at the target; None: whatever results."""
    steady_s: float
    """For how long before the target the final speed is held."""
    tolerance_m: float
    """Distance from the targets at which both count as arrived."""

    def next_mps(self, mover: Mover, t_s: float) -> float | None:
        left_m, own_left_m = self.other.left_m(self.other_to_m, t_s), mover.left_m(self.to_m, t_s)
        other_mps, now_mps = self.other.now(t_s)[1].speed_mps, mover.now(t_s)[1].speed_mps
        if left_m <= 0.0 or max(left_m, own_left_m) <= self.tolerance_m:
            return None
        if other_mps <= 0.0:
            return now_mps
        time_s = left_m / other_mps - self.steady_s
        own_left_m -= self.steady_s * (self.final_mps or 0.0)
        if time_s < _AT_ONCE_S:
            return self.final_mps if self.steady_s > 0.0 else None
        if self.final_mps is None:
            accel = 3.0 * (own_left_m - now_mps * time_s) / time_s**2
        else:
            accel = (6.0 * own_left_m / time_s - 4.0 * now_mps - 2.0 * self.final_mps) / time_s
        return max(now_mps + accel * STEP_S, 0.0)
