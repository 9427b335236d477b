"""Runs the tracker of every further ranging sensor on its scan."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from pipeline.params import Params
from pipeline.types import Moment, RangedTrack, RangeScan
from pipeline.types.sensors import further_sensors

Tracks = Mapping[str, tuple[RangedTrack, ...]]
"""Tracks of each sensor, by its letter."""


class Tracker(Protocol):
    """Follows the detections of one sensor: the function that ``SensorKind.tracker`` names."""

    def __call__(
        self, state: Any, scan: RangeScan | None, now: Moment, params: Params
    ) -> tuple[Any, tuple[RangedTrack, ...]]:
        """The state for the next frame, and the tracks. state: of the last frame; None at the start and after a gap.
        scan: None if the sensor delivered nothing; then the tracks are carried."""
        ...


@dataclass(frozen=True)
class RangingState:
    """State of each sensor's tracker."""

    by_sensor: Mapping[str, Any] = field(default_factory=dict)
    """By ``SensorKind.name``; missing before the sensor's first frame."""


def follow(
    state: RangingState, scans: Mapping[str, RangeScan], now: Moment, params: Params
) -> tuple[RangingState, Tracks]:
    """The tracks of all further ranging sensors in this frame."""
    states, tracks = {}, {}
    for kind in further_sensors():
        before = state.by_sensor.get(kind.name)
        states[kind.name], tracks[kind.letter] = kind.track(before, scans.get(kind.name), now, params)
    return RangingState(states), tracks
