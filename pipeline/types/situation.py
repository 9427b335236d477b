"""Arguments shared by many stages: the moment and, for stages that control the car, its situation."""

from __future__ import annotations

from typing import NamedTuple

from pipeline.types.frame import EgoState
from pipeline.types.objects import FusedObject
from pipeline.types.result import Cipv, Path

STANDS_MPS = 0.3
"""Odometry does not tell lower speeds from a standstill."""


class Moment(NamedTuple):
    """Time of a frame, and the car's motion in it."""

    t_ns: int
    """The frame's tick."""
    dt_s: float | None
    """Seconds since the previous frame, from the sensors' timestamps; None at the start and after a gap."""
    motion: EgoState | None
    """Own motion: measured, or predicted from the last measurement, however old (see ``motion.coasting``)."""
    ego: EgoState | None
    """The same while it is recent enough to drive by; then None."""

    @property
    def measured(self) -> EgoState | None:
        """Own motion if it was measured in this frame."""
        return self.motion if self.motion is not None and self.motion.coasting is None else None

    @property
    def speed_mps(self) -> float | None:
        """Own speed while it is recent enough to drive by."""
        return self.ego.speed_mps if self.ego is not None else None

    @property
    def stands(self) -> bool:
        """Whether the car stands, as far as is known. What changes in front of a standing car is traffic, not the
        road."""
        return self.ego is not None and abs(self.ego.speed_mps) < STANDS_MPS


class Situation(NamedTuple):
    """The input of ACC and emergency braking."""

    now: Moment
    """This frame's time and own motion."""
    path: Path
    """Where the car is going."""
    objects: tuple[FusedObject, ...]
    """All objects, each already judged against the path (``pipeline.decision.cipv``)."""
    lead: Cipv | None
    """The closest in-path vehicle; None without one."""

    def object(self, number: int | None) -> FusedObject | None:
        """The object with this id; None without one."""
        return next((each for each in self.objects if each.id == number), None)
