"""Describes in sentences what a drive cannot determine: too few cars, all of them in one place, uncertain values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.calibration.alignment.models import FitModel
from pipeline.calibration.alignment.pairs import PairTable
from pipeline.common.geometry import inverse
from pipeline.types import F64, I64, CameraCalibration

FEW_PAIRS = 40
SAME_RANGE = 1.5
"""If the ranges of the pairs (90th to 10th percentile) differ by a smaller factor, they count as one distance."""
SAME_BEARING_DEG = 4.0
"""If the bearings have a smaller standard deviation, they count as one direction."""
OTHER_LENS = 0.02
"""A fitted focal length that differs by more makes a warning."""
UNSURE = {"yaw_deg": 0.3, "pitch_deg": 0.3, "roll_deg": 1.0, "left_m": 0.1, "up_m": 0.1, "zoom": 0.03, "res": 0.03,
          "origin_deg": 0.3}  # fmt: skip
"""Standard deviations from which a warning says that the drive does not determine the parameter."""
AMBIGUOUS = 0.8
"""If another solution explains at least this share of what the best one explains, the fit is ambiguous."""


RADIANS_DEG, TURNED_DEG = 0.5, 2.0
"""A mount counts as given in radians if its angles, taken as radians, are this close to the fit, three standard
deviations of a fit's yaw and pitch; and if the fit turns it by so much that other reasons rarely lead there."""


@dataclass(frozen=True, eq=False)
class Found:
    """Result of one search for the alignment."""

    vector: F64
    """The model's unknowns at the result; see ``FitModel``."""
    rows: I64
    """Rows of the matched pairs."""
    explained: float
    """Number of boxes with a matching cluster, weighted by the quality of the match."""


def warnings_of(
    table: PairTable, model: FitModel, found: Sequence[Found], sigmas: Mapping[str, float]
) -> tuple[str, ...]:
    """What is missing in the drive."""
    best, warnings = found[0], []
    cluster = table.cluster[best.rows]
    near, far = np.quantile(table.range_m[cluster], [0.1, 0.9])
    bearing_deg = np.degrees(np.arctan2(table.foot[cluster, 1, 1], table.foot[cluster, 1, 0]))
    if len(best.rows) < FEW_PAIRS:
        warnings.append(f"both sensors see only {len(best.rows)} vehicles")
    if far < SAME_RANGE * near:
        warnings.append(f"all vehicles are {near:.0f}–{far:.0f} m away: angle and offset cannot be told apart")
    if bearing_deg.std() < SAME_BEARING_DEG:
        warnings.append("all vehicles are in one direction: roll and resolution need vehicles to the sides")
    if abs(zoom := model.values(best.vector).get("zoom", 1.0) - 1.0) > OTHER_LENS:
        warnings.append(f"the calibration's focal length is wrong: the drive asks for {1.0 + zoom:.3f} times as much")
    for name, sigma in sigmas.items():
        limit, unit = _limit(model, best.vector, name)
        if sigma > limit:
            warnings.append(f"{name.rpartition('_')[0] or name} is known only to ±{sigma:.2g}{unit}")
    others = [each for each in found[1:] if _apart(model, best.vector, each.vector)]
    if others and others[0].explained > AMBIGUOUS * best.explained:
        warnings.append("another alignment explains the drive nearly as well: choose a drive with more traffic")
    return tuple(warnings)


def looks_like_radians(camera: CameraCalibration, fitted: CameraCalibration) -> bool:
    """Whether the fit asks for the angles of the calibration's mount as if radians had been given for degrees."""
    given, found = (_yaw_pitch_deg(each) for each in (camera, fitted))
    is_turned = np.abs(found - given).max() > TURNED_DEG
    return bool(is_turned and np.abs(found - np.degrees(given)).max() < RADIANS_DEG)


def _yaw_pitch_deg(camera: CameraCalibration) -> F64:
    """(2,) of the optical axis in the ego frame; positive to the left, and down."""
    x, y, z = inverse(camera.T_camera_ego)[:3, 2]
    return np.degrees([np.arctan2(y, x), -np.arctan2(z, np.hypot(x, y))])


def _apart(model: FitModel, a: F64, b: F64) -> bool:
    """Whether two results differ significantly."""
    return bool(np.abs((a - b)[-2:] if model.name == "angular" else (a - b)[:2]).max() > 1.0)


def _limit(model: FitModel, vector: F64, name: str) -> tuple[float, str]:
    if name.endswith("_px"):
        return UNSURE["origin_deg"] / model.values(vector)["h_res_deg"], " px"
    if name.endswith("res_deg"):
        return UNSURE["res"] * model.values(vector)[name], "°/px"
    return UNSURE[name], " m" if name.endswith("_m") else "" if name == "zoom" else "°"
