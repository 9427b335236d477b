"""The inputs for repeated runs over a drive: its frames without image pixels.

The networks process an image before the pipeline runs (``pipeline.detection.detect``), and no stage needs its pixels. A
run with other parameters therefore needs only about 300 KB per frame, and no network, disk or simulator.
"""

from __future__ import annotations

import threading
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.types import CameraImage, Frame

_LIMIT_BYTES = 384e6
"""About 1200 frames of a real VLP-16. Frames beyond that are read from the source again in every run."""


def without_pixels(frame: Frame) -> Frame:
    """The frame with a placeholder image of the same size and timestamp that takes no memory."""
    if frame.image is None:
        return frame
    blank = np.broadcast_to(np.zeros((), np.uint8), frame.image.bgr.shape)
    return replace(frame, image=CameraImage(frame.image.t_ns, blank))


class InputStore:
    """The frames of one recording as inputs of ``step``, by index. Any thread.

    It fills until it is full and then keeps its content: runs process a drive from its beginning, so if the drive does
    not fit, evicting the oldest frames would always evict the ones that are needed next.
    """

    def __init__(self, limit_bytes: float = _LIMIT_BYTES) -> None:
        self._limit = limit_bytes
        self._lock = threading.Lock()
        self._bytes = 0
        self._frames: dict[int, Frame] = {}
        self._names: dict[int, str] = {}

    def __len__(self) -> int:
        return len(self._frames)

    def get(self, index: int) -> Frame | None:
        """The frame without pixels; None if it is not stored."""
        return self._frames.get(index)

    def name(self, index: int) -> str | None:
        """Name of a frame in the recording; None if it has not been read yet. Also known for frames that are not
        stored."""
        return self._names.get(index)

    def offer(self, frame: Frame) -> None:
        """Store a frame with its detections, if there is room and it is not stored yet."""
        self._names[frame.index] = frame.name
        if frame.index in self._frames:
            return
        light = without_pixels(frame)
        cost = _bytes_of(light)
        with self._lock:
            if light.index not in self._frames and self._bytes + cost <= self._limit:
                self._frames[light.index] = light
                self._bytes += cost


def _bytes_of(frame: Frame) -> int:
    sweep, boxes, lanes = frame.sweep, frame.raw_boxes, frame.raw_lanes
    arrays: list[npt.NDArray[Any]] = [sweep.points, sweep.ring] if sweep else []
    arrays += [boxes.boxes, boxes.scores] if boxes else []
    arrays += [lanes.points, lanes.scores, lanes.line] if lanes else []
    return 2000 + sum(array.nbytes for array in arrays)
