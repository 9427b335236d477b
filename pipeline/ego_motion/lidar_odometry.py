"""Ego motion from the LiDAR: each sweep is registered to the previous ones, and two filters turn displacements into
rates.

    structure of the sweep → registered to the last sweeps' → displacement, turn → filters → speed, yaw rate, pose

The result is used once the sweeps agree with each other, and while enough structure constrains it. Few points, a
tunnel, or nothing but vehicles nearby end it, with a note. Accuracy on KITTI at 16 rings:
``docs/reference/accuracy-ego-motion.md``."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, ceil, cos, hypot, sin
from typing import NamedTuple

import numpy as np

from pipeline.common.fast_replace import evolve
from pipeline.ego_motion import rate_filter, registration, structure
from pipeline.ego_motion.rate_filter import RateFilter
from pipeline.lidar import deskew
from pipeline.params import DeskewParams
from pipeline.types import F32, F64, EgoState, Ground, LidarTrack, Sweep

_KEPT = 5
"""Number of sweeps in the map. With three, own speed is biased towards zero by 0.17 m/s, with five by 0.03; ten bring
no further gain."""
_CELL_SIGMA_M = 0.25
"""Position accuracy from one cell of structure: limited by the spacing of points of a 16-channel LiDAR."""
_FEWEST_CELLS = 15.0
"""With fewer cells along either axis, the position is not observable."""
_FEWEST_POINTS = 40
_LEAST_FIT = 0.4
"""Minimum share of structure that matches the previous sweeps: 0.73 and more in a street, 0.5 on a bare motorway."""
_ACCEL_MPS2, _JERK_MPS3 = 3.0, 2.0
_TURN_RADPS2, _TURN_JERK_RADPS3 = 0.2, 0.1
"""Usual dynamics of cars: braking up to 3 m/s² without an emergency; at 10 m/s, bends entered with a lateral jerk of 1
m/s³."""
_GATE_SIGMAS = 5.0
_FASTEST_MPS, _START_STEP_M = 45.0, 2.0
"""Without a known motion, speeds up to this are searched, in steps small enough for registration to converge."""
_AGREEING = 2
"""Number of displacements that must agree before the motion is trusted."""
_MOST_REFUSED = 2
_LONGEST_GAP_S = 1.5
"""After this time without a sweep, odometry restarts."""
_DESKEW = DeskewParams(enabled=True)
_CONTRADICTS = "LiDAR odometry: sweeps contradict each other"
_NOT_INSTALLED = "LiDAR odometry: not available, since kiss-icp has no package for this version of Python"


Rates = tuple[RateFilter, RateFilter]
"""Of the speed and of the heading."""


@dataclass(frozen=True, eq=False)
class OdometryState:
    """State from one sweep to the next."""

    clouds: tuple[F32, ...] = ()
    """Structure of the last sweeps, (N, 3) each, in the ego frame of its time."""
    poses: tuple[F64, ...] = ()
    """(4, 4) of each: T_start_ego."""
    speed: RateFilter | None = None
    """m/s along x; None before the first displacement."""
    turning: RateFilter | None = None
    """Yaw rate, rad/s."""
    agreeing: int = 0
    """Number of consecutive displacements that agreed."""
    refused: int = 0
    """Number of consecutive displacements that did not agree."""
    unplaced_s: float = 0.0
    """Time since a sweep was last registered."""


class LidarMotion(NamedTuple):
    """Own motion at a sweep's tick."""

    speed_mps: float
    """Positive forwards."""
    speed_sigma_mps: float
    """Standard deviation of the speed."""
    yaw_rate_radps: float
    """Positive to the left."""
    yaw_rate_sigma_radps: float
    """Standard deviation of the yaw rate."""
    pose: tuple[float, float, float]
    """x, y in metres and heading in radians since odometry started, in the ego frame of that moment."""


class OdometryStep(NamedTuple):
    """Result of odometry for one sweep."""

    state: OdometryState
    """For the next sweep."""
    motion: LidarMotion | None
    """None while it is not trusted."""
    note: str = ""
    """Why it is not trusted, in words; empty if nothing is wrong."""


