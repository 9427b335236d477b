"""Estimates the delay of ego speed relative to LiDAR odometry while the car accelerates or brakes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, sin
from typing import NamedTuple

import numpy as np

from pipeline.common.errors import BadInput
from pipeline.types import F64

REACH_MS, STEP_MS = 500.0, 20.0
FEWEST, WINDOW = 40, 7
"""Minimum number of pairs; number of pairs that are averaged."""
BLOCK_NS = 1_000_000_000
BOOTSTRAPS = 60
TOLD_MS = 45.0
"""With a larger standard deviation no result is given."""
OFF_MPS = 0.3
"""Displacements with larger residuals get less weight."""


class NoDelay(BadInput):
    """The drive does not determine the delay of ego speed; the text says why."""


class SpeedPair(NamedTuple):
    """Speeds between two sweeps."""

    t_ns: int
    """Time half-way."""
    lidar_mps: float
    """From the displacement of the LiDAR."""
    recorded_mps: float
    """The car's own speed in the later frame."""
    recorded_ns: int
    """Its timestamp."""


@dataclass(frozen=True)
class SpeedDelay:
    """True measurement time of the car's own speed, relative to its timestamps."""

    ego_offset_ms: float
    """Offset to add to its timestamps; negative if it is late."""
    sigma_ms: float
    """Standard deviation."""
    scale: float
    """LiDAR distance per metre of the car's own odometry."""


def forward_m(before: F64, after: F64) -> float:
    """Distance along x between two (4, 4) poses, at half the rotation."""
    step = np.linalg.inv(before) @ after
    half = 0.5 * float(np.arctan2(step[1, 0], step[0, 0]))
    return float(step[0, 3]) * cos(half) + float(step[1, 3]) * sin(half)


def speed_delay(pairs: Sequence[SpeedPair]) -> SpeedDelay:
    """The time shift of the recorded speed that best matches the LiDAR's. Raises NoDelay if the drive does not
    determine it."""
    if len(pairs) < FEWEST:
        raise NoDelay("too few ego speeds with LiDAR odometry: their delay is unknown")
    begin_ns = pairs[0].t_ns
    t_s, at_s = np.array([(each.t_ns - begin_ns, each.recorded_ns - begin_ns) for each in pairs]).T / 1e9
    lidar, recorded = np.array([(each.lidar_mps, each.recorded_mps) for each in pairs]).T
    shifts_s = np.arange(-REACH_MS, REACH_MS + STEP_MS / 2, STEP_MS) / 1e3
    kept = (t_s > at_s[0] + REACH_MS / 1e3) & (t_s < at_s[-1] - REACH_MS / 1e3)
    if np.count_nonzero(kept) < FEWEST:
        raise NoDelay("the drive is too short to determine the delay of ego speed")
    # the speed recorded at t if its timestamps were later by the shift
    seen = np.array([np.interp(t_s[kept], at_s + shift, recorded) for shift in shifts_s])
    number = np.array([each.t_ns // BLOCK_NS for each in pairs])
    scale = float(np.sum(lidar[kept]) / max(float(np.sum(np.interp(t_s[kept], at_s, recorded))), 1e-3))
    # single displacements are noisy, but errors of neighbours cancel
    seen, lidar = _averaged(seen), _averaged(lidar[kept])
    number = number[kept][WINDOW // 2 :][: len(lidar)]
    off = np.abs(lidar - scale * seen)
    cost = np.where(off < OFF_MPS, 0.5 * off**2, OFF_MPS * (off - 0.5 * OFF_MPS))
    sums = np.array([cost[:, number == block].sum(axis=1) for block in np.unique(number)])
    best = _lowest(sums.sum(axis=0), shifts_s)
    rng = np.random.default_rng(0)
    drawn = [_lowest(sums[rng.integers(0, len(sums), len(sums))].sum(axis=0), shifts_s) for _ in range(BOOTSTRAPS)]
    sigma_ms = max(1e3 * float(np.std(drawn, ddof=1)), 1.0)
    if sigma_ms > TOLD_MS or abs(best) > (REACH_MS - STEP_MS) / 1e3:
        raise NoDelay("ego speed changes too little to determine its delay; accelerate and brake")
    return SpeedDelay(round(1e3 * best, 1), round(sigma_ms, 1), round(scale, 4))


def _averaged(values: F64) -> F64:
    """Means of ``WINDOW`` neighbours along the last axis."""
    sums = np.cumsum(np.pad(values, [(0, 0)] * (values.ndim - 1) + [(1, 0)]), axis=-1)
    return np.asarray((sums[..., WINDOW:] - sums[..., :-WINDOW]) / WINDOW)


def _lowest(cost: F64, at: F64) -> float:
    """Position of the minimum cost, interpolated between the steps."""
    k = int(np.argmin(cost))
    low, high = max(k - 2, 0), min(k + 3, len(cost))
    a, b, _ = np.polyfit(at[low:high], cost[low:high], 2)
    return float(np.clip(-b / (2 * a), at[low], at[high - 1])) if a > 0 else float(at[k])
