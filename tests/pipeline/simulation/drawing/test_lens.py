"""What the lens does to an image: geometry against OpenCV's own distortion, noise and exposure by the numbers."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from pydantic import ValidationError

from pipeline.common.geometry import inverse, transform
from pipeline.simulation.drawing.canvas import Canvas
from pipeline.simulation.drawing.lens import ORDINARY, CameraModel, ImageSensor, distorted, undistorted
from pipeline.simulation.sensors.camera import calibration

PERFECT: dict[str, Any] = {"k1": 0.0, "k2": 0.0, "blur_px": 0.0, "noise": 0.0, "exposure_stops": 0.0}


def lens(seed: int = 1, **changes: float) -> ImageSensor:
    model = CameraModel(**{**PERFECT, **changes})
    return ImageSensor(calibration(model), model, seed)


GREY = np.full((720, 1280, 3), 100, dtype=np.uint8)


def test_a_perfect_camera_changes_nothing() -> None:
    image = np.random.default_rng(1).integers(0, 256, (720, 1280, 3), dtype=np.uint8)
    np.testing.assert_array_equal(lens().expose(image, 3.0), image)


LENSES = [(-0.08, 0.012), (0.05, 0.0), (-0.2, 0.05), (0.0, 0.0)]


@pytest.mark.parametrize(("k1", "k2"), LENSES)
def test_distortion_is_opencvs_and_can_be_undone(k1: float, k2: float) -> None:
    model = calibration(CameraModel(**{**PERFECT, "k1": k1, "k2": k2}))
    flat = np.random.default_rng(1).uniform([-0.7, -0.4], [0.7, 0.4], (500, 2))
    rays = np.column_stack([flat, np.ones(len(flat))])
    expected = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), model.K, model.distortion)[0].reshape(-1, 2)
    bent = distorted(flat, model.distortion)
    np.testing.assert_allclose(bent * model.K[0, 0] + model.K[:2, 2], expected, atol=1e-6)
    np.testing.assert_allclose(undistorted(bent, model.distortion), flat, atol=1e-6)


def test_nothing_far_outside_folds_back_into_the_image() -> None:
    outward = np.column_stack([np.linspace(0.0, 50.0, 5000), np.zeros(5000)])
    assert np.all(np.diff(distorted(outward, calibration().distortion)[:, 0]) > 0.0)


@pytest.mark.parametrize(("k1", "k2"), LENSES)
def test_long_straight_edges_are_drawn_bent(k1: float, k2: float) -> None:
    """A bar across the upper part of the image, drawn as one polygon with four corners: its centre line, compared with
    OpenCV."""
    model = calibration(CameraModel(**{**PERFECT, "k1": k1, "k2": k2}))
    image = np.zeros((720, 1280, 3), dtype=np.uint8)
    canvas = Canvas(image, model)
    T_ego_camera = inverse(model.T_camera_ego)
    corners = np.array([[-7.0, -3.1, 10.0], [7.0, -3.1, 10.0], [7.0, -2.9, 10.0], [-7.0, -2.9, 10.0]])
    canvas.add(transform(T_ego_camera, corners), np.array([4]), np.array([[255.0, 255.0, 255.0]]))
    canvas.paint(haze=False)
    along = np.array([[x, -3.0, 10.0] for x in np.linspace(-6.0, 6.0, 25)])
    uv = cv2.projectPoints(along, np.zeros(3), np.zeros(3), model.K, model.distortion)[0].reshape(-1, 2)
    for u, v in uv[(uv[:, 0] > 5) & (uv[:, 0] < 1275)]:
        rows = np.flatnonzero(image[:, round(float(u)), 0] > 127)
        assert rows.mean() == pytest.approx(v, abs=0.8)


def test_noise_is_as_strong_as_said_differs_by_time_and_repeats_by_seed() -> None:
    noisy = lens(noise=4.0)
    first = noisy.expose(GREY, 0.0)
    assert first.std() == pytest.approx(4.0, abs=0.1)
    assert first.mean() == pytest.approx(100.0, abs=0.1)
    assert noisy.expose(GREY, 0.1).tobytes() != first.tobytes()
    assert lens(noise=4.0).expose(GREY, 0.0).tobytes() == first.tobytes()
    assert lens(2, noise=4.0).expose(GREY, 0.0).tobytes() != first.tobytes()


def test_exposure_wanders_within_its_stops() -> None:
    wandering = lens(exposure_stops=0.5)
    means = [wandering.expose(GREY, t).mean() for t in np.arange(0.0, 8.0, 0.2)]
    assert min(means) == pytest.approx(100 * 2**-0.5, abs=2.0)
    assert max(means) == pytest.approx(100 * 2**0.5, abs=2.0)


def test_blur_softens_an_edge() -> None:
    def width(sigma: float) -> int:
        image = np.zeros((720, 1280, 3), dtype=np.uint8)
        image[:, 640:] = 200
        row = lens(blur_px=sigma).expose(image, 0.0)[300, :, 0]
        return int(np.count_nonzero((row > 10) & (row < 190)))

    assert width(0.0) == 0
    assert width(0.4) < width(3.0)
    assert width(3.0) >= 6


def test_a_lens_that_folds_its_corners_is_refused() -> None:
    with pytest.raises(ValidationError, match="folds"):
        CameraModel(k1=-0.3, k2=0.0)
    assert ORDINARY.k1 != 0.0
