"""Velocities of labelled vehicles, from their positions in the neighbouring labelled frames.

A parabola is fitted to a vehicle's positions within 0.3 s of each frame, always including the frames right before and
after (Savitzky and Golay 1964, for uneven times): labels are off by centimetres to decimetres, so the speed between two
labels 0.2 s apart would be off by metres per second. With fewer than four positions, a line is fitted. Where positions
deviate from the fit by more than the error of labels, the track jumps, for example because the pipeline confused two
vehicles; no speed is given there.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pipeline.common.clips import begins_clip
from pipeline.labels.link_identities import MAX_GAP_S
from pipeline.types import F64, I64, Mask, Point2

_HALF_S = 0.3
_JUMP_M = 0.3
_ACCEL_MPS2 = 4.0
"""Relative acceleration, which limits the permitted deviation from a line fit."""
_PARABOLA = 4
_MOST_BESIDE = 10
"""Maximum number of positions before and after a frame that are used."""

TickPositions = Iterable[tuple[int, Mapping[int, Point2]]]
"""Labelled frames in order: the tick, and each vehicle's position by id; ego frame, metres."""


@dataclass(frozen=True)
class Velocities:
    """Velocities derived from neighbouring frames."""

    mps: Mapping[int, Mapping[int, Point2]]
    """By tick and id, relative to ego in the rotating ego frame."""
    jumps: frozenset[tuple[int, int]]
    """Tick and id of implausible movements."""


def velocities(sightings: TickPositions) -> Velocities:
    """One-sided where a vehicle appears or disappears; not computed across a gap."""
    rows = [(key, n, t_ns, *place) for n, (t_ns, places) in enumerate(sightings) for key, place in places.items()]
    rows.sort(key=lambda row: row[:2])
    if not rows:
        return Velocities({}, frozenset())
    keys, frames, ticks = (np.array([row[k] for row in rows], dtype=np.int64) for k in range(3))
    slopes, beside_m, allowed_m = _fitted(_runs(keys, frames, ticks), ticks, np.array([row[3:] for row in rows]))
    mps: dict[int, dict[int, Point2]] = {}
    jumps = set()
    for key, tick, (vx, vy), is_smooth in zip(
        keys.tolist(), ticks.tolist(), slopes.tolist(), (beside_m <= allowed_m).tolist(), strict=True
    ):
        if np.isnan(vx):
            continue
        if is_smooth:
            mps.setdefault(tick, {})[key] = (vx, vy)
        else:
            jumps.add((tick, key))
    return Velocities(mps, frozenset(jumps))


def _runs(keys: I64, frames: I64, ticks: I64) -> I64:
    """(N,) a number for each run of one vehicle in consecutive labelled frames."""
    is_new = (np.diff(keys) != 0) | (np.diff(frames) != 1)
    is_new |= np.array([begins_clip(a, b, MAX_GAP_S) for a, b in pairwise(ticks.tolist())], dtype=bool)
    return np.concatenate(([0], np.cumsum(is_new)))


def _fitted(runs: I64, ticks: I64, places: F64) -> tuple[F64, F64, F64]:
    """((N, 2) slopes at each position, NaN for single ones; (N,) maximum distance of a position from the curve, m; (N,)
    its limit)."""
    count = len(runs)
    sums, values, used = np.zeros((count, 3, 3)), np.zeros((count, 3, 2)), np.zeros(count, dtype=np.int64)
    for here, there, tau in _pairs(runs, ticks):
        powers = tau[:, None] ** np.arange(3)
        sums[here] += powers[:, :, None] * powers[:, None, :]
        values[here] += powers[:, :, None] * places[there][:, None, :]
        used[here] += 1
    is_line = used < _PARABOLA
    sums[is_line, 2, :] = sums[is_line, :, 2] = values[is_line, 2] = 0.0
    sums[is_line, 2, 2] = 1.0
    is_alone = used < 2
    sums[is_alone] = np.eye(3)
    curves = np.linalg.solve(sums, values)
    beside_m, reach_s = np.zeros(count), np.zeros(count)
    for here, there, tau in _pairs(runs, ticks):
        off = places[there] - np.einsum("nk,nkd->nd", tau[:, None] ** np.arange(3), curves[here])
        beside_m[here] = np.maximum(beside_m[here], np.hypot(off[:, 0], off[:, 1]))
        reach_s[here] = np.maximum(reach_s[here], np.abs(tau))
    slopes = np.where(is_alone[:, None], np.nan, curves[:, 1])
    return slopes, beside_m, _JUMP_M + np.where(is_line, _ACCEL_MPS2 * reach_s**2 / 3, 0.0)


def _pairs(runs: I64, ticks: I64) -> Iterable[tuple[Mask, I64, F64]]:
    """For each offset along the rows: (which rows have a partner there, the partner's row, its time difference in
    s)."""
    rows = np.arange(len(runs))
    for step in range(-_MOST_BESIDE, _MOST_BESIDE + 1):
        other = np.clip(rows + step, 0, len(runs) - 1)
        tau = (ticks[other] - ticks) / 1e9
        is_one = (other == rows + step) & (runs[other] == runs) & ((np.abs(tau) <= _HALF_S) | (abs(step) <= 1))
        yield is_one, other[is_one], tau[is_one]
