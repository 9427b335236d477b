"""Own motion from poses that somebody else worked out: a data set's localisation, or the reference of a benchmark."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.common.geometry import inverse
from pipeline.types import F64, EgoState

_REACH_NS = 110_000_000
"""Poses this far before and after a frame are compared: at 10 Hz its neighbours, at 20 Hz two on either side; noise of
a centimetre then becomes 0.05 m/s."""


def motion_along(t_ns: Sequence[int], T_map_ego: Sequence[F64]) -> list[EgoState | None]:
    """Own motion in each frame.

    Args:
        t_ns: ascending; where a damaged file goes back in time, frames around it may get None.
        T_map_ego: (4, 4) of each frame, takes ego points to any fixed frame.

    Returns:
        Longitudinal speed and yaw rate between the poses around each frame; None if there are none close enough, as
            with a single frame.
    """
    times = np.asarray(t_ns, dtype=np.int64)
    first = np.searchsorted(times, times - _REACH_NS)
    last = np.searchsorted(times, times + _REACH_NS, side="right") - 1
    # for frames farther apart, use the neighbours
    alone = first == last
    first, last = np.where(alone, np.maximum(first - 1, 0), first), np.where(alone, last + 1, last)
    first, last = np.minimum(first, len(times) - 1), np.clip(last, 0, len(times) - 1)
    pairs = zip(first.tolist(), last.tolist(), t_ns, strict=True)
    return [motion_between([int(times[a]), int(times[b])], [T_map_ego[a], T_map_ego[b]], at) for a, b, at in pairs]


def motion_between(times_ns: Sequence[int], T_map_ego: Sequence[F64], t_ns: int) -> EgoState | None:
    """Own motion at ``t_ns`` from two poses and their times; None if the times are equal."""
    seconds = (times_ns[1] - times_ns[0]) / 1e9
    if seconds <= 0.0:
        return None
    step = inverse(T_map_ego[0]) @ T_map_ego[1]
    turned = float(np.arctan2(step[1, 0], step[0, 0]))
    # the chord of an arc has the mean of its two headings
    moved = float(step[0, 3] * np.cos(turned / 2) + step[1, 3] * np.sin(turned / 2))
    return EgoState(t_ns, moved / seconds, turned / seconds, source="ins")
