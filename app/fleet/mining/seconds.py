"""What speaks for labeling each second of a fleet, computed from the tables of a batch.

To add a reason, write a function of ``FleetFrames`` or ``Seconds`` and register it in ``reasons_of``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from app.fleet.find import FleetTables
from pipeline.types import F64, I64

RETURN_S = 2.0
"""A lead that was lost or replaced, and is back within this time, was changed in error."""
JUMP_SIGMAS = 4.0
"""The lead's distance may differ by so many standard deviations from what its own speed foretold."""
NEAREST, SAMPLE, SEED = 5, 20_000, 1
"""Novelty: mean distance to so many of the most similar seconds of other drives, of a sample of this size."""
_NONE = -1
_MARGIN_SQL = """
SELECT o.drive, o."index", max(1 - abs(2 * o.in_path_probability * coalesce(o.existence_probability, 1) - 1)) AS unsure,
  max(o.vl_gap_sigmas) FILTER (o.in_path) AS gap
FROM objects o JOIN frames f ON o.drive = f.drive AND o."index" = f."index"
WHERE o.distance_m <= coalesce(f.distance_m, 60) + 0.5 AND o.seen_by <> ''
GROUP BY o.drive, o."index"
"""
"""By frame: how unsure it is of the objects that could be the lead whether they are in the path and exist (1: even
odds), and the largest disagreement of camera and LiDAR about one in the path."""
_FRAMES_SQL = f"""
SELECT f.drive, f.address, f."index", f.t_s, f.cipv_id, f.distance_m, f.distance_sigma_m, f.closing_speed_mps,
  f.speed_mps, f.yaw_rate_radps, f.objects, f.brightness, m.unsure, m.gap
FROM frames f LEFT JOIN ({_MARGIN_SQL}) m ON f.drive = m.drive AND f."index" = m."index"
ORDER BY f.drive, f."index"
"""


class FleetFrames(NamedTuple):
    """Every frame of a run, by drive and index; (N,) each, NaN where unknown."""

    drive: I64
    """Number of the drive."""
    t_s: F64
    """Since the drive's first frame."""
    cipv_id: I64
    """-1 without a CIPV."""
    distance_m: F64
    """Of the CIPV."""
    sigma_m: F64
    """Of that distance."""
    closing_mps: F64
    """Of the CIPV."""
    speed_mps: F64
    """Ego."""
    yaw_rate_radps: F64
    """Ego."""
    objects: F64
    """How many."""
    brightness: F64
    """Of the drive."""
    unsure: F64
    """0–1."""
    gap_sigmas: F64
    """Disagreement of camera and LiDAR."""


@dataclass(frozen=True)
class Seconds:
    """Every second of a run, by drive and time; (M,) each."""

    drive: I64
    """Number of the drive, a place in ``addresses``."""
    second: I64
    """Since the drive's first frame."""
    first: I64
    """First frame of the second."""
    last: I64
    """Last frame, included."""
    addresses: tuple[str, ...]
    """Of each drive."""
    values: Mapping[str, F64]
    """By reason: how much speaks for labeling the second; 0: nothing."""


def seconds_of(tables: FleetTables) -> Seconds:
    """All seconds of a run."""
    table = tables.ask(_FRAMES_SQL)
    names, drive = np.unique(np.array(table["drive"].to_pylist()), return_inverse=True)
    addresses = dict(zip(table["drive"].to_pylist(), table["address"].to_pylist(), strict=True))

    def column(name: str) -> F64:
        return np.array(table[name].to_numpy(zero_copy_only=False), np.float64)

    ids = np.nan_to_num(column("cipv_id"), nan=_NONE).astype(np.int64)
    rest = ("distance_m", "distance_sigma_m", "closing_speed_mps", "speed_mps", "yaw_rate_radps", "objects")
    more = ("brightness", "unsure", "gap")
    frames = FleetFrames(drive.astype(np.int64), column("t_s"), ids, *map(column, (*rest, *more)))
    second = np.floor(frames.t_s).astype(np.int64)
    begins = np.flatnonzero(np.diff(frames.drive, prepend=-1) | np.diff(second, prepend=-1))
    index = column("index").astype(np.int64)
    ends = np.append(begins[1:], len(index)) - 1
    values = {name: _most(each, begins) for name, each in reasons_of(frames).items()}
    values["novelty"] = novelty(frames, begins)
    known = tuple(addresses[name] for name in names)
    return Seconds(frames.drive[begins], second[begins], index[begins], index[ends], known, values)


