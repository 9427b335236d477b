"""Fits the mount of the LiDAR to a drive: yaw relative to the direction of travel, pitch and roll relative to the road,
the height above the road and, if the drive has enough bends, the distance from the rear axle.

A car's rear axle moves straight ahead. The sideways motion of a LiDAR at a distance L ahead of it is therefore L times
the car's turn, and the rest is due to yaw: ``left = −yaw·forward + L·turn``. Along the car, where the car's own speed
is known: ``forward = scale·driven − B·turn`` for a LiDAR B to the left of the axle's centre.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import atan, degrees, hypot

import numpy as np

from pipeline.calibration.mount.observe import MountRecord, Piece, RoadPlane
from pipeline.common.errors import BadInput
from pipeline.common.geometry import inverse, rotation
from pipeline.common.robust import mad_sigma
from pipeline.types import F64, CameraCalibration

FEWEST_ROADS, FEWEST_PIECES = 10, 8
BLOCK_NS = 3_000_000_000
"""Observations within three seconds show the same road and are resampled together."""
BOOTSTRAPS = 100
PITCH_ROAD_DEG, ROLL_ROAD_DEG, HEIGHT_ROAD_M = 0.15, 0.3, 0.01
"""Deviation of roads from flat ones, beyond what a drive on one road shows. Between KITTI 0009 and 0052, two roads with
the same car, pitch differs by 0.16°, roll by 0.53° and height by 1 cm."""
YAW_FLOOR_DEG = 0.1
"""On bare roads in the simulator, a yaw of 2° is underestimated by up to 0.4°."""
AXLE_M, AXLE_SIGMA_M = 1.5, 1.5
"""A LiDAR is between the rear axle and the front bumper: prior for the distance to the axle on straight drives."""
TOLD_M = 0.4
"""Offsets from the axle with a larger standard deviation are not reported."""
UNSURE = {"yaw_deg": 0.3, "pitch_deg": 0.4, "roll_deg": 0.6, "height_m": 0.05}
"""Standard deviations from which a warning names the value."""
ROBUST_M = 0.1
"""Pieces with larger residuals get less weight."""


class NoMount(BadInput):
    """The drive does not determine any part of the mount; the text says why."""


@dataclass(frozen=True)
class MountFit:
    """Pose of the recording's ego frame, which is the LiDAR's, in the car."""

    values: Mapping[str, float]
    """yaw_deg to the left of the direction of travel, pitch_deg downwards and roll_deg clockwise relative to the road,
    height_m of the ego origin above it; ahead_of_axle_m and left_of_axle_m relative to the middle of the rear axle.
    Only values that the drive determines."""
    sigmas: Mapping[str, float]
    """Standard deviation of each value."""
    frames: int
    """Number of frames with a fitted road."""
    driven_m: float
    """Distance driven with reliable odometry."""
    speed_scale: float | None
    """LiDAR distance per metre of the car's own odometry; None without that."""
    warnings: tuple[str, ...] = ()
    """What the drive does not determine, in sentences."""


def fit_mount(record: MountRecord) -> MountFit:
    """All values that the drive determines. Raises NoMount if there is none."""
    values: dict[str, float] = {}
    sigmas: dict[str, float] = {}
    warnings: list[str] = []
    scale = None
    if len(record.roads) >= FEWEST_ROADS:
        _take(values, sigmas, _against_road(record.roads))
    else:
        warnings.append(f"the road is seen in {len(record.roads)} of {record.frames} frames: no pitch, roll, height")
    if len(record.pieces) >= FEWEST_PIECES:
        way = _against_travel(record.pieces)
        if way["ahead_of_axle_m"][1] > TOLD_M:
            del way["ahead_of_axle_m"]
        _take(values, sigmas, way)
        measured = [each for each in record.pieces if each.driven_m]
        if len(measured) >= FEWEST_PIECES:
            along = _against_speed(measured)
            scale = along.pop("speed_scale")[0]
            if along["left_of_axle_m"][1] <= TOLD_M:
                _take(values, sigmas, along)
    else:
        driven = sum(hypot(each.forward_m, each.left_m) for each in record.pieces)
        warnings.append(f"only {driven:.0f} m driven with reliable LiDAR odometry: no yaw")
    if not values:
        raise NoMount("; ".join(warnings))
    for name, limit in UNSURE.items():
        if sigmas.get(name, 0.0) > limit:
            unit = "°" if name.endswith("_deg") else " m"
            warnings.append(f"{name.rpartition('_')[0]} is known only to ±{sigmas[name]:.2g}{unit}")
    if "yaw_deg" in values and "ahead_of_axle_m" not in values:
        warnings.append("the drive is too straight: the distance to the rear axle is unknown")
    driven_m = sum(hypot(each.forward_m, each.left_m) for each in record.pieces)
    return MountFit(values, sigmas, len(record.roads), round(driven_m, 1), scale, tuple(warnings))


def mount_sentence(fit: MountFit) -> str:
    """Summary of the input data, as a sentence."""
    return f"Judging by the road in {fit.frames} frames and {fit.driven_m:.0f} m of LiDAR odometry"


