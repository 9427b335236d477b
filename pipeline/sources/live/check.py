"""Listens to every sensor of a configuration for a while and reports its health."""

from __future__ import annotations

import time
from dataclasses import dataclass

from pipeline.ego_motion.from_gnss import yaw_rate_lag_s
from pipeline.sources.live.devices.lidar import LidarInput
from pipeline.sources.live.source import LiveSensors
from pipeline.types import StreamHealth

_LATE_S, _LOOK_S = 2.0, 0.1
"""How long a late sensor is waited for at the end, and how often it is polled."""
_ENOUGH_HZ = 5.0
"""Own motion at this rate is recent enough for every use."""


@dataclass(frozen=True)
class SensorReport:
    """State of one sensor."""

    health: StreamHealth
    """Rate, age and errors of its stream."""
    clock_offset_ms: float | None = None
    """Host time minus the sensor's, including the shortest transmission delay; for a VLP-16, whose clock counts from
    the full hour, at most half an hour either way. None if the sensor sends no time."""
    refused: int = 0
    """Messages that could not be used."""
    pps: str | None = None
    """State of the pulse per second reported by the LiDAR; None if it reports none."""
    skew_ms: float | None = None
    """Median of image time minus sweep time, over the ticks; None without both."""
    cost: str | None = None
    """Effect of a receiver's low rate if it provides the ego speed; None if there is none."""

    @property
    def is_good(self) -> bool:
        return self.health.state == "ok"


def check(source: LiveSensors, seconds: float) -> list[SensorReport]:
    """Open the sensors, process ticks for this time, and report. A sensor that is late at the end is waited for, 2 s at
    most. The sensors are released."""
    source.start()
    skews_ms = []
    end_s = time.monotonic() + seconds
    try:
        while (left_s := end_s - time.monotonic()) > 0.0 or (left_s > -_LATE_S and _is_one_late(source)):
            frame = source.next(max(left_s, _LOOK_S))
            if frame is not None and frame.sweep is not None and frame.image is not None and frame.image.t_ns:
                skews_ms.append((frame.image.t_ns - frame.sweep.t_ns) / 1e6)
        return [_report(source, health, skews_ms) for health in source.health()]
    finally:
        source.close()


def _is_one_late(source: LiveSensors) -> bool:
    """Whether a sensor that has delivered data is overdue, but not silent yet."""
    return any(health.state == "stale" for health in source.health())


def _report(source: LiveSensors, health: StreamHealth, skews_ms: list[float]) -> SensorReport:
    each = source.inputs.get(health.sensor)
    if each is None:
        return SensorReport(health, cost=_cost(health))
    return SensorReport(
        health,
        each.clock_offset_ms(),
        each.stats.refused.total(),
        each.pps if isinstance(each, LidarInput) else None,
        sorted(skews_ms)[len(skews_ms) // 2] if skews_ms and health.sensor == "camera" else None,
    )


def _cost(ego: StreamHealth) -> str | None:
    """Effect of own motion from a receiver."""
    if ego.state != "ok":
        return None
    if ego.rate_hz is None:
        return "too few fixes for a rate: listen longer with --seconds"
    if ego.rate_hz >= _ENOUGH_HZ - 0.1:
        return None
    lag_s = yaw_rate_lag_s(round(ego.rate_hz, 1))
    yaw_rate = "yaw rate is never available" if lag_s is None else f"yaw rate lags by another {lag_s:.1f} s"
    return f"ego speed is up to {1.0 / ego.rate_hz:.1f} s old, {yaw_rate}: set the receiver to {_ENOUGH_HZ:g} Hz"