def reasons_of(frames: FleetFrames) -> dict[str, F64]:
    """(N,) by reason, of each frame."""
    return {
        "disagreement": np.nan_to_num(frames.gap_sigmas),
        "margin": np.nan_to_num(frames.unsure),
        "consistency": inconsistency(frames),
    }


def inconsistency(frames: FleetFrames) -> F64:
    """(N,) how far each frame contradicts its neighbours: 1 for a lead that changes and is back soon; the jump of the
    lead's distance, in units of ``JUMP_SIGMAS``, where it is more than its speed and both sigmas allow."""
    count = len(frames.drive)
    follows = np.zeros(count, bool)
    follows[1:] = frames.drive[1:] == frames.drive[:-1]
    before, step_s = np.roll(frames.cipv_id, 1), np.diff(frames.t_s, prepend=np.nan)
    changed = follows & (frames.cipv_id != before)
    found = np.zeros(count)
    for ahead in range(1, count):
        later = np.arange(count - ahead)
        near = (frames.drive[later] == frames.drive[later + ahead]) & (
            frames.t_s[later + ahead] - frames.t_s[later] <= RETURN_S
        )
        if not near.any():
            break
        back = near & changed[later] & (frames.cipv_id[later + ahead] == before[later])
        found[later[back]] = 1.0
    foretold = np.roll(frames.distance_m, 1) - np.roll(frames.closing_mps, 1) * step_s
    sigma_m = np.hypot(frames.sigma_m, np.roll(frames.sigma_m, 1))
    with np.errstate(invalid="ignore", divide="ignore"):
        jump = np.abs(frames.distance_m - foretold) / sigma_m / JUMP_SIGMAS
    same = follows & ~changed & (frames.cipv_id != _NONE) & np.isfinite(jump) & (jump > 1.0)
    found[same] = np.maximum(found[same], jump[same])
    return found


def novelty(frames: FleetFrames, begins: npt.NDArray[np.int64]) -> F64:
    """(M,) how unlike the seconds of all other drives each second is: in standard deviations of speed, bend, light,
    number of objects, and distance and closing speed of the lead. 0 where no other drive is known."""
    has_lead = (frames.cipv_id != _NONE).astype(np.float64)
    near = np.where(has_lead > 0.0, 1.0 / np.maximum(np.nan_to_num(frames.distance_m, nan=100.0), 2.0), 0.0)
    bend = np.nan_to_num(frames.yaw_rate_radps)
    columns = (frames.speed_mps, np.abs(bend), frames.brightness, frames.objects, near, frames.closing_mps, has_lead)
    kinds = np.stack([_mean(np.nan_to_num(each), begins) for each in columns], axis=1)
    spread = kinds.std(axis=0)
    scaled: Any = (kinds - kinds.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0)
    drive = frames.drive[begins]
    sample = np.random.default_rng(SEED).permutation(len(scaled))[:SAMPLE]
    own = int(np.bincount(drive[sample]).max())
    wanted = min(len(sample), own + NEAREST)
    far, place = cKDTree(scaled[sample]).query(scaled, wanted)
    far, place = np.asarray(far).reshape(len(scaled), -1), np.asarray(place).reshape(len(scaled), -1)
    others = drive[sample][place] != drive[:, None]
    taken = others & (np.cumsum(others, axis=1) <= NEAREST)
    return np.where(taken, far, 0.0).sum(axis=1) / np.maximum(taken.sum(axis=1), 1)


def _most(values: F64, begins: npt.NDArray[np.int64]) -> F64:
    return np.asarray(np.maximum.reduceat(values, begins), np.float64)


def _mean(values: F64, begins: npt.NDArray[np.int64]) -> F64:
    counts = np.diff(np.append(begins, len(values)))
    return np.asarray(np.add.reduceat(values, begins) / counts, np.float64)
