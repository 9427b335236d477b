"""A wrong extrinsic is noticed and its mistake named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.common.geometry import T_OPTICAL_BODY, inverse, rotation
from pipeline.formats.extrinsic_mistakes import is_upright, looks_ahead
from pipeline.formats.file_reading import check_looks_ahead
from pipeline.types import F64
from pipeline.types.source import SourceError
from tests.pipeline.calibration.alignment.made_drive import CAMERA

RIGHT = CAMERA.T_camera_ego


def turned(yaw_deg: float) -> F64:
    T = np.eye(4)
    T[:3, :3] = rotation(0.0, 0.0, np.radians(yaw_deg))
    return T


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        (inverse(RIGHT), "is its extrinsic inverted"),
        (inverse(T_OPTICAL_BODY) @ RIGHT, "body axes"),
        (inverse(inverse(T_OPTICAL_BODY) @ RIGHT) @ turned(20.0) @ turned(120.0), ""),
        (RIGHT @ turned(90.0), "axes are swapped"),
        (RIGHT @ turned(-90.0), "axes are swapped"),
        (RIGHT @ turned(180.0), "points backwards"),
    ],
    ids=["inverted", "body", "beyond naming", "x right", "x left", "x back"],
)
def test_the_mistake_is_named(wrong: F64, named: str):
    with pytest.raises(SourceError, match=f"does not look ahead; .*{named}"):
        check_looks_ahead(replace(CAMERA, T_camera_ego=wrong), "calib.txt")


def test_a_camera_ahead_is_none():
    check_looks_ahead(CAMERA, "calib.txt")
    assert looks_ahead(CAMERA.K, RIGHT, (CAMERA.width, CAMERA.height))
    assert is_upright(RIGHT)
    assert not is_upright(RIGHT @ np.diag([1.0, -1.0, -1.0, 1.0]))
