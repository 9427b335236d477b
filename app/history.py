"""What was the lead at each frame that was run, so that a page which joins late draws the drive's strips too."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import Any

from app.snapshot import Snapshot
from pipeline.types import Cipv

_MOST = 36_000
"""An hour at 10 Hz."""


@dataclass(frozen=True)
class Sample:
    """The lead at one frame, with the parameters' revision it was found with; null when there was none."""

    revision: int
    cipv: Cipv | None


class History:
    """One sample a frame of the open recording, the newest. Written by the engine, read by requests."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._uri: str | None = None
        self._samples: dict[int, Sample] = {}

    def record(self, snapshot: Snapshot) -> None:
        """Called by the engine after every change."""
        with self._lock:
            if snapshot.uri != self._uri:
                self._uri, self._samples = snapshot.uri, {}
            if snapshot.tick is not None:
                if len(self._samples) >= _MOST:  # a live drive has no end; the oldest was put in first
                    del self._samples[next(iter(self._samples))]
                self._samples[snapshot.index] = Sample(snapshot.params_revision, snapshot.tick.result.cipv)

    def to_json(self) -> dict[str, Any]:
        """``{"uri": …, "samples": [[index, revision, id, distance_m, closing_speed_mps, ttc_s], …]}`` by index; the
        last four are null without a lead."""
        with self._lock:
            uri, samples = self._uri, sorted(self._samples.items())
        return {"uri": uri, "samples": [[index, sample.revision, *_figures(sample.cipv)] for index, sample in samples]}


def _figures(cipv: Cipv | None) -> list[float | None]:
    if cipv is None:
        return [None, None, None, None]
    return [cipv.id, cipv.distance_m, cipv.closing_speed_mps, cipv.ttc_s]
