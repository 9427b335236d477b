"""Links objects over time where labels have no identities: each object is matched with the nearest one of its class to
its predicted position.

Matches are one-to-one, with the least total distance. If the object's speed is known, the match is at most 2 m from the
prediction, plus what 10 m/s add. An object seen only once may have moved at up to 50 m/s along its own axis, as an
oncoming car does, and little to its side. No match crosses a gap in which the pipeline's trackers are reset.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pipeline.common.clips import begins_clip
from pipeline.params import TimeParams
from pipeline.types import F64
from pipeline.types.source import TruthObject

MAX_GAP_S = TimeParams().reset_gap_s
"""A longer gap starts another clip (``pipeline.common.clips``), so nothing is linked across it."""
_LINK_M, _LINK_MPS = 2.0, 10.0
_FIRST_MPS, _FIRST_ASIDE_M = 50.0, 1.0
_NEVER = 1e6
"""Cost of an impossible pair, metres: above any that is possible."""
_STILL = np.zeros(2)


def linked(labelled: Mapping[int, tuple[TruthObject, ...]]) -> dict[int, tuple[TruthObject, ...]]:
    """Labels with track ids, by tick; ids start at 1. labelled: in recorded order, even if times go back."""
    given = 0
    before: tuple[TruthObject, ...] = ()
    speeds: dict[int, F64] = {}
    last_ns: int | None = None
    out = {}
    for tick in labelled:
        gap_s = (tick - last_ns) / 1e9 if last_ns is not None else np.inf
        goes_on = last_ns is not None and not begins_clip(last_ns, tick, MAX_GAP_S)
        ids = _links(before, labelled[tick], speeds, gap_s) if goes_on else {}
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
    """Indices in ``now`` to the ids that they continue. speeds: (2,) m/s by id, if known."""
    if not before or not now:
        return {}
    cost = _costs(before, now, speeds, gap_s)
    from scipy.optimize import linear_sum_assignment  # takes 0.2 s to import, and most labels already have tracks

    rows, columns = linear_sum_assignment(cost)
    return {int(n): before[k].id for k, n in zip(rows, columns, strict=True) if cost[k, n] < _NEVER}  # type: ignore[misc]


def _costs(
    before: tuple[TruthObject, ...], now: tuple[TruthObject, ...], speeds: Mapping[int, F64], gap_s: float
) -> F64:
    """(before, now) distance of each object from its predicted position, metres; ``_NEVER`` for impossible pairs."""
    were, are = (np.array([_place(each) for each in items]) for items in (before, now))
    moved = np.array([speeds.get(each.id or 0, _STILL) for each in before]) * gap_s
    off = are[None] - were[:, None] - moved[:, None]
    apart_m = np.hypot(off[..., 0], off[..., 1])
    yaws_rad = np.array([[each.cuboid.yaw_rad] for each in before])
    c, s = np.cos(yaws_rad), np.sin(yaws_rad)
    along_m, aside_m = np.abs(c * off[..., 0] + s * off[..., 1]), np.abs(c * off[..., 1] - s * off[..., 0])
    is_new = np.array([[(each.id or 0) not in speeds] for each in before])
    near = apart_m <= _LINK_M + _LINK_MPS * gap_s
    near |= is_new & (along_m <= _FIRST_MPS * gap_s) & (aside_m <= _FIRST_ASIDE_M)
    same = np.array([[a.label == b.label for b in now] for a in before])
    costs: F64 = np.where(near & same, apart_m, _NEVER)
    return costs


def _place(item: TruthObject) -> F64:
    return np.array(item.cuboid.center[:2])
