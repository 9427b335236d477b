"""Determines the LiDAR's mount from a drive. A drive with a turned mount is processed twice: odometry starts every
sweep with straight motion along x, which biases the direction of travel by up to a fifth. The second pass starts from
the result of the first, which removes this bias."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pipeline.calibration.mount.fit import MountFit, fit_mount, turn_of
from pipeline.calibration.mount.observe import looked_at, observe
from pipeline.common.progress import Progress, silent
from pipeline.params import Params
from pipeline.types import F64, Frame

STRAIGHT_DEG = 0.3
"""Below this yaw, the bias is smaller than the standard deviation."""


def fit_mount_drive(
    frame_of: Callable[[int], Frame], count: int, params: Params, progress: Progress = silent
) -> MountFit:
    """The mount, from a drive of ``count`` frames. Raises NoMount if the drive does not determine it. An exception of
    ``progress`` ends it."""
    total = 2 * len(looked_at(count))
    fit = fit_mount(observe(frame_of, count, params, lambda done, _: progress(done, total)))
    if abs(fit.values.get("yaw_deg", 0.0)) > STRAIGHT_DEG:
        first = turn_of(fit.values)
        again = fit_mount(
            observe(
                lambda index: _turned(frame_of(index), first),
                count,
                params,
                lambda done, _: progress(total // 2 + done, total),
            )
        )
        fit = replace(again, values={**again.values, **_angles(turn_of(again.values) @ first)})
    progress(total, total)
    return fit


def _turned(frame: Frame, turn: F64) -> Frame:
    """The frame with its sweep rotated in the ego frame."""
    if frame.sweep is None:
        return frame
    points = frame.sweep.points.copy()
    points[:, :3] = points[:, :3] @ turn.T.astype(np.float32)
    x, y, z = (turn @ np.asarray(frame.sweep.origin)).tolist()
    return replace(frame, sweep=replace(frame.sweep, points=points, origin=(x, y, z)))


def _angles(turn: F64) -> dict[str, float]:
    """Yaw, pitch and roll of a rotation, applied in this order."""
    roll, pitch, yaw = (
        np.arctan2(turn[2, 1], turn[2, 2]),
        np.arcsin(-turn[2, 0]),
        np.arctan2(turn[1, 0], turn[0, 0]),
    )
    return {
        "pitch_deg": round(float(np.degrees(pitch)), 4),
        "roll_deg": round(float(np.degrees(roll)), 4),
        "yaw_deg": round(float(np.degrees(yaw)), 4),
    }
