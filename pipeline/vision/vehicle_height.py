"""The height of one vehicle relative to its class, learned while a LiDAR ranges it and kept afterwards.

A law turns the height of a box into a distance as if all cars were equally tall. Most of its error comes from the
differences, and is constant from image to image. While the LiDAR ranges the vehicle, the ratio of that range to the
law's distance is a property of the vehicle: a scalar Kalman filter in ln(ratio), whose prior is the spread of heights
within the class. A lead that moves out of LiDAR range keeps a camera distance as good as its box.

Before the first range, two hints are combined. Cars differ less in width than in height, so a box that is tall for its
width belongs to a van; a box that is low for its width says nothing, because a car that is turned shows part of its
side. And the point where the box meets the road gives a distance, and therefore a height.
"""

from __future__ import annotations

import math
from typing import NamedTuple

FLOOR_SHARE = 0.05
"""What is never learned: a box's bottom and top move by this share of its height as the vehicle comes nearer, turns,
and the road slopes. On eleven labelled vehicles of KITTI 0009 beyond 12 m, the mean height of a box relative to the
label's changes by 6 % (RMS, the noise of single boxes removed; 5.1 to 6.7 % without any one of them) while the distance
changes by a sixth to four fifths, and by less than 3 % in half of the cases. Within 20 m it is 2.9 %."""
NEAREST_M = 10.0
"""Nearer than this nothing is learned: the bumper, which the LiDAR ranges, and the roof, which ends the box, lie up to
a metre apart, and the box's lower edge is a shadow as often as a tyre. On KITTI 0052, at 7 m, the ratio wanders by ±9 %
within two seconds; on Astyx, at 20 to 32 m, by ±3 %."""
_SETBACK_M = 0.5
"""Standard deviation of how far the roof's edge lies behind the bumper."""
_MAX_SURPRISE = 10.8
"""Squared innovation beyond which a range is not this vehicle's: 99.9 % of χ² with one degree of freedom."""
_INSISTS = 5
"""After so many of these in a row, the range is right and the class is wrong: a lorry that is called a car. Half a
second is longer than a pair of two vehicles lasts."""
_USUAL_ASPECT = math.log(1.55 / 1.73)
"""ln(height / width) of the usual car from behind: medians of the labelled cars of Astyx (1.59 m, 1.80 m) and KITTI
0009 (1.51 m, 1.65 m)."""
_ASPECT_GAIN = 0.5
"""By how much of ln(aspect) a car is taller. Regression of ln(height) on the aspect of its box: ln(height) varies by
0.11 and ln(width) by 0.07 among those cars, with a correlation of 0.5, and a box's aspect by 0.09 around the true one.
It lowers the mean distance error on the boxes concerned from 11 to 8 % on Astyx, and from 10 to 9 % on KITTI 0009."""
_TALLEST_ASPECT = 0.25
"""The tallest vans, 2.1 m by 1.75 m, have 0.18. A narrower box shows half of a vehicle."""
_HINT_SIGHTINGS = 10
"""A hint is the mean over so many sightings: long enough to average the noise of single boxes, short enough to
follow a vehicle that turns."""


_LOWEST, _TALLEST = -0.25, 0.45
"""ln(height / usual height of the class): of a sports car (1.2 m) among cars, and of a high van (2.4 m) among cars or a
lorry (4 m) among trucks."""
_MAX_SIGMAS = 2.0
"""A contact that implies a height more standard deviations beyond these limits than this is rejected; so is a range
that implies a lower one."""


class BoxShape(NamedTuple):
    """The shape of a vehicle's boxes, averaged."""

    aspect: float = 0.0
    """Mean ln(height / width)."""
    sightings: int = 0
    """How many boxes it rests on."""

    def seen(self, aspect: float | None) -> BoxShape:
        """With one more box; None: a box that tells nothing."""
        if aspect is None:
            return self
        count = min(self.sightings + 1, _HINT_SIGHTINGS)
        return BoxShape(self.aspect + (aspect - self.aspect) / count, count)

    @property
    def height(self) -> float:
        """ln(own height / height of a usual car)."""
        if not self.sightings or not _USUAL_ASPECT < self.aspect < _TALLEST_ASPECT:
            return 0.0
        return _ASPECT_GAIN * (self.aspect - _USUAL_ASPECT)


