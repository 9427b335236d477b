"""The camera of a bag: what a CameraInfo may say of its lens."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.common.geometry import T_OPTICAL_BODY
from pipeline.sources.rosbag.rig import TransformTree, calibration

OPTICAL = SimpleNamespace(x=-0.5, y=0.5, z=-0.5, w=0.5)
"""Of the optical frame in the body's (REP 103)."""
K = [700.0, 0.0, 640.0, 0.0, 700.0, 360.0, 0.0, 0.0, 1.0]


def tree() -> TransformTree:
    """A camera 0.3 m above the LiDAR."""
    found, up = TransformTree(), SimpleNamespace(x=0.0, y=0.0, z=0.3)
    place = SimpleNamespace(rotation=OPTICAL, translation=up)
    header = SimpleNamespace(frame_id="lidar")
    found.add(SimpleNamespace(transforms=[SimpleNamespace(header=header, child_frame_id="camera", transform=place)]))
    return found


def info(model: str, values: list[float], names: str) -> SimpleNamespace:
    """A message of ROS 2, or with capital names of ROS 1."""
    k, d = names
    header = SimpleNamespace(frame_id="camera")
    return SimpleNamespace(header=header, distortion_model=model, width=1280, height=720, **{k: K, d: values})


@pytest.mark.parametrize("names", ["kd", "KD"])
@pytest.mark.parametrize(
    ("model", "values", "expected"),
    [
        ("plumb_bob", [-0.3, 0.1, 0.001, 0.002, 0.01], [-0.3, 0.1, 0.001, 0.002, 0.01]),
        ("plumb_bob", [-0.3, 0.1, 0.001, 0.002] + [0.0] * 4, [-0.3, 0.1, 0.001, 0.002] + [0.0] * 4),
        ("rational_polynomial", [0.1] * 8 + [0.0] * 6, [0.1] * 8),
        ("Radtan", [-0.3, 0.1, 0.001, 0.002], [-0.3, 0.1, 0.001, 0.002]),
        ("none", [], []),
        ("", [0.0] * 5, []),
    ],
)
def test_lenses_that_calibration_files_may_have_are_read(
    names: str, model: str, values: list[float], expected: list[float]
):
    notes: list[str] = []
    camera = calibration(info(model, values, names), tree(), "lidar", np.eye(4), notes)
    assert camera is not None, notes
    assert camera.distortion.tolist() == expected
    np.testing.assert_allclose(camera.T_camera_ego[:3, :3], T_OPTICAL_BODY[:3, :3], atol=1e-12)


@pytest.mark.parametrize(
    ("model", "values", "said"),
    [
        ("equidistant", [0.0] * 4, "distortion: equidistant is not supported; calibrate as plumb_bob"),
        ("plumb_bob", [0.1] * 3, "distortion: 3 distortion coefficients; 4, 5 or 8 are supported"),
        ("plumb_bob", [float("nan")] * 5, "distortion: not a list of finite numbers"),
    ],
)
def test_other_lenses_are_refused_as_those_of_files_are(model: str, values: list[float], said: str):
    notes: list[str] = []
    assert calibration(info(model, values, "kd"), tree(), "lidar", np.eye(4), notes) is None
    assert notes[0].startswith(f"CameraInfo is not used: {said}")
