"""A calibration of another tool becomes a correction of the recording's, and says what it cannot carry over."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from pipeline.alignment.projection import corrected, resolve
from pipeline.calibration.imported import ImportRefused, imported
from pipeline.common.geometry import inverse, rotation
from pipeline.params import AlignmentParams
from tests.pipeline.calibration.alignment.made_drive import CAMERA, SIZE

POINTS = np.array([[8.0, 2.0, 0.5], [30.0, -6.0, 1.0], [60.0, 0.0, -1.0]])
MOVED = {"yaw_deg": 1.7, "pitch_deg": -2.1, "roll_deg": 0.8, "forward_m": 0.12, "left_m": -0.2, "up_m": 0.05}
GIVEN = corrected(AlignmentParams(**MOVED), CAMERA)


def test_the_correction_gives_the_mount_of_the_file():
    found = imported(GIVEN, AlignmentParams(yaw_deg=-4.0), CAMERA, SIZE)
    assert found.warnings == ()
    assert {name: found.values[name] for name in MOVED} == pytest.approx(MOVED, abs=1e-4)
    back = corrected(AlignmentParams(**found.values), CAMERA)
    np.testing.assert_allclose(back.T_camera_ego, GIVEN.T_camera_ego, atol=1e-4)


def test_a_lidar_with_a_mount_of_its_own_is_taken_into_account():
    T_ego_lidar = np.eye(4)
    T_ego_lidar[:3, :3], T_ego_lidar[:3, 3] = rotation(0.0, 0.02, 0.03), [1.0, 0.2, 0.5]
    from_lidar = replace(GIVEN, T_camera_ego=GIVEN.T_camera_ego @ T_ego_lidar)
    found = imported(from_lidar, AlignmentParams(), CAMERA, SIZE, T_ego_lidar)
    assert {name: found.values[name] for name in MOVED} == pytest.approx(MOVED, abs=1e-4)


@pytest.mark.parametrize("present", [AlignmentParams(model="angular"), AlignmentParams()], ids=["chosen", "no camera"])
def test_the_angular_model_gets_its_best_fit(present: AlignmentParams):
    camera = CAMERA if present.model == "angular" else None
    found = imported(GIVEN, present, camera, SIZE)
    assert "px at 0–5°" in found.text
    aligned, exact = resolve(AlignmentParams(**found.values), None), resolve(AlignmentParams(), GIVEN)
    assert aligned is not None
    assert exact is not None
    np.testing.assert_allclose(aligned.project(POINTS[1:]), exact.project(POINTS[1:]), atol=25.0)


def turned(yaw_deg: float):
    T = np.eye(4)
    T[:3, :3] = rotation(0.0, 0.0, np.radians(yaw_deg))
    return replace(CAMERA, T_camera_ego=CAMERA.T_camera_ego @ inverse(T))


@pytest.mark.parametrize(
    ("given", "named"),
    [
        (replace(GIVEN, width=640), "images of 640×"),
        (turned(14.0), r"\+14\.0° in yaw, more than 10°: is it the calibration of this camera"),
        (corrected(AlignmentParams(up_m=1.0), corrected(AlignmentParams(up_m=0.7), CAMERA)), r"\+1\.7 m in up"),
    ],
    ids=["another size", "turned far", "far away"],
)
def test_a_calibration_of_something_else_is_refused(given, named: str):
    with pytest.raises(ImportRefused, match=named):
        imported(given, AlignmentParams(), CAMERA, SIZE)


def test_a_file_with_another_focal_length_gives_a_zoom():
    given = corrected(AlignmentParams(zoom=1.05), GIVEN)
    found = imported(given, AlignmentParams(), CAMERA, SIZE)
    assert found.values["zoom"] == 1.05
    assert found.warnings == ()
    assert imported(GIVEN, AlignmentParams(zoom=1.05), CAMERA, SIZE).values["zoom"] == 1.0


@pytest.mark.parametrize(
    ("given", "named"),
    [
        (turned(4.0), "differs from the recording's by 4.0° and"),
        (replace(GIVEN, K=GIVEN.K * [[1.02], [1.02], [1.0]]), r"lens in the file differs.* by up to \d+ px; only"),
        (replace(GIVEN, distortion=np.array([-0.3, 0.1, 0.0, 0.0])), "file is for raw images, with distortion, the"),
    ],
    ids=["turned", "another focal length", "raw for undistorted"],
)
def test_what_the_import_leaves_out_or_doubts_is_said(given, named: str):
    (warning,) = imported(given, AlignmentParams(), CAMERA, SIZE).warnings
    assert re.search(named, warning)
