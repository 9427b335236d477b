"""How well a series of LiDAR ranges of a box tells the object's speed.

The boxes of a standing vehicle wander for a second at a time, which looks like motion. Returns inside the box do not
wander: what they show to move within half a second moves, even if its boxes alone leave that open for two more.
"""

from __future__ import annotations

import math
from typing import NamedTuple

_LONGEST_GAP_S = 0.5
"""After a longer time without a return, the boxes have moved the place again."""
_FEWEST = 3
"""Two ranges fit any speed."""


class RangedRun(NamedTuple):
    """The distances of one object that were measured by returns, one after the other."""

    ranges: int = 0
    """How many."""
    lasts_s: float = 0.0
    """Time from the first to the last."""
    since_s: float = 0.0
    """Time since the last."""
    sigma_m: float = 0.0
    """Standard deviation of the last."""

    def then(self, ranged_sigma_m: float | None, after_s: float) -> RangedRun:
        """With a further distance, taken ``after_s`` after the one before; by a box alone if its sigma is None."""
        since_s = self.since_s + after_s
        if since_s > _LONGEST_GAP_S or not self.ranges:
            return RangedRun() if ranged_sigma_m is None else RangedRun(1, 0.0, 0.0, ranged_sigma_m)
        if ranged_sigma_m is None:
            return self._replace(since_s=since_s)
        return RangedRun(self.ranges + 1, self.lasts_s + since_s, 0.0, ranged_sigma_m)

    def wander_mps(self, boxes_mps: float) -> float:
        """What is left of the standard deviation that wandering boxes give an apparent speed: this run's line and the
        boxes, weighted by their variances. A line through n positions within T has σ_v = √12 σ / (√n T)."""
        if self.ranges < _FEWEST or self.lasts_s <= 0.0:
            return boxes_mps
        line_mps = math.sqrt(12.0 / self.ranges) * self.sigma_m / self.lasts_s
        return boxes_mps * line_mps / math.hypot(boxes_mps, line_mps) if boxes_mps else 0.0
