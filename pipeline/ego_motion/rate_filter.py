"""Estimates a rate from noisy displacements: a Kalman filter with two states, the rate and its derivative.

Between two sweeps the car moves by d = v·Δt − a·Δt²/2, with v and a at the end of the interval: a displacement is the
mean rate of the interval, which would lag by half of it. The same applies to heading and yaw rate."""

from __future__ import annotations

from typing import NamedTuple


class RateFilter(NamedTuple):
    """A rate, its change per second, and their covariance."""

    rate: float
    """m/s or rad/s."""
    change: float
    """Its rate of change: m/s² or rad/s²."""
    rate_var: float
    """Variance of the rate."""
    cross: float
    """Covariance of rate and change."""
    change_var: float
    """Variance of the change."""

    @property
    def sigma(self) -> float:
        """Standard deviation of the rate."""
        return max(self.rate_var, 0.0) ** 0.5


def start(moved: float, dt_s: float, moved_sigma: float, change_sigma: float) -> RateFilter:
    """Initialised from one displacement: its mean rate, and a change of 0 ± ``change_sigma``."""
    return RateFilter(
        moved / dt_s,
        0.0,
        (moved_sigma / dt_s) ** 2 + (0.5 * change_sigma * dt_s) ** 2,
        0.5 * change_sigma**2 * dt_s,
        change_sigma**2,
    )


def predict(before: RateFilter, dt_s: float, jerk: float) -> RateFilter:
    """The filter ``dt_s`` later. jerk: random walk of the change in one second, growing with the square root of
    time."""
    rate, change, a, b, c = before
    q = jerk * jerk
    return RateFilter(
        rate + change * dt_s,
        change,
        a + 2.0 * dt_s * b + dt_s * dt_s * c + q * dt_s**3 / 3.0,
        b + dt_s * c + q * dt_s * dt_s / 2.0,
        c + q * dt_s,
    )


def expected(now: RateFilter, dt_s: float) -> tuple[float, float]:
    """The displacement over the last ``dt_s`` predicted by the filter, and its variance."""
    h = -0.5 * dt_s * dt_s
    moved = now.rate * dt_s + now.change * h
    return moved, dt_s * dt_s * now.rate_var + 2.0 * dt_s * h * now.cross + h * h * now.change_var


def update(now: RateFilter, moved: float, dt_s: float, moved_sigma: float) -> RateFilter:
    """The predicted filter, corrected by the displacement over the last ``dt_s``."""
    foreseen, spread = expected(now, dt_s)
    h = -0.5 * dt_s * dt_s
    noise = moved_sigma * moved_sigma
    to_rate, to_change = now.rate_var * dt_s + now.cross * h, now.cross * dt_s + now.change_var * h
    total = spread + noise
    surprise = moved - foreseen
    return RateFilter(
        now.rate + to_rate / total * surprise,
        now.change + to_change / total * surprise,
        now.rate_var - to_rate * to_rate / total,
        now.cross - to_rate * to_change / total,
        now.change_var - to_change * to_change / total,
    )
