"""What the lens does to a picture: geometry against OpenCV's own distortion, noise and exposure by the numbers."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from pydantic import ValidationError

from pipeline.simulation.camera import calibration
from pipeline.simulation.lens import ORDINARY, CameraModel, Lens
from pipeline.types import U8

PERFECT: dict[str, Any] = {"k1": 0.0, "k2": 0.0, "blur_px": 0.0, "noise": 0.0, "exposure_stops": 0.0}


def lens(seed: int = 1, **changes: float) -> Lens:
    model = CameraModel(**{**PERFECT, **changes})
    return Lens(calibration(model), model, seed)


def grey(of: Lens, value: int = 100) -> U8:
    return np.full((of.drawn.height, of.drawn.width, 3), value, dtype=np.uint8)


def test_a_perfect_lens_changes_nothing() -> None:
    perfect = lens()
    picture = np.random.default_rng(1).integers(0, 256, (720, 1280, 3), dtype=np.uint8)
    np.testing.assert_array_equal(perfect.picture(picture, 3.0), picture)


@pytest.mark.parametrize(("k1", "k2"), [(-0.08, 0.012), (0.05, 0.0), (-0.2, 0.05)])
def test_a_dot_moves_to_where_opencv_projects_it(k1: float, k2: float) -> None:
    bent = lens(k1=k1, k2=k2)
    model = calibration(CameraModel(**{**PERFECT, "k1": k1, "k2": k2}))
    for ray in ((0.0, 0.0, 1.0), (0.5, 0.3, 1.0), (-0.6, 0.25, 1.0), (0.66, -0.37, 1.0)):
        ideal = (bent.drawn.K @ ray)[:2]
        picture = grey(bent, 0)
        cv2.circle(picture, tuple(int(value) for value in np.round(ideal * 16)), 6 * 16, (255, 255, 255), -1, 16, 4)
        rows, columns = np.nonzero(bent.picture(picture, 0.0)[..., 0] > 127)
        expected = cv2.projectPoints(np.array([ray]), np.zeros(3), np.zeros(3), model.K, model.distortion)[0].ravel()
        assert (columns.mean(), rows.mean()) == (
            pytest.approx(expected[0], abs=0.6),
            pytest.approx(expected[1], abs=0.6),
        )


def test_a_barrel_shows_more_than_was_in_the_ideal_frame_and_leaves_no_black_rim() -> None:
    barrel = lens(k1=-0.08, k2=0.012)
    assert barrel.drawn.width > 1280
    assert barrel.picture(grey(barrel), 0.0).min() == 100


def test_noise_is_as_strong_as_said_differs_by_time_and_repeats_by_seed() -> None:
    noisy = lens(noise=4.0)
    first = noisy.picture(grey(noisy), 0.0)
    assert first.std() == pytest.approx(4.0, abs=0.1)
    assert first.mean() == pytest.approx(100.0, abs=0.1)
    assert noisy.picture(grey(noisy), 0.1).tobytes() != first.tobytes()
    assert lens(noise=4.0).picture(grey(noisy), 0.0).tobytes() == first.tobytes()
    assert lens(2, noise=4.0).picture(grey(noisy), 0.0).tobytes() != first.tobytes()


def test_exposure_wanders_within_its_stops() -> None:
    wandering = lens(exposure_stops=0.5)
    means = [wandering.picture(grey(wandering), t).mean() for t in np.arange(0.0, 8.0, 0.2)]
    assert min(means) == pytest.approx(100 * 2**-0.5, abs=2.0)
    assert max(means) == pytest.approx(100 * 2**0.5, abs=2.0)


def test_blur_softens_an_edge() -> None:
    def width(sigma: float) -> int:
        soft = lens(blur_px=sigma)
        picture = grey(soft, 0)
        picture[:, 640:] = 200
        row = soft.picture(picture, 0.0)[300, :, 0]
        return int(np.count_nonzero((row > 10) & (row < 190)))

    assert width(0.0) == 0
    assert width(0.4) < width(3.0)
    assert width(3.0) >= 6


def test_a_lens_that_folds_its_corners_is_refused() -> None:
    with pytest.raises(ValidationError, match="folds"):
        CameraModel(k1=-0.3, k2=0.0)
    assert ORDINARY.k1 != 0.0
