"""Who is who over time, where labels do not say it: each object is the nearest one of its class in the frame before.

One to one, at least total distance. A link is never longer than 2 m and what 10 m/s of relative speed add, and none
goes across a gap in which the line's trackers start anew.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline.params import TimeParams
from pipeline.sources.base import TruthObject

MAX_GAP_S = TimeParams().reset_gap_s
"""After a longer gap the line's trackers start anew, so nothing is compared across it."""
_LINK_M, _LINK_MPS = 2.0, 10.0
_NEVER = 1e6


def linked(labelled: Mapping[int, tuple[TruthObject, ...]]) -> dict[int, tuple[TruthObject, ...]]:
    """Labels with an identity over time, by tick, counted from 1."""
    given = 0
    before: tuple[TruthObject, ...] = ()
    last_ns: int | None = None
    out = {}
    for tick in sorted(labelled):
        gap_s = (tick - last_ns) / 1e9 if last_ns is not None else np.inf
        ids = _links(before, labelled[tick], _LINK_M + _LINK_MPS * gap_s) if gap_s <= MAX_GAP_S else {}
        now = []
        for n, item in enumerate(labelled[tick]):
            if n not in ids:
                given += 1
            now.append(replace(item, id=ids.get(n, given)))
        out[tick], before, last_ns = tuple(now), tuple(now), tick
    return out


def _links(before: tuple[TruthObject, ...], now: tuple[TruthObject, ...], gate_m: float) -> dict[int, int]:
    """Places in ``now`` to the ids they go on with."""
    if not before or not now:
        return {}
    places = [np.array([item.cuboid.center[:2] for item in items]) for items in (before, now)]
    apart = np.hypot(*np.moveaxis(places[0][:, None] - places[1][None], 2, 0))
    other = np.array([[a.label != b.label for b in now] for a in before])
    cost = np.where(other | (apart > gate_m), _NEVER, apart)
    rows, columns = linear_sum_assignment(cost)
    return {int(n): before[k].id for k, n in zip(rows, columns, strict=True) if cost[k, n] < _NEVER}  # type: ignore[misc]
