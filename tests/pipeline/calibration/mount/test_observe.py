"""A simulated drive with a turned LiDAR: its mount is found from sweeps alone, and cannot be told while standing."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from pipeline.calibration.mount.drive import fit_mount_drive
from pipeline.calibration.mount.fit import NoMount, fit_mount
from pipeline.calibration.mount.observe import observe
from pipeline.common.geometry import rotation
from pipeline.params import Params
from pipeline.sources import open_source
from pipeline.types import F64, Frame
from pipeline.types.source import InParts

MOUNT_DEG = (1.0, 2.0, -2.0)
"""Roll, pitch, yaw."""
FRAMES = 70


@pytest.fixture(scope="module")
def drive() -> list[Frame]:
    source = open_source("sim:curve_125")
    assert isinstance(source, InParts)
    return [replace(frame, sweep=source.sweep(frame.index)) for frame in islice(source.outlines(), FRAMES)]


def seen(frame: Frame, turn: F64) -> Frame:
    """As seen by a LiDAR with this unknown rotation."""
    assert frame.sweep is not None
    points = frame.sweep.points.copy()
    points[:, :3] = points[:, :3] @ turn.astype(np.float32)
    return replace(frame, sweep=replace(frame.sweep, points=points))


def test_a_turned_lidar_is_found_from_driving(drive: list[Frame]):
    turn, told = rotation(*np.radians(MOUNT_DEG)), []
    fit = fit_mount_drive(lambda k: seen(drive[k], turn), len(drive), Params(), lambda *step: told.append(step))
    for name, true in zip(("roll_deg", "pitch_deg", "yaw_deg"), MOUNT_DEG, strict=True):
        assert abs(fit.values[name] - true) < 3.0 * fit.sigmas[name], name
        assert fit.values[name] == pytest.approx(true, abs=0.5 if name == "yaw_deg" else 0.1)
    assert fit.values["height_m"] == pytest.approx(0.5, abs=0.01)
    assert fit.driven_m > 60.0
    assert told[0] == (0, 2 * FRAMES)
    assert told[-1] == (2 * FRAMES, 2 * FRAMES)


def test_a_standing_car_and_a_drive_without_sweeps_tell_no_yaw(drive: list[Frame]):
    still = observe(lambda index: replace(drive[0], t_ns=drive[index].t_ns), 30, Params())
    assert still.pieces == ()
    assert "yaw_deg" not in fit_mount(still).values
    with pytest.raises(NoMount):
        fit_mount(observe(lambda index: replace(drive[index], sweep=None), 20, Params()))
