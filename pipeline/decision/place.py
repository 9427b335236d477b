"""Where an object is relative to the path, and how surely it is in it."""

from __future__ import annotations

from math import copysign, erf, exp, log, sqrt
from typing import NamedTuple

_STEEPEST = 0.58
"""tan 30°. A vehicle that changes lanes is turned by 10° at most, and the direction of an uncertain path 40 m ahead may
be wrong by 20°; what drives at a larger angle to it does not drive along it."""
_SUREST_M = 0.01
SURE = 4.0
"""Limit of the log-odds: the sigmas themselves are not known that precisely."""


class Place(NamedTuple):
    """Position of one object relative to the path. Lateral values are positive to the left of the path's centre."""

    offset_m: float
    """Lateral offset of the middle of its nearest face."""
    ahead_m: float
    """Path length to the foot of that point on the centre line."""
    low_m: float
    """Its rightmost extent across the path."""
    high_m: float
    """Its leftmost extent across the path."""
    middle_m: float
    """Middle between the two."""
    left_m: float
    """How far to the left the middle may be for the object to be in the path."""
    right_m: float
    """The same to the right."""
    sigma_m: float
    """Standard deviation of its lateral position relative to the path, including the path's error."""
    usual_m: float
    """The same if the road goes on as the path says; ``sigma_m`` unless the object drives where the road goes."""
    rare_m: float
    """The same if it does not."""
    sideways_mps: float | None
    """Speed to the left of the path, over ground; None if its velocity is not known."""
    forward_mps: float = 0.0
    """Speed along the path, over ground; relative to the car while ego speed is unknown."""
    believed_mps: float = 0.0
    """The part of ``sideways_mps`` that is surely motion: see ``path_position.believed_mps``."""
    goes_on: float = 0.0
    """Probability that the road goes on as the path says."""

    @property
    def limit_m(self) -> float:
        """``left_m`` or ``right_m``, for the side where it is."""
        return self.left_m if self.middle_m >= 0.0 else self.right_m

    @property
    def drives_along(self) -> bool:
        """Whether its course is along the path, as far as the path's direction is known."""
        return self.sideways_mps is not None and abs(self.sideways_mps) < _STEEPEST * abs(self.forward_mps)

    def margin_m(self, extra_m: float = 0.0) -> float:
        """How far inside the path it is; negative if outside. extra_m widens the path."""
        return min(self.left_m + extra_m - self.middle_m, self.right_m + extra_m + self.middle_m)

    def probability(self, extra_m: float = 0.0) -> float:
        """Probability that it is in the path, given the distribution of its position around the measured one. Unlike
        ``log_odds``, which only depends on the side of the edge, this is below a half if the path's uncertainty exceeds
        its width."""
        left_m, right_m = self.left_m + extra_m - self.middle_m, self.right_m + extra_m + self.middle_m
        total = 0.0
        for weight, sigma_m in self._spreads():
            scale = 1.0 / (max(sigma_m, _SUREST_M) * sqrt(2.0))
            total += weight * max(0.0, 0.5 * (erf(left_m * scale) + erf(right_m * scale)))
        return total

    def log_odds(self, extra_m: float, moves_m: float) -> float:
        """Log-odds from this sighting that the object is in the path: the log-likelihood ratio of its position compared
        with the nearest position on the other side of the edge, at most ±4. moves_m: distance to the left by which the
        object is assumed to have moved since."""
        if self.ahead_m <= 0.0:
            return -SURE
        middle = self.middle_m + moves_m
        margin = min(self.left_m + extra_m - middle, self.right_m + extra_m + middle)
        surety = min(self._surety(margin), SURE)
        return surety if margin >= 0.0 else -surety

    def margin_of(self, odds: float) -> float:
        """How far inside the path an object of these log-odds is; of one that drives ahead, if the road goes on."""
        sigma_m = self.usual_m if self.goes_on else self.sigma_m
        return copysign(sigma_m * sqrt(2.0 * abs(odds)), odds)

    def _spreads(self) -> tuple[tuple[float, float], ...]:
        """Weight and standard deviation of each part of the distribution of its lateral position."""
        if not self.goes_on:
            return ((1.0, self.sigma_m),)
        return (self.goes_on, self.usual_m), (1.0 - self.goes_on, self.rare_m)

    def _surety(self, margin_m: float) -> float:
        """Log-likelihood ratio of an error of 0 and one of ``margin_m``."""
        if not self.goes_on:
            return 0.5 * (margin_m / self.sigma_m) ** 2
        none, such = 0.0, 1e-300  # not 0 where an error is all but impossible
        for weight, sigma_m in self._spreads():
            none += weight / sigma_m
            such += weight / sigma_m * exp(-0.5 * (margin_m / sigma_m) ** 2)
        return log(none / such)

    def crossing_s(self, half_left_m: float, half_right_m: float) -> float | None:
        """Seconds until the nearer side of an object outside the path crosses the edge, or until an object inside has
        left; None if its estimated lateral speed (positive to the left) leads to neither. 0: on the edge."""
        if self.believed_mps == 0.0 or self.ahead_m <= 0.0:
            return None
        outwards = (self.middle_m > 0.0) == (self.believed_mps > 0.0)
        if outwards != (self.margin_m() >= 0.0):  # it moves towards the middle inside the path, or away outside it
            return None
        if outwards:
            way = self.margin_m()
        else:
            way = self.low_m - half_left_m if self.middle_m > 0.0 else -half_right_m - self.high_m
        return max(way, 0.0) / abs(self.believed_mps)
