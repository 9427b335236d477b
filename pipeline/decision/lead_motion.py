"""Estimates the lead's acceleration over ground, with its sigma: whether it brakes, before the gap shows it.

A filter of the lead alone, with the state distance, speed over ground and acceleration. It measures the distance; the
car's own speed is known, so its braking is not taken for the lead's. Acceleration follows Singer's model (1970): it
fades with ``_FADES_S`` and varies by ``_USUAL_MPS2``, which also says what a new lead does before anything is measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp

import numpy as np

from pipeline.common.fast_replace import evolve
from pipeline.types import F64, Cipv, EgoState, FusedObject, Moment

_USUAL_MPS2, _FADES_S = 1.0, 4.0
"""Standard deviation of the acceleration in traffic, and the time in which it is forgotten: 0.7 m/s² and 4.3 s in a
minute of comma2k19 at 29 to 71 km/h, 0.3 m/s² on KITTI 0009. Leads also brake harder than that."""
_CLUSTER_NOISE_M = 0.1
"""Standard deviation of a LiDAR distance from sweep to sweep, without its constant part: 0.04 m for the lead of KITTI
0052, and more where other parts of the vehicle come into view."""
_SPEED_SIGMA_MPS = 5.0
"""Of a new lead's speed; the filter needs half a second of LiDAR distances to do better."""
_KNOWN_MPS2 = 0.8
"""An acceleration is reported once its standard deviation is below this: without any measurement, it is 1 m/s², and the
camera's distances hardly change that."""
_MAX_NIS = 10.8
"""99.9 % of χ² with one degree of freedom: a distance farther off is another vehicle's, or another part's."""


@dataclass(frozen=True)
class LeadMotionState:
    """State from one frame to the next."""

    id: int | None = None
    """The lead that is followed; None without one."""
    mean: F64 | None = None
    """(3,) distance m, speed over ground m/s, acceleration m/s²."""
    cov: F64 | None = None
    """(3, 3) of these."""
    own_mps: float = 0.0
    """The car's own speed then."""


def follow(
    state: LeadMotionState, lead: Cipv | None, objects: Sequence[FusedObject], now: Moment
) -> tuple[LeadMotionState, Cipv | None]:
    """The lead with its acceleration, which is None until it is known, and without own speed."""
    item = next((each for each in objects if lead is not None and each.id == lead.id), None)
    if lead is None or item is None or now.ego is None:
        return LeadMotionState(), lead
    own_mps, sigma_m = now.ego.speed_mps, _noise_m(item)
    before = state if state.id == lead.id and now.dt_s is not None else LeadMotionState()
    if before.mean is None or before.cov is None:
        return _started(lead, now.ego, sigma_m), lead
    assert now.dt_s is not None
    mean, cov = _predicted(before.mean, before.cov, (before.own_mps + own_mps) / 2, now.dt_s)
    if item.measured and not item.carried:
        gain = cov[:, 0] / (cov[0, 0] + sigma_m**2)
        off = lead.distance_m - mean[0]
        if off * off > _MAX_NIS * (cov[0, 0] + sigma_m**2):
            return _started(lead, now.ego, sigma_m), lead
        keep = np.eye(3)
        keep[:, 0] -= gain
        mean, cov = mean + gain * off, keep @ cov @ keep.T + np.outer(gain, gain) * sigma_m**2
    if mean[1] < 0.0:
        mean = np.array([mean[0], 0.0, max(mean[2], 0.0)])  # it has stopped, and does not go on to drive backwards
    sigma_mps2 = float(cov[2, 2]) ** 0.5
    if item.ranged and sigma_mps2 < _KNOWN_MPS2:
        lead = evolve(lead, accel_mps2=float(mean[2]), accel_sigma_mps2=sigma_mps2)
    return LeadMotionState(lead.id, mean, cov, own_mps), lead


def _noise_m(item: FusedObject) -> float:
    """Standard deviation of its distance from frame to frame."""
    return _CLUSTER_NOISE_M if item.distance_from == "cluster" else max(item.distance_sigma_m or 0.0, _CLUSTER_NOISE_M)


def _started(lead: Cipv, ego: EgoState, sigma_m: float) -> LeadMotionState:
    speed_mps = max(ego.speed_mps - (lead.closing_speed_mps or 0.0), 0.0)
    cov = np.diag([sigma_m**2, _SPEED_SIGMA_MPS**2, _USUAL_MPS2**2])
    return LeadMotionState(lead.id, np.array([lead.distance_m, speed_mps, 0.0]), cov, ego.speed_mps)


def _predicted(mean: F64, cov: F64, own_mps: float, dt_s: float) -> tuple[F64, F64]:
    """``dt_s`` later, while the car drives at ``own_mps``."""
    dt, fades = dt_s, exp(-dt_s / _FADES_S)
    step = np.array([[1.0, dt, dt * dt / 2], [0.0, 1.0, dt], [0.0, 0.0, fades]])
    noise = (2.0 * _USUAL_MPS2**2 / _FADES_S) * np.array(
        [
            [dt**5 / 20, dt**4 / 8, dt**3 / 6],
            [dt**4 / 8, dt**3 / 3, dt**2 / 2],
            [dt**3 / 6, dt**2 / 2, dt],
        ]
    )
    moved = step @ mean
    moved[0] -= own_mps * dt
    return moved, step @ cov @ step.T + noise
