"""Simulates the sensors of a car, with faults, on a clock that tests control.

It needs no threads, sockets or waiting, so an hour of sensor data takes only the time to decode it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import count
from typing import Any, cast

import cv2
import numpy as np

from pipeline.params import SyncParams
from pipeline.replay.faults import Fault, disturb
from pipeline.replay.messages import Message
from pipeline.replay.nmea_writer import sentences
from pipeline.replay.wire import WireEvent, to_wire
from pipeline.sources.live.clock import HostClock
from pipeline.sources.live.config import LiveConfig
from pipeline.sources.live.devices.camera import CameraInput
from pipeline.sources.live.devices.gnss import GnssInput
from pipeline.sources.live.devices.lidar import LidarInput
from pipeline.sources.live.source import LiveSensors
from pipeline.types import Frame, GnssFix, Sweep

MS = 1_000_000
SECOND = 1_000_000_000
START = 1_700_000_123 * SECOND
_LOOK_EVERY_NS = 5 * MS
_HOUR_NS = 3600 * SECOND
CONFIG = {
    "lidar": {"position_port": None},
    "camera": {"url": "http://127.0.0.1:9/"},
    "gnss": {"udp_port": 9999},
    "ego": {"source": "gnss"},
}


class MovedClock(HostClock):
    """A clock that shows the time to which it is set."""

    def __init__(self) -> None:
        self.at_ns = START

    def now_ns(self) -> int:
        return self.at_ns

    def of_wall_ns(self, wall_ns: int) -> int:
        return wall_ns

    def ahead_ns(self) -> int:
        return 0


@dataclass(frozen=True)
class Taken:
    """A frame, and when it was taken, in seconds after the start. known: what was known of it before its sweep."""

    frame: Frame
    at_s: float
    known: Frame | None = None

    @property
    def age_s(self) -> float:
        return self.at_s - (self.frame.t_ns - START) / SECOND


def small_sweep(t_ns: int) -> Sweep:
    """One point per degree and ring, 20 m away."""
    azimuth = np.radians(np.arange(-179.0, 180.0))
    elevation = np.radians(np.arange(-15.0, 16.0, 2.0))
    a, e = (each.ravel() for each in np.meshgrid(azimuth, elevation))
    xyz = 20.0 * np.column_stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    points = np.column_stack([xyz, np.full(len(xyz), 7.0)]).astype(np.float32)
    return Sweep(t_ns, points, np.repeat(np.arange(16, dtype=np.uint8), len(azimuth)), 16)


def small_jpeg(shade: int = 90) -> bytes:
    return bytes(cv2.imencode(".jpg", np.full((48, 64, 3), shade, np.uint8))[1].tobytes())


def fix_at(t_ns: int) -> GnssFix:
    return GnssFix(t_ns, 48.0, 11.0, 500.0, 1.0, 20.0, "rtk_fixed", 0.01)


def messages(seconds: float, camera_hz: float = 30.0, gnss_hz: float = 10.0) -> list[Message]:
    """Messages of a LiDAR at 10 Hz, a camera and a GNSS receiver, each with its own phase."""
    jpeg, sweep = small_jpeg(), small_sweep(0)
    found = [Message(k * 100 * MS, "lidar", sweep) for k in range(round(seconds * 10))]
    found += [
        Message(round((k / camera_hz + 0.004) * SECOND), "camera", jpeg) for k in range(round(seconds * camera_hz))
    ]
    found += [Message(round((k / gnss_hz + 0.02) * SECOND), "gnss", fix_at(0)) for k in range(round(seconds * gnss_hz))]
    return sorted(found, key=lambda message: message.t_ns)


@cache
def on_the_wire(seconds: float, camera_hz: float) -> tuple[WireEvent, ...]:
    return tuple(to_wire(messages(seconds, camera_hz), START))


def sent(faults: Sequence[Fault], seconds: float = 4.0, camera_hz: float = 30.0) -> Iterator[WireEvent]:
    return disturb(on_the_wire(seconds, camera_hz), faults, START)


class Bench:
    """The live source and its inputs. ``source``: reports the health of the sensors after ``drive``."""

    def __init__(self, config: dict[str, Any] | None = None) -> None:
        self.clock = MovedClock()
        self.source = LiveSensors("live:bench", LiveConfig.model_validate(config or CONFIG), self.clock)

    def drive(self, events: Iterator[WireEvent], params: SyncParams | None = None, until_s: float = 0.0) -> list[Taken]:
        """Every frame, taken as soon as it is available."""
        taken: list[Taken] = []
        known: Frame | None = None

        def look_until(at_ns: int) -> None:
            nonlocal known
            while True:
                frame = self.source.next(0.0, params)
                if frame is not None:
                    taken.append(Taken(frame, (self.clock.at_ns - START) / SECOND, known))
                    known = None
                known = self.source.upcoming(params) or known
                if self.clock.at_ns >= at_ns:
                    return
                self.clock.at_ns = min(at_ns, self.clock.at_ns + _LOOK_EVERY_NS)

        for event in events:
            look_until(event.send_ns)
            self.give(event)
        look_until(max(self.clock.at_ns, START + round(until_s * SECOND)))
        return taken

    def give(self, event: WireEvent) -> None:
        """Pass on what the event's device reader would have read."""
        each, now_ns = self.source.inputs[event.sensor], self.clock.at_ns
        if event.sensor == "lidar":
            cast("LidarInput", each).receive(stamped(event), now_ns)
        elif event.sensor == "camera":
            cast("CameraInput", each).receive(event.payload, event.stamp_ns // 1000)
        else:
            is_garbage = isinstance(event.payload, bytes)
            said = event.payload if is_garbage else sentences(event.payload, event.stamp_ns)
            cast("GnssInput", each).receive(said, now_ns)


def stamped(event: WireEvent) -> bytes:
    stamp = (event.stamp_ns % _HOUR_NS // 1000).to_bytes(4, "little")
    return bytes(event.payload[:1200] + stamp + event.payload[1204:]) if len(event.payload) == 1206 else event.payload


def endless() -> Iterator[Message]:
    """Like ``messages``, but endless."""
    for second in count():
        for message in messages(1.0):
            yield message._replace(t_ns=message.t_ns + second * 1000 * MS)
