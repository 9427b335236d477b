"""The height of one vehicle relative to its class, learned while a LiDAR ranges it and kept afterwards.

A law turns the height of a box into a distance as if all cars were equally tall. Most of its error comes from the
differences, and is constant from image to image. While the LiDAR ranges the vehicle, the ratio of that range to the
law's distance is a property of the vehicle: a scalar Kalman filter in ln(ratio), whose prior is the spread of heights
within the class. A lead that moves out of LiDAR range keeps a camera distance as good as its box.

Before the first range, three hints are combined. Cars differ less in width than in height, so a box that is tall for
its width belongs to a van; a box that is low for its width says nothing, because a car that is turned shows part of its
side. What is called a car may be a truck, and a truck a car. And at each height that it may have, and therefore at each
distance, the lower edge of its box fits the road or does not (``pipeline.fusion.ground_contact``).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numba
import numpy as np

from pipeline.types import F64, RoadSight

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
_LARGE = ("truck", "bus")
_HINT_SIGHTINGS = 10
"""A hint is the mean over so many sightings: long enough to average the noise of single boxes, short enough to
follow a vehicle that turns."""


_LOWEST = -0.25
"""ln(height / usual height of the class) of a sports car (1.2 m) among cars."""
_MAX_SIGMAS = 2.0
"""A range that implies a height more standard deviations lower than this is rejected."""
_STEP = 0.04
HEIGHT_RATIOS: F64 = np.arange(-1.2, 1.2 + _STEP / 2, _STEP)
"""(G,) values of ln(own height / height of the class) that are compared with the road: from a car that is called a bus
to a bus that is called a car. The step is less than the smallest standard deviation (``FLOOR_SHARE``)."""
_MISDRAWN = 0.05
"""Share of boxes whose lower edge has nothing to do with the road, as where something without a box hides the tyres. As
many edges of labelled vehicles are more than two standard deviations off (``pipeline.fusion.ground_contact``)."""
_LARGE_CALLED_CAR, _CAR_CALLED_LARGE = 0.03, 0.5
"""Odds that what is called a car is a truck or a bus, and the reverse. YOLOX-nano calls a third of the labelled trucks
and buses of Astyx and KITTI cars, and 2.5 % of the cars trucks (``measured_noise.json``). One in forty vehicles there
is a truck or a bus; on motorways one in seven."""


class OtherClass(NamedTuple):
    """What a vehicle may be instead of what it is called."""

    ratio: float = 0.0
    """ln(usual height of that / usual height of what it is called)."""
    odds: float = 0.0
    """Probability of that, relative to what it is called."""


NO_OTHER = OtherClass()


def other_class(label: str, factors: Mapping[str, float]) -> OtherClass:
    """The large vehicle that is called a car, or the car that is called a truck or bus. factors: height of each class
    over a car's; without both, nothing else."""
    large = max((factors[name] for name in _LARGE if name in factors), default=0.0)
    if large > 0.0 and label == "car":
        return OtherClass(math.log(large), _LARGE_CALLED_CAR)
    if label in _LARGE and label in factors:
        return OtherClass(-math.log(factors[label]), _CAR_CALLED_LARGE)
    return NO_OTHER


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
    """How a vehicle's boxes fit the road at each of ``HEIGHT_RATIOS``, averaged."""

    mean: RoadSight | None = None
    """The mean of each number; None before the first box."""
    sightings: int = 0
    """Number of boxes it is based on."""

    def seen(self, sight: RoadSight) -> RoadContact:
        """With one more box."""
        if self.mean is None:
            return RoadContact(sight, 1)
        count = min(self.sightings + 1, _HINT_SIGHTINGS)
        new, old = 1.0 / count, 1.0 - 1.0 / count
        mean = RoadSight(
            old * self.mean.above + new * sight.above,
            old * self.mean.lasting + new * sight.lasting,
            old * self.mean.noise + new * sight.noise,
            old * self.mean.tall + new * sight.tall,
        )
        return RoadContact(mean, count)

    def as_ratio_to(self, step: float) -> RoadContact:
        """The same for heights relative to another class, whose ln(height) is lower by ``step``."""
        return self if self.mean is None else self._replace(mean=relative_to(self.mean, step))


def relative_to(sight: RoadSight, step: float) -> RoadSight:
    """A sight for heights relative to another class, whose ln(height) is lower by ``step``."""
    if step == 0.0:
        return sight
    before = HEIGHT_RATIOS - step
    above, lasting = (np.interp(before, HEIGHT_RATIOS, each) for each in (sight.above, sight.lasting))
    return sight._replace(above=above, lasting=lasting)


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


def hinted(shape: BoxShape, contact: RoadContact, size_share: float, other: OtherClass = NO_OTHER) -> Height:
    """The height before any range, by Bayes' rule on ``HEIGHT_RATIOS``: of the class, changed by the shape of the
    boxes, or of another class, and in either case by how the boxes fit the road. Where class and road contradict each
    other, the edges may be misdrawn, and both remain possible.

    size_share: standard deviation of ln(height) within a class. other: what the vehicle may be instead.
    """
    if contact.mean is None:
        return Height(shape.height)
    above, lasting, noise, tall = contact.mean
    spread = max(size_share, _STEP)
    return Height(*_posterior(above, lasting, noise**2 / contact.sightings, tall, shape.height, spread, *other))


def warm_up() -> None:
    """Compile the kernel, or load it from numba's cache."""
    unknown = np.ones(len(HEIGHT_RATIOS))
    hinted(BoxShape(), RoadContact().seen(RoadSight(unknown, unknown, 1.0, 1.0)), 1.0)


@numba.njit(cache=True, nogil=True)
def _posterior(above, lasting, noise2, tall, usual, spread, other, odds):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Median and standard deviation of ln(height / height of the class). The median, because the distribution is
    skewed: the farther away, the less the road says."""
    weights = np.empty(len(above))
    for k in range(len(above)):
        a, b = (HEIGHT_RATIOS[k] - usual) / spread, (HEIGHT_RATIOS[k] - other) / spread
        prior = math.exp(-0.5 * a * a) + odds * math.exp(-0.5 * b * b)
        variance = lasting[k] * lasting[k] + noise2
        fits = math.exp(-0.5 * above[k] * above[k] / variance) / math.sqrt(2.0 * math.pi * variance)
        weights[k] = prior * ((1.0 - _MISDRAWN) * fits + _MISDRAWN / (2.0 * tall))
    weights /= weights.sum()
    mean, below, k = (weights * HEIGHT_RATIOS).sum(), 0.0, 0
    while below + weights[k] < 0.5:
        below += weights[k]
        k += 1
    median = HEIGHT_RATIOS[k] + _STEP * ((0.5 - below) / weights[k] - 0.5)
    return median, math.sqrt((weights * (HEIGHT_RATIOS - mean) ** 2).sum())


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
