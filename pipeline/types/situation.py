"""Arguments shared by many stages: the moment and, for stages that control the car, its situation."""

from __future__ import annotations

from typing import NamedTuple

from pipeline.types.frame import EgoState
from pipeline.types.objects import FusedObject
from pipeline.types.result import Cipv, Path


class Moment(NamedTuple):
    """When a frame is, and how the car moves in it."""

    t_ns: int
    """The frame's tick."""
    dt_s: float | None
    """Seconds since the frame before, from the sensors' own stamps; None at the start and after a gap."""
    motion: EgoState | None
    """Own motion: measured, or carried on from the last measurement however long ago (``motion.coasting`` says so)."""
    ego: EgoState | None
    """The same while it is recent enough to drive by; None after that."""

    @property
    def measured(self) -> EgoState | None:
        """Own motion if it was measured in this frame."""
        return self.motion if self.motion is not None and self.motion.coasting is None else None

    @property
    def speed_mps(self) -> float | None:
        """Own speed while it is recent enough to drive by."""
        return self.ego.speed_mps if self.ego is not None else None


class Situation(NamedTuple):
    """What ACC and emergency braking decide from."""

    now: Moment
    """This frame's time and own motion."""
    path: Path
    """Where the car is going."""
    objects: tuple[FusedObject, ...]
    """Every object, each judged against the path (``pipeline.decision.cipv``)."""
    lead: Cipv | None
    """The closest in-path vehicle; None without one."""