def follow(
    before: OdometryState,
    sweep: Sweep | None,
    ground: Ground | None,
    tracks: tuple[LidarTrack, ...],
    dt_s: float | None,
    prior: EgoState | None,
) -> OdometryStep:
    """Own motion after one more sweep.

    Args:
        before: state after the previous sweep.
        sweep: the current sweep; None if it is missing.
        ground: road of the previous sweep; without it only the next sweep can be used.
        tracks: LiDAR tracks of the previous sweep, used to exclude vehicles.
        dt_s: seconds since the previous frame; None at the start and after a gap, where odometry restarts.
        prior: own motion from another sensor, as initial value.
    """
    if dt_s is None:
        return OdometryStep(OdometryState(), None)
    if before.unplaced_s + dt_s > _LONGEST_GAP_S:
        before = OdometryState()
    since_s = before.unplaced_s + dt_s
    if sweep is not None and not registration.is_available():
        return OdometryStep(OdometryState(), None, _NOT_INSTALLED)
    if sweep is None or ground is None:
        return OdometryStep(evolve(before, unplaced_s=since_s, agreeing=0), None)
    speed, turning = _foreseen(before, since_s, prior)
    expected = EgoState(sweep.t_ns, speed.rate, turning.rate) if speed is not None and turning is not None else None
    points = structure.standing(deskew.deskew(sweep, expected, _DESKEW) or sweep, ground, tracks, dt_s)
    fixed = structure.support(points)
    if len(points) < _FEWEST_POINTS or min(fixed.along_x, fixed.along_y) < _FEWEST_CELLS:
        return OdometryStep(OdometryState(), None, _too_little(len(points), fixed))
    cloud = registration.thinned(points)
    if not before.clouds:
        return OdometryStep(OdometryState((cloud,), (np.eye(4),)), None)

    moved = _registered(before, cloud, fixed, since_s, (speed, turning))
    if before.speed is None or before.turning is None:
        rates = (
            rate_filter.start(moved.along_m, since_s, moved.along_sigma_m, _ACCEL_MPS2),
            rate_filter.start(moved.turned_rad, since_s, moved.turned_sigma_rad, _TURN_RADPS2),
        )
        return _stepped(before, cloud, moved.pose, rates, 1)
    foreseen = (
        rate_filter.predict(before.speed, since_s, _JERK_MPS3),
        rate_filter.predict(before.turning, since_s, _TURN_JERK_RADPS3),
    )
    if moved.fit < _LEAST_FIT or moved.surprise(foreseen, since_s) > _GATE_SIGMAS:
        return _refused(before, cloud, foreseen, since_s)
    rates = (
        rate_filter.update(foreseen[0], moved.along_m, since_s, moved.along_sigma_m),
        rate_filter.update(foreseen[1], moved.turned_rad, since_s, moved.turned_sigma_rad),
    )
    return _stepped(before, cloud, moved.pose, rates, before.agreeing + 1)


class _Moved(NamedTuple):
    """Where a sweep was registered, and the displacement since the last one."""

    pose: F64
    """(4, 4) T_start_ego."""
    fit: float
    """Share of structure that matches."""
    along_m: float
    """Length of the arc."""
    along_sigma_m: float
    """Standard deviation of that."""
    turned_rad: float
    """Positive to the left."""
    turned_sigma_rad: float
    """Standard deviation of that."""

    def surprise(self, foreseen: Rates, since_s: float) -> float:
        """Deviation from the prediction, in standard deviations; the larger of the two."""
        return max(
            _surprise(foreseen[0], self.along_m, since_s, self.along_sigma_m),
            _surprise(foreseen[1], self.turned_rad, since_s, self.turned_sigma_rad),
        )


