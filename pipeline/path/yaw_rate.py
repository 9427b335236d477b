"""The path predicted from the car's turning: the arc of its smoothed yaw rate, and how far ahead it is valid.

Two errors limit an arc. The yaw rate is noisy (the sensor, and small steering corrections), which bends the arc wrongly
by σ·s²/(2v). And a road does not keep its curvature: between a straight and a bend the lateral acceleration changes
with some lateral jerk j, so after the path length s the arc is off by j·s³/(6v³). The second term depends only on the
time s/v: an arc is valid for about two seconds at any speed, so the look-ahead grows with speed.

Measured on 60 s of a real drive (comma2k19, 8–20 m/s, nearly straight): yaw rate as sampled 0.0046 rad/s around zero
(of which 0.0024 white, 0.0005 bias), lateral jerk 0.1 m/s³. Curves are entered at 0.3–0.9 m/s³ (AASHTO, *A Policy on
Geometric Design*, length of spirals): the default is near the upper end, because an overconfident arc at the end of a
bend pulls the path off the lane lines that show the end.

A yaw rate no larger than its noise is not a bend but a steering correction, and is gone in a second: the arc takes
ω / (1 + (σ/ω)⁴) of it, which keeps a bend and drops the noise. The noise that predicts the driven path of that
drive best, 0.007 rad/s, is the default: 0.04, 0.10 and 0.17 m aside after 1, 2 and 3 s.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

import numpy as np

from pipeline.common.fast_replace import evolve
from pipeline.params import PathParams
from pipeline.path.estimates import SHARPEST_BEGIN_PER_M2, PathEstimate, arc, samples
from pipeline.types import EgoState

_FASTEST_RADPS = 2.0
_LASTING = 0.5
"""Share of the noise that smoothing does not reduce."""


@dataclass(frozen=True)
class YawRate:
    """A smoothed yaw rate."""

    rate_radps: float
    """Positive to the left."""
    variance: float
    """(rad/s)²; grows while no yaw rate is measured."""


def follow(before: YawRate | None, ego: EgoState | None, dt_s: float | None, params: PathParams) -> YawRate | None:
    """The yaw rate now: a random walk that changes with the lateral jerk of roads, j/v in rad/s² (Kalman, one state).

    A rate that is not finite, or faster than any car turns, counts as not measured. None before the first measurement,
    and if own speed is unknown or too low for the yaw rate to show a curve.
    """
    if ego is None or not isfinite(ego.speed_mps) or ego.speed_mps < params.min_speed_mps:
        return None
    if before is not None and dt_s:
        change = params.lateral_jerk_mps3 / ego.speed_mps * dt_s
        coasted = ego.coasting.rate_var_rad2ps2 if ego.coasting is not None else 0.0
        before = YawRate(before.rate_radps, before.variance + change * change + coasted)
    measured = usable_rate(ego) if ego.coasting is None else None
    if measured is None:
        return before
    noise = params.yaw_rate_sigma_radps**2 + (ego.yaw_rate_sigma_radps or 0.0) ** 2
    if before is None:
        return YawRate(measured, noise)
    gain = before.variance / (before.variance + noise)
    return YawRate(before.rate_radps + gain * (measured - before.rate_radps), (1.0 - gain) * before.variance)


def usable_rate(ego: EgoState | None) -> float | None:
    """The measured yaw rate; None if it is missing or implausible."""
    rate = ego.yaw_rate_radps if ego is not None else None
    return rate if rate is not None and isfinite(rate) and abs(rate) <= _FASTEST_RADPS else None


def believable(ego: EgoState | None) -> EgoState | None:
    """Own motion without an implausible yaw rate; None if the speed is not finite."""
    if ego is None or not isfinite(ego.speed_mps):
        return None
    return ego if ego.yaw_rate_radps == usable_rate(ego) else evolve(ego, yaw_rate_radps=None)


def doubts(ego: EgoState | None) -> tuple[str, ...]:
    """Problems of a measured own motion, as sentences."""
    if ego is None or not isfinite(ego.speed_mps) or ego.yaw_rate_radps is None or usable_rate(ego) is not None:
        return ()
    return ("implausible yaw rate ignored",)


def ahead(yaw: YawRate | None, ego: EgoState | None, params: PathParams) -> PathEstimate | None:
    """The arc ahead, with lateral offset r(1 − cos θ) at path length s = rθ; None if no yaw rate is known.

    Its sigma combines the car's position and lateral speed within its lane, the yaw rate's error and the lateral jerk
    of roads. If the yaw rate is no longer measured, its variance has grown.
    """
    if yaw is None or ego is None or ego.speed_mps < params.min_speed_mps:
        return None
    s, speed = samples(params.length_m), ego.speed_mps
    time_s = s / speed
    center, _ = arc(_of_the_road(yaw.rate_radps, params.yaw_rate_sigma_radps) / speed, s)
    # a driver's corrections last for seconds, so smoothing does not make the yaw rate more certain than that
    rate_sigma = max(yaw.variance**0.5, _LASTING * params.yaw_rate_sigma_radps)
    variance = (
        params.lane_keeping_sigma_m**2
        + (params.lane_keeping_sigma_mps * time_s) ** 2
        + (0.5 * rate_sigma * speed * time_s**2) ** 2
        + (min(params.lateral_jerk_mps3 / speed**3, SHARPEST_BEGIN_PER_M2) / 6.0 * s**3) ** 2
    )
    return PathEstimate("yaw_rate", center, np.sqrt(variance))


def _of_the_road(rate_radps: float, sigma_radps: float) -> float:
    """The part of a yaw rate that is attributed to the road."""
    return rate_radps**5 / (rate_radps**4 + sigma_radps**4)
