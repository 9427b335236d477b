"""Estimates an angle from what many vehicles show over time, and whether it changed at some moment.

Each vehicle is off by the angle of the mount plus an error of its own that lasts, because a detector that draws one car
too wide continues to do so. The change of the angle at a given moment is therefore known much better than the angle
itself: the errors of vehicles seen before and after cancel. Both follow from one weighted least-squares problem with
an unknown per vehicle (a random effect), which is eliminated. A time offset between the sensors moves each vehicle by
the rate of its bearing; it is a third unknown.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.types import F64, I64, Mask

LASTING_SHARE, LASTING_DEG = 0.06, 0.12
"""Error of a vehicle that lasts: of its box, as a share of the height, and of its cluster, whose sides lie between
beams 0.2° to 0.4° apart (1 σ)."""
FRAME_SHARE = 0.05
"""Error of a box that is new in each frame, as a share of its height."""
SLOW_SHARE, SLOW_DEG = 0.06, 0.15
"""Error that is the same for half a second and then another: a vehicle turns, comes nearer, is partly hidden."""
SIDE_ASPECT, SIDE_DEG = 1.4, 0.4
"""A box that is wider than its height by more than the first number shows a vehicle's side too, of which the LiDAR hits
little: its yaw then has this error, too (1 σ). In simulated drives without a turn (12 km, 14 drives), yaws are within
0.6° in 92 % of the narrower boxes and in 74 % of the wider ones."""
PASSING_S = 0.08
"""Both errors grow with the rate of the bearing: another side of the vehicle comes into sight, and the sweep sees it
at another moment than its tick."""
ALIGNED_DEG, WIDEST_DEG = 0.2, 5.0
"""Standard deviation of the angle before the camera was turned, as calibrations are, and after it, when nothing is
known."""
TIME_SIGMA_S = 0.05
"""Standard deviation of the time offset between the sensors. For vehicles whose bearing changes fast, such as oncoming
ones, a time offset looks like an angle; if all vehicles are of this kind, no angle can be determined."""
DOUBTED, ROUNDS = 2.0, 5
"""Standard deviations at which a vehicle or a sighting has half its weight (Cauchy), so that wrong pairs hardly count;
rounds of re-weighting."""


class AngleSightings(NamedTuple):
    """What vehicles and lane lines show in pieces of time, M rows."""

    piece: I64
    """(M,) number of the piece of time; ascending."""
    vehicle: I64
    """(M,) which vehicle, from 0 without gaps. All lane lines together are one more."""
    track: I64
    """(M,) which track, from 0 without gaps. A track whose size jumps counts as several vehicles, each with an error of
    its own, but not as several witnesses."""
    frames: F64
    """(M,) number of frames."""
    rate_degps: F64
    """(M,) rate of its bearing, mean; 0 for lines and for elevations."""
    sigma_deg: F64
    """(M,) standard deviation of the error that is new in each piece."""
    lasting_deg: F64
    """(M,) standard deviation of the error of the vehicle that lasts."""
    is_line: Mask
    """(M,) whether lane lines show it."""


class AngleChange(NamedTuple):
    """The angle before and after each of T moments, with standard deviations; degrees."""

    before: F64
    """(T,)."""
    after: F64
    """(T,)."""
    after_sigma: F64
    """(T,)."""
    step_sigma: F64
    """(T,) of ``after − before``."""
    time_s: F64
    """(T,) time offset of the images."""
    own: F64
    """(T, V) error of each vehicle."""


def box_errors(frames: F64, height_deg: F64, rate_degps: F64, has_side: Mask, road_deg: F64) -> tuple[F64, F64]:
    """(M,) and (M,) standard deviations of the new and the lasting error of a vehicle's angle in a piece of time.
    frames: in which it was seen. height_deg: of its box. rate_degps: of its bearing. has_side: whether its side is seen
    too; False for elevations. road_deg: the error of an elevation for that of the road, which is the same for half a
    second, and then another; 0 for azimuths."""
    passing = (PASSING_S * rate_degps) ** 2
    new = (FRAME_SHARE * height_deg) ** 2 / frames + SLOW_DEG**2 + (SLOW_SHARE * height_deg) ** 2 + passing
    new += road_deg**2
    lasting = LASTING_DEG**2 + (LASTING_SHARE * height_deg) ** 2 + SIDE_DEG**2 * has_side + passing
    return np.sqrt(new), np.sqrt(lasting)


def changes(seen: AngleSightings, values: F64, moments: I64) -> AngleChange:
    """For each moment, the angle before it and from then on. values: (M,) degrees. moments: (T,) pieces of time."""
    count = int(seen.vehicle.max()) + 1
    of_vehicle = np.equal.outer(seen.vehicle, np.arange(count)).astype(np.float64)
    own_sigma, sigma = _means(seen.lasting_deg, of_vehicle), seen.sigma_deg
    is_after = (seen.piece[None] >= moments[:, None]).astype(np.float64)
    design = np.stack([1.0 - is_after, is_after, np.broadcast_to(seen.rate_degps, is_after.shape)], axis=1)
    prior = np.diag([ALIGNED_DEG**-2, WIDEST_DEG**-2, TIME_SIGMA_S**-2])
    weight = np.broadcast_to(sigma**-2, is_after.shape)
    hold = np.broadcast_to(own_sigma**-2, (len(moments), count))
    for _ in range(ROUNDS):
        weighted = design * weight[:, None]
        sums = weighted @ of_vehicle
        total = weight @ of_vehicle + hold
        normal = weighted @ design.transpose(0, 2, 1) - (sums / total[:, None]) @ sums.transpose(0, 2, 1) + prior
        seen_sum = (weight * values) @ of_vehicle
        right = (weighted @ values[:, None])[..., 0] - (sums @ (seen_sum / total)[..., None])[..., 0]
        covariance = np.linalg.inv(normal)
        found = (covariance @ right[..., None])[..., 0]
        own = (seen_sum - np.einsum("tkv,tk->tv", sums, found)) / total
        off = np.abs(values - np.einsum("tkm,tk->tm", design, found) - own @ of_vehicle.T) / sigma
        weight = sigma**-2 / (1.0 + (off / DOUBTED) ** 2)
        hold = own_sigma**-2 / (1.0 + (own / own_sigma / DOUBTED) ** 2)
    variance = covariance[:, 0, 0] + covariance[:, 1, 1] - 2.0 * covariance[:, 0, 1]
    return AngleChange(
        found[:, 0],
        found[:, 1],
        np.sqrt(covariance[:, 1, 1]),
        np.sqrt(variance),
        found[:, 2],
        own,
    )


def _means(values: F64, of_vehicle: F64) -> F64:
    return (values @ of_vehicle) / of_vehicle.sum(axis=0)
