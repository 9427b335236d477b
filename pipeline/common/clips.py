"""Splits recordings of several clips: the only definition of where one clip ends and the next begins.

A new clip begins after a gap longer than ``longest_gap_s``, and where time stands still or runs backwards. Nothing
tracked before is known after it, so nothing is carried, compared or counted across it.
"""

from __future__ import annotations

from collections.abc import Sequence


def begins_clip(before_ns: int, now_ns: int, longest_gap_s: float) -> bool:
    """Whether a new clip starts at this frame, because the gap to the previous frame is too long."""
    return not 0 < now_ns - before_ns <= longest_gap_s * 1e9


def first_frames(t_ns: Sequence[int], longest_gap_s: float) -> list[int]:
    """Index of the first frame of each clip, in order; empty without frames. t_ns: time of each frame, in recorded
    order."""
    return [n for n, now in enumerate(t_ns) if n == 0 or begins_clip(t_ns[n - 1], now, longest_gap_s)]
