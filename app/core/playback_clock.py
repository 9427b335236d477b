"""Computes which frame is due in real-time playback. The engine supplies the time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.common.clips import first_frames
from pipeline.params import TimeParams
from pipeline.types import F64

LONGEST_GAP_S = TimeParams().reset_gap_s
"""Recordings of several clips may have gaps of minutes, which playback skips."""


def timeline_s(t_ns: Sequence[int], rate_hz: float) -> F64:
    """(N,) seconds from the first frame at which each frame is shown.

    Taken from the frames' timestamps, except that the step to another clip (a gap over ``LONGEST_GAP_S``, or back in
    time) is one nominal period.
    """
    steps: F64 = np.diff(np.asarray(t_ns, dtype=np.int64)).astype(np.float64) / 1e9
    period = 1.0 / rate_hz if rate_hz > 0 else 0.1
    steps[[first - 1 for first in first_frames(t_ns, LONGEST_GAP_S)[1:]]] = period
    return np.concatenate([[0.0], np.cumsum(steps)])


@dataclass(frozen=True)
class PlaybackClock:
    """Recording time runs from an anchor at ``speed`` times wall time."""

    timeline_s: F64
    """(N,) position of each frame on the playback timeline."""
    anchor_wall_s: float
    """Monotonic clock at the anchor."""
    anchor_media_s: float
    """Recording time at the anchor."""
    speed: float
    """1 is real time."""

    def due(self, now_s: float) -> int:
        """The newest frame that is due."""
        media_s = self.anchor_media_s + (now_s - self.anchor_wall_s) * self.speed
        return int(np.searchsorted(self.timeline_s, media_s + 1e-9, side="right")) - 1

    def wait_s(self, index: int, now_s: float) -> float:
        """Wall seconds until the frame after ``index`` is due; after the last frame, one more period."""
        times = self.timeline_s
        if index + 1 < len(times):
            next_s = float(times[index + 1])
        else:
            next_s = float(times[-1] + (times[-1] - times[-2] if len(times) > 1 else LONGEST_GAP_S))
        return max(0.0, (next_s - self.anchor_media_s) / self.speed - (now_s - self.anchor_wall_s))
