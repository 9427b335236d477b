"""The height of one vehicle relative to its class, learned while a LiDAR ranges it and kept afterwards.

A law turns the height of a box into a distance as if all cars were equally tall. Most of its error comes from the
differences, and is constant from image to image. While the LiDAR ranges the vehicle, the ratio of that range to the
law's distance is a property of the vehicle: a scalar Kalman filter in ln(ratio), whose prior is the spread of heights
within the class. A lead that moves out of LiDAR range keeps a camera distance as good as its box.
"""

from __future__ import annotations

import math
from typing import NamedTuple

FLOOR_SHARE = 0.03
"""What is never learned: a box's bottom and top move by this share of its height as the vehicle turns and the road
slopes. Measured on labelled KITTI cars within 20 m: 2.9 % (``pipeline.vision.distance``)."""
NEAREST_M = 10.0
"""Nearer than this nothing is learned: the bumper, which the LiDAR ranges, and the roof, which ends the box, lie up to
a metre apart, and the box's lower edge is a shadow as often as a tyre. On KITTI 0052, at 7 m, the ratio wanders by ±9 %
within two seconds; on Astyx, at 20 to 32 m, by ±3 %."""
_SETBACK_M = 0.5
"""Standard deviation of how far the roof's edge lies behind the bumper."""
_MAX_SURPRISE = 10.8
"""Squared innovation beyond which a range is not this vehicle's: 99.9 % of χ² with one degree of freedom."""


class Height(NamedTuple):
    """ln(own height / the law's height), as far as it is known."""

    mean: float = 0.0
    """Best estimate; 0: as the law says."""
    sigma: float | None = None
    """Its standard deviation; None while nothing was learned, which is the spread within the class."""

    @property
    def factor(self) -> float:
        """By which the law's distance is too short."""
        return math.exp(self.mean)

    def share(self, size_share: float) -> float:
        """Standard deviation of the distance for not knowing the height, as a share of it. size_share: the spread
        within the class."""
        return size_share if self.sigma is None else min(size_share, max(self.sigma, FLOOR_SHARE))


def learn(
    height: Height, law_m: float, noise_share: float, size_share: float, range_m: float, range_sigma_m: float
) -> Height:
    """The height with one measured range taken in.

    Args:
        height: what was known.
        law_m: the law's own distance, from the box in the same image.
        noise_share: standard deviation of ln(law_m) from image to image.
        size_share: the same for the heights within the class: the prior.
        range_m, range_sigma_m: the measured distance.
    """
    prior = (height.sigma if height.sigma is not None else size_share) ** 2
    if range_m < NEAREST_M:
        return height
    noise = noise_share**2 + (math.hypot(range_sigma_m, _SETBACK_M) / range_m) ** 2
    surprise = math.log(range_m / law_m) - height.mean
    if surprise**2 > _MAX_SURPRISE * (prior + noise):
        return height
    gain = prior / (prior + noise)
    return Height(height.mean + gain * surprise, max(math.sqrt((1.0 - gain) * prior), FLOOR_SHARE))