def _registered(
    before: OdometryState,
    cloud: F32,
    fixed: structure.Support,
    since_s: float,
    foreseen: tuple[RateFilter | None, RateFilter | None],
) -> _Moved:
    """The cloud registered to the last ones, from the foreseen motion or, without one, from every speed of a car."""
    last, (speed, turning) = before.poses[-1], foreseen
    starts = [speed.rate] if speed is not None else _starts(since_s)
    rate = turning.rate if turning is not None else 0.0
    guesses = [last @ _moved_by(start * since_s, rate * since_s) for start in starts]
    pose, fit = registration.align(cloud, before.clouds, before.poses, guesses)
    step = np.linalg.inv(last) @ pose
    turned = atan2(step[1, 0], step[0, 0])
    along = float(step[0, 3]) * cos(0.5 * turned) + float(step[1, 3]) * sin(0.5 * turned)
    return _Moved(pose, fit, along, _CELL_SIGMA_M / fixed.along_x**0.5, turned, _CELL_SIGMA_M / fixed.turning_m2**0.5)


def _stepped(before: OdometryState, cloud: F32, pose: F64, rates: Rates, agreeing: int) -> OdometryStep:
    """After a displacement that the filters accept."""
    after = OdometryState((*before.clouds, cloud)[-_KEPT:], (*before.poses, pose)[-_KEPT:], *rates, agreeing)
    return OdometryStep(after, _motion(rates, pose) if agreeing >= _AGREEING else None)


def _refused(before: OdometryState, cloud: F32, foreseen: Rates, since_s: float) -> OdometryStep:
    """After a displacement that contradicts the filters: the foreseen motion, for a few sweeps; then a new start."""
    if before.refused + 1 > _MOST_REFUSED or before.agreeing < _AGREEING:
        return OdometryStep(OdometryState((cloud,), (np.eye(4),)), None, _CONTRADICTS)
    kept = evolve(before, refused=before.refused + 1, unplaced_s=since_s)
    expected = [rate_filter.expected(each, since_s)[0] for each in foreseen]
    return OdometryStep(kept, _motion(foreseen, before.poses[-1] @ _moved_by(*expected)), _CONTRADICTS)


def _too_little(points: int, fixed: structure.Support) -> str:
    if points >= _FEWEST_POINTS and fixed.along_y >= _FEWEST_CELLS:
        return "LiDAR odometry: no structure along the road, as in a tunnel"
    return "LiDAR odometry: too few static objects nearby"


def _foreseen(
    before: OdometryState, dt_s: float, prior: EgoState | None
) -> tuple[RateFilter | None, RateFilter | None]:
    """Predicted speed and yaw rate: from the filters, else from another sensor."""
    if before.speed is not None and before.turning is not None:
        return (
            rate_filter.predict(before.speed, dt_s, _JERK_MPS3),
            rate_filter.predict(before.turning, dt_s, _TURN_JERK_RADPS3),
        )
    if prior is None:
        return None, None
    return (
        rate_filter.start(prior.speed_mps, 1.0, 0.0, _ACCEL_MPS2),
        rate_filter.start(prior.yaw_rate_radps or 0.0, 1.0, 0.0, _TURN_RADPS2),
    )


def _starts(dt_s: float) -> list[float]:
    """Initial speeds to try if none is known."""
    count = ceil(_FASTEST_MPS * dt_s / _START_STEP_M)
    return [k * _START_STEP_M / dt_s for k in range(count + 1)]


def _surprise(foreseen: RateFilter, moved: float, dt_s: float, sigma: float) -> float:
    """Deviation of a displacement from the predicted one, in standard deviations."""
    expected, spread = rate_filter.expected(foreseen, dt_s)
    return abs(moved - expected) / hypot(spread**0.5, sigma)


def _moved_by(moved: float, turned: float) -> F64:
    """(4, 4) transform of a short arc along the ground."""
    pose = np.eye(4)
    c, s = cos(turned), sin(turned)
    pose[:2, :2] = [[c, -s], [s, c]]
    pose[:2, 3] = moved * cos(0.5 * turned), moved * sin(0.5 * turned)
    return pose


def _motion(rates: Rates, pose: F64) -> LidarMotion:
    speed, turning = rates
    place = (float(pose[0, 3]), float(pose[1, 3]), atan2(pose[1, 0], pose[0, 0]))
    return LidarMotion(speed.rate, speed.sigma, turning.rate, turning.sigma, place)