def turned(fit: MountFit, T_ego_lidar: F64, camera: CameraCalibration | None) -> tuple[CameraCalibration | None, F64]:
    """Camera and LiDAR (4, 4) in the ego frame corrected by the fit: level, x along the direction of travel. Values
    that the drive does not determine stay unchanged; the two sensors keep their relative pose."""
    turn = np.eye(4)
    turn[:3, :3] = turn_of(fit.values)
    moved = replace(camera, T_camera_ego=camera.T_camera_ego @ inverse(turn)) if camera is not None else None
    return moved, turn @ T_ego_lidar


def turn_of(values: Mapping[str, float]) -> F64:
    """(3, 3), takes points of the ego frame to a level frame with x along the direction of travel."""
    return rotation(*(float(np.radians(values.get(f"{name}_deg", 0.0))) for name in ("roll", "pitch", "yaw")))


Told = dict[str, tuple[float, float]]
"""Value and standard deviation by name."""


def _take(values: dict[str, float], sigmas: dict[str, float], told: Told) -> None:
    values |= {name: round(value, 4) for name, (value, _) in told.items()}
    sigmas |= {name: round(sigma, 5) for name, (_, sigma) in told.items()}


def _against_road(roads: Sequence[RoadPlane]) -> Told:
    rows = np.array([[each.ahead, each.left, each.height_m] for each in roads])

    def middle(rows: F64) -> F64:
        return np.median(rows, axis=0)

    found, spread = _with_spread(rows, [each.t_ns for each in roads], middle)
    pitch, roll = degrees(atan(found[0])), -degrees(atan(found[1]))
    return {
        "pitch_deg": (pitch, hypot(degrees(spread[0]), PITCH_ROAD_DEG)),
        "roll_deg": (roll, hypot(degrees(spread[1]), ROLL_ROAD_DEG)),
        "height_m": (float(found[2]), hypot(spread[2], HEIGHT_ROAD_M)),
    }


def _against_travel(pieces: Sequence[Piece]) -> Told:
    rows = np.array([[each.forward_m, each.turn_rad, each.left_m] for each in pieces])

    def solved(rows: F64) -> F64:
        forward, turn, left = rows.T
        return _robust(np.column_stack([-forward, turn]), left, np.array([np.inf, AXLE_SIGMA_M]), [0.0, AXLE_M])

    found, spread = _with_spread(rows, [each.t_ns for each in pieces], solved)
    # the prior is not a measurement: the standard deviation is that of the pieces alone
    turned = rows[:, 1] - rows[:, 0] * float(rows[:, 0] @ rows[:, 1]) / float(rows[:, 0] @ rows[:, 0])
    noise = mad_sigma(rows[:, 2] + found[0] * rows[:, 0] - found[1] * rows[:, 1])
    axle_sigma = hypot(spread[1], noise / max(float(np.linalg.norm(turned)), 1e-9))
    return {
        "yaw_deg": (degrees(found[0]), hypot(degrees(spread[0]), YAW_FLOOR_DEG)),
        "ahead_of_axle_m": (float(found[1]), axle_sigma),
    }


def _against_speed(pieces: Sequence[Piece]) -> Told:
    rows = np.array([[each.driven_m or 0.0, each.turn_rad, each.forward_m] for each in pieces])

    def solved(rows: F64) -> F64:
        driven, turn, forward = rows.T
        return _robust(np.column_stack([driven, -turn]), forward, np.array([np.inf, AXLE_SIGMA_M]), [1.0, 0.0])

    found, spread = _with_spread(rows, [each.t_ns for each in pieces], solved)
    turned = rows[:, 1] - rows[:, 0] * float(rows[:, 0] @ rows[:, 1]) / float(rows[:, 0] @ rows[:, 0])
    noise = mad_sigma(rows[:, 2] - found[0] * rows[:, 0] + found[1] * rows[:, 1])
    return {
        "speed_scale": (round(float(found[0]), 4), float(spread[0])),
        "left_of_axle_m": (float(found[1]), hypot(spread[1], noise / max(float(np.linalg.norm(turned)), 1e-9))),
    }


def _robust(design: F64, seen: F64, prior_sigma: F64, prior: Sequence[float]) -> F64:
    """(2,) least squares with a prior, in which outliers get less weight (Huber)."""
    held = np.diag((ROBUST_M / prior_sigma) ** 2)
    weight = np.ones(len(seen))
    solved = np.zeros(2)
    for _ in range(12):
        weighed = design * weight[:, None]
        solved = np.linalg.solve(weighed.T @ design + held, weighed.T @ seen + held @ np.asarray(prior))
        weight = ROBUST_M / np.maximum(np.abs(design @ solved - seen), ROBUST_M)
    return solved


def _with_spread(rows: F64, t_ns: Sequence[int], solve: Callable[[F64], F64]) -> tuple[F64, F64]:
    """The solution, and its standard deviation over resampled blocks of the drive (bootstrap)."""
    number = np.asarray(t_ns) // BLOCK_NS
    blocks = [np.flatnonzero(number == block) for block in np.unique(number)]
    if len(blocks) < 4:  # in a short drive, resample single rows
        blocks = [np.array([row]) for row in range(len(rows))]
    rng = np.random.default_rng(0)
    drawn = [rng.integers(0, len(blocks), len(blocks)) for _ in range(BOOTSTRAPS)]
    found = [solve(rows[np.concatenate([blocks[k] for k in each])]) for each in drawn]
    return solve(rows), np.std(found, axis=0, ddof=1)
