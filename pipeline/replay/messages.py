"""Splits a recording into the measurements of each sensor, in order of time."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from typing import NamedTuple

import cv2

from pipeline.sources.live.health import Sensor
from pipeline.types import CameraImage, EgoState, Frame, GnssFix, Sweep
from pipeline.types.source import RawPackets, Source

_JPEG_QUALITY = 95


class Message(NamedTuple):
    """What one sensor measured at one time."""

    t_ns: int
    """When it was measured, in the recording's time."""
    sensor: Sensor
    """Determines the type of ``value``."""
    value: Sweep | bytes | GnssFix | EgoState
    """A sweep or a captured LiDAR packet; a JPEG; a fix; ego motion."""


def of_recording(source: Source, first: int = 0, last: int | None = None) -> Iterator[Message]:
    """Frames ``first`` to ``last`` as messages. An image without a timestamp gets its frame's tick. Captured LiDAR
    packets are sent unchanged."""
    if isinstance(source, RawPackets):
        packets = (Message(t_ns, "lidar", payload) for t_ns, payload in source.packets())
        others = (message for message in _of_frames(source, first, last) if message.sensor != "lidar")
        return heapq.merge(packets, others, key=lambda message: message.t_ns)
    return _of_frames(source, first, last)


def _of_frames(source: Source, first: int, last: int | None) -> Iterator[Message]:
    for index in range(first, len(source) if last is None else min(last + 1, len(source))):
        yield from of_frame(source.frame(index))


def of_frame(frame: Frame) -> Iterator[Message]:
    """The frame's messages, ordered by time."""
    found: list[Message] = []
    if frame.sweep is not None:
        found.append(Message(frame.sweep.t_ns, "lidar", frame.sweep))
    if frame.image is not None:
        t_ns = frame.image.t_ns if frame.image.t_ns is not None else frame.t_ns
        found.append(Message(t_ns, "camera", jpeg_of(frame.image)))
    if frame.gnss is not None:
        found.append(Message(frame.gnss.t_ns, "gnss", frame.gnss))
    if frame.ego is not None:
        found.append(Message(frame.ego.t_ns, "ego", frame.ego))
    return iter(sorted(found, key=lambda message: message.t_ns))


def jpeg_of(image: CameraImage) -> bytes:
    """The camera's own JPEG if there is one, else encoded."""
    if image.encoded is not None and image.encoded.startswith(b"\xff\xd8"):
        return image.encoded
    _, jpeg = cv2.imencode(".jpg", image.bgr, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    return bytes(jpeg.tobytes())