class RoadContact(NamedTuple):
    """The distance at which a vehicle's boxes meet the road, averaged."""

    log_ratio: float = 0.0
    """Mean ln(distance by the road / distance by the law)."""
    lasting: float = 0.0
    """Standard deviation due to errors that do not average out, such as the unknown shape of the road."""
    noise: float = 0.0
    """Standard deviation due to errors that change from image to image."""
    sightings: int = 0
    """Number of boxes it is based on."""

    @property
    def variance(self) -> float:
        """Of ``log_ratio``."""
        return self.lasting**2 + self.noise**2 / max(self.sightings, 1)

    def seen(self, log_ratio: float, lasting: float, noise: float) -> RoadContact:
        """With one more box."""
        count = min(self.sightings + 1, _HINT_SIGHTINGS)
        new, old = 1.0 / count, 1.0 - 1.0 / count
        return RoadContact(
            old * self.log_ratio + new * log_ratio,
            old * self.lasting + new * lasting,
            old * self.noise + new * noise,
            count,
        )


class Height(NamedTuple):
    """ln(own height / the law's height), as far as it is known."""

    mean: float = 0.0
    """Best estimate; 0: as the law says."""
    sigma: float | None = None
    """Its standard deviation; None while nothing is known but the class, and perhaps the shape of the boxes."""
    is_ranged: bool = False
    """Whether it was learned from measured ranges, after which hints no longer count."""
    contradictions: int = 0
    """Measured ranges in a row that contradict it."""

    @property
    def factor(self) -> float:
        """By which the law's distance is too short."""
        return math.exp(self.mean)

    def share(self, size_share: float) -> float:
        """Standard deviation of the distance for not knowing the height, as a share of it. size_share: the spread
        within the class."""
        return size_share if self.sigma is None else max(self.sigma, FLOOR_SHARE)


def hinted(shape: BoxShape, contact: RoadContact, size_share: float, class_factor: float = 1.0) -> Height:
    """The height before any range: of the class, changed by the shape of the boxes and by where they meet the road.
    Where class and road contradict each other, one of them is wrong, and the sigma grows by the Birge ratio (R. T.
    Birge, Phys. Rev. 40, 207 (1932)).

    size_share: standard deviation of ln(height) within the class. class_factor: height of the class over a car's; what
    is called a truck may be a car.
    """
    prior, noise = size_share**2, contact.variance
    possible = min(max(contact.log_ratio, _LOWEST - math.log(class_factor)), _TALLEST)
    if not contact.sightings or abs(contact.log_ratio - possible) > _MAX_SIGMAS * math.sqrt(noise):
        return Height(shape.height)
    apart = possible - shape.height
    gain = prior / (prior + noise)
    birge = max(1.0, abs(apart) / math.sqrt(prior + noise))
    return Height(shape.height + gain * apart, birge * math.sqrt((1.0 - gain) * prior))


def learn(
    height: Height,
    law_m: float,
    noise_share: float,
    size_share: float,
    range_m: float,
    range_sigma_m: float,
    class_factor: float = 1.0,
) -> Height:
    """The height with one measured range taken in. A range at which the box would be lower than any vehicle is not this
    vehicle's, however often it is measured, or the box shows only a part of the vehicle: nothing is learned from it.

    Args:
        height: what was known.
        law_m: the law's own distance, from the box in the same image.
        noise_share: standard deviation of ln(law_m) from image to image.
        size_share: the same for the heights within the class: the prior.
        range_m, range_sigma_m: the measured distance.
        class_factor: as for ``hinted``.
    """
    prior = (height.sigma if height.sigma is not None and height.is_ranged else size_share) ** 2
    if range_m < NEAREST_M:
        return height
    noise = noise_share**2 + (math.hypot(range_sigma_m, _SETBACK_M) / range_m) ** 2
    implied = math.log(range_m / law_m)
    if implied < _LOWEST - math.log(class_factor) - _MAX_SIGMAS * math.hypot(math.sqrt(noise), FLOOR_SHARE):
        return height
    surprise = implied - height.mean
    if surprise**2 > _MAX_SURPRISE * (prior + noise):
        if height.contradictions + 1 < _INSISTS:
            return height._replace(contradictions=height.contradictions + 1)
        return Height(height.mean + surprise, max(math.sqrt(noise), FLOOR_SHARE), True)
    gain = prior / (prior + noise)
    return Height(height.mean + gain * surprise, max(math.sqrt((1.0 - gain) * prior), FLOOR_SHARE), True)
