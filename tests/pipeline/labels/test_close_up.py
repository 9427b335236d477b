"""A label from close by, and how well it fits its points."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.alignment.projection import Pinhole
from pipeline.common.geometry import Cuboid
from pipeline.labels.close_up import HEIGHT_PX, WIDTH_PX, close_up, fit_of
from pipeline.labels.model import Sighting
from pipeline.types import CameraImage, Frame, Sweep
from tests.pipeline.labels.formats.sets import camera

CAR = Cuboid((20.0, 2.0, 0.5), (4.0, 1.8, 1.5), 0.3)


def cloud(*own: tuple[float, float, float]) -> np.ndarray:
    """Points given along the car's length, width and height from its centre."""
    c, s = math.cos(CAR.yaw_rad), math.sin(CAR.yaw_rad)
    x, y, z = CAR.center
    return np.array([(x + c * a - s * b, y + s * a + c * b, z + h, 9.0) for a, b, h in own], dtype=np.float32)


def test_points_beside_a_cuboid_are_a_misfit_and_those_of_the_road_are_not() -> None:
    points = cloud((-2.0, 0.0, 0.0), (-1.9, 0.8, 0.3), (-2.3, 0.0, 0.2), (0.0, 1.1, -0.72), (0.0, 5.0, 0.0))
    fit = fit_of(points, CAR)
    assert (fit.inside, fit.beside) == (2, 1)
    assert fit.share_beside == pytest.approx(1 / 3)
    assert fit_of(points[:0], CAR).share_beside is None


def test_four_views_show_image_and_points_on_their_side() -> None:
    """The rear is on the left in the views from above and from the side; the left side is, seen from behind."""
    eye = camera()
    image = CameraImage(0, np.full((eye.height, eye.width, 3), 77, dtype=np.uint8), b"")
    sweep = Sweep(0, cloud((-2.0, 0.8, 0.5)), np.zeros(1, np.uint8), 16)
    frame = Frame(0, "0", 0, sweep=sweep, image=image, camera=eye)
    drawn = close_up(frame, Sighting(0, CAR), Pinhole(eye.K, eye.distortion, eye.T_camera_ego))
    assert drawn.shape == (2 * HEIGHT_PX, 2 * WIDTH_PX, 3)
    seen, top = drawn[:HEIGHT_PX, :WIDTH_PX], drawn[:HEIGHT_PX, WIDTH_PX:]
    side, rear = drawn[HEIGHT_PX:, :WIDTH_PX], drawn[HEIGHT_PX:, WIDTH_PX:]
    assert (seen == 77).any()
    for view, is_left, is_high in ((top, True, True), (side, True, True), (rear, True, True)):
        v, u = np.argwhere((view == (235, 225, 215)).all(axis=2)).mean(axis=0)
        assert (u < WIDTH_PX / 2, v < HEIGHT_PX / 2) == (is_left, is_high)


def test_what_a_frame_lacks_stays_empty() -> None:
    assert close_up(Frame(0, "0", 0), Sighting(0, CAR), None).shape == (2 * HEIGHT_PX, 2 * WIDTH_PX, 3)
    box_alone = close_up(Frame(0, "0", 0), Sighting(0, None, (1.0, 2.0, 3.0, 4.0)), None)
    assert box_alone.shape == (HEIGHT_PX, WIDTH_PX, 3), "no views from other sides"
