"""The frames used to score an alignment: a selection of the whole recording, or the last ones shown of live sensors."""

from __future__ import annotations

import threading
from collections import deque

import numpy as np

from app.drive.open_recording import OpenRecording
from pipeline.calibration.alignment.scenes import FitScene, fit_scene
from pipeline.calibration.depth_edges import edge_scene
from pipeline.calibration.edge_match import Seen
from pipeline.params import Params
from pipeline.types import Frame

FRAMES = 20
"""Number of evaluated frames, from the whole drive or the last shown ones: one sweep of 16 rings has few depth
edges."""
APART_NS = 500_000_000
"""Minimum time between frames of live sensors: closer frames show the same scene."""


class AlignmentScenes:
    """The evaluated frames of the last request. Any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._of: OpenRecording | str | None = None
        self._newest_ns = 0
        self._seen: deque[Seen] = deque(maxlen=FRAMES)
        self._vehicles: dict[int, FitScene | None] = {}

    def of_recording(self, recording: OpenRecording) -> list[Seen]:
        """Frames spread over a recording, each evaluated once."""
        with self._lock:
            if self._of is not recording:
                self._begin(recording)
                for index in _spread(recording):
                    self._look(recording.as_read(index))
            return list(self._seen)

    def vehicles_of(self, recording: OpenRecording) -> list[FitScene]:
        """The boxes and clusters of the same frames, as far as detectors have looked at them; none is asked to."""
        with self._lock:
            if self._of is not recording:
                return []
            for index in _spread(recording):
                if index not in self._vehicles and recording.has_been_looked_at(index):
                    self._vehicles[index] = fit_scene(recording.input(index), Params())
            found = [each for each in self._vehicles.values() if each is not None]
            return [each for each in found if each.size == found[0].size]

    def of_shown(self, uri: str, frame: Frame) -> list[Seen]:
        """The frames that were shown at earlier calls, and the current one."""
        with self._lock:
            if self._of != uri:
                self._begin(uri)
            if not self._seen or abs(frame.t_ns - self._newest_ns) >= APART_NS:
                self._look(frame)
            return list(self._seen)

    def _begin(self, of: OpenRecording | str) -> None:
        self._of = of
        self._seen.clear()
        self._vehicles.clear()

    def _look(self, frame: Frame) -> None:
        if frame.sweep is not None and frame.image is not None:
            self._newest_ns = frame.t_ns
            self._seen.append((edge_scene(frame.sweep, frame.image.bgr), frame.camera))


def _spread(recording: OpenRecording) -> list[int]:
    """The evaluated frames of a recording."""
    return np.unique(np.linspace(0, recording.setup.total - 1, FRAMES).round().astype(int)).tolist()
