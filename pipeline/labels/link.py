"""Who is who over time, where labels do not say it: each object is the one of its class that was nearest to where it
should be by its own speed.

One to one, at least total distance. Of one whose speed is known it is at most 2 m from there, and what 10 m/s add; one
that was seen once may have come up to 50 m/s along its own axis, as an oncoming car does, and little to its side. None
goes across a gap in which the line's trackers start anew.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pipeline.params import TimeParams
from pipeline.sources.base import TruthObject
from pipeline.types import F64

MAX_GAP_S = TimeParams().reset_gap_s
"""After a longer gap the line's trackers start anew, so nothing is compared across it."""
_LINK_M, _LINK_MPS = 2.0, 10.0
_FIRST_MPS, _FIRST_ASIDE_M = 50.0, 1.0
_NEVER = 1e6


def linked(labelled: Mapping[int, tuple[TruthObject, ...]]) -> dict[int, tuple[TruthObject, ...]]:
    """Labels with an identity over time, by tick, counted from 1."""
    given = 0
    before: tuple[TruthObject, ...] = ()
    speeds: dict[int, F64] = {}
    last_ns: int | None = None
    out = {}
    for tick in sorted(labelled):
        gap_s = (tick - last_ns) / 1e9 if last_ns is not None else np.inf
        ids = _links(before, labelled[tick], speeds, gap_s) if gap_s <= MAX_GAP_S else {}
        now = []
        for n, item in enumerate(labelled[tick]):
            if n not in ids:
                given += 1
            now.append(replace(item, id=ids.get(n, given)))
        were = {item.id: _place(item) for item in before}
        speeds = {item.id: (_place(item) - were[item.id]) / gap_s for item in now if item.id in ids.values()}  # type: ignore[misc]
        out[tick], before, last_ns = tuple(now), tuple(now), tick
    return out


def _links(
    before: tuple[TruthObject, ...], now: tuple[TruthObject, ...], speeds: Mapping[int, F64], gap_s: float
) -> dict[int, int]:
    """Places in ``now`` to the ids they go on with. speeds: (2,) m/s by id, of those whose is known."""
    if not before or not now:
        return {}
    cost = np.array([[_cost(a, b, speeds.get(a.id or 0), gap_s) for b in now] for a in before])
    from scipy.optimize import linear_sum_assignment  # 0.2 s to import: most labels have tracks already

    rows, columns = linear_sum_assignment(cost)
    return {int(n): before[k].id for k, n in zip(rows, columns, strict=True) if cost[k, n] < _NEVER}  # type: ignore[misc]


def _cost(a: TruthObject, b: TruthObject, speed: F64 | None, gap_s: float) -> float:
    """How far, metres, ``b`` is from where ``a`` should be."""
    off = _place(b) - _place(a) - (speed * gap_s if speed is not None else 0.0)
    apart_m = float(np.hypot(*off))
    near = apart_m <= _LINK_M + _LINK_MPS * gap_s
    if speed is None and not near:
        c, s = np.cos(a.cuboid.yaw_rad), np.sin(a.cuboid.yaw_rad)
        along, aside = abs(c * off[0] + s * off[1]), abs(c * off[1] - s * off[0])
        near = bool(along <= _FIRST_MPS * gap_s and aside <= _FIRST_ASIDE_M)
    return apart_m if near and a.label == b.label else _NEVER


def _place(item: TruthObject) -> F64:
    return np.array(item.cuboid.center[:2])
