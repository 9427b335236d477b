"""The compiled camera model gives what OpenCV gives, for every number of coefficients."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from pipeline.alignment.lens import through_lens

K = np.array([[700.0, 0.0, 640.0], [0.0, 710.0, 360.0], [0.0, 0.0, 1.0]])
T_CAMERA = np.array([[0.0, -1, 0, 0.1], [0, 0, -1, 0.4], [1, 0, 0, -0.3], [0, 0, 0, 1]])
COEFFICIENTS = [-0.3, 0.1, 0.002, -0.003, 0.02, 0.01, -0.02, 0.005, 0.001, -0.002, 0.003, 0.001, 0.01, -0.02]
"""Of every kind that OpenCV knows."""


@pytest.mark.parametrize("count", [0, 4, 5, 8, 12, 14])
def test_points_are_where_opencv_sees_them(count: int):
    ego = np.random.default_rng(0).normal(size=(200, 3)) * [3.0, 6.0, 1.0] + [20.0, 0.0, 0.0]
    distortion = np.array(COEFFICIENTS[:count])
    in_camera = ego @ T_CAMERA[:3, :3].T + T_CAMERA[:3, 3]
    expected = cv2.projectPoints(in_camera, np.zeros(3), np.zeros(3), K, distortion if count else None)[0]
    assert through_lens(ego, T_CAMERA, K, distortion, 0.3) == pytest.approx(expected.reshape(-1, 2), abs=1e-9)


@pytest.mark.parametrize("count", [0, 5, 14])
def test_what_is_not_ahead_of_the_camera_is_nowhere(count: int):
    distortion = np.array(COEFFICIENTS[:count])
    ego = np.array([[-5.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.5, 0.0, 0.0], [5.0, 0.0, 0.0]])
    seen = through_lens(ego, T_CAMERA, K, distortion, 0.3)
    assert np.isnan(seen).all(axis=1).tolist() == [True, True, True, False]
    assert through_lens(np.zeros((0, 3)), T_CAMERA, K, distortion, 0.3).shape == (0, 2)
