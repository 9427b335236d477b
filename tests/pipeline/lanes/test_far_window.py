"""Which part of a camera's image the far view of a lane network shows."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.lanes.far_window import far_window, window_outline
from pipeline.types import CameraCalibration, PixelWindow
from tests.pipeline.lanes.lane_cameras import camera_of

WINDOWS: dict[str, tuple[CameraCalibration, PixelWindow | None]] = {
    "KITTI, 81°: native pixels around the vanishing point": (
        camera_of(721.5, 1242, 375, (610, 173)),
        (290, 145, 931, 273),
    ),
    "a webcam of 78° with more pixels: as many degrees": (
        camera_of(1185, 1920, 1080, (960, 600)),
        (434, 554, 1487, 765),
    ),
    "of few pixels: the whole image is no coarser": (camera_of(395, 640, 480, (320, 240)), None),
    "Astyx, 59°: hardly narrower than the image": (camera_of(1818, 2048, 618, (1040, 320)), None),
    "it looks to the side: up to the image's edge": (camera_of(721.5, 1242, 375, (100, 173)), (0, 145, 641, 273)),
    "it looks down: from the image's first row on": (camera_of(721.5, 1242, 375, (610, 5)), (290, 0, 931, 128)),
    "it looks up: down to the last row": (camera_of(721.5, 1242, 375, (610, 370)), (290, 247, 931, 375)),
    "a strip lower than the window": (camera_of(721.5, 1242, 100, (610, 40)), (290, 0, 931, 100)),
}


@pytest.mark.parametrize("case", WINDOWS)
def test_the_window_is_around_the_vanishing_point_of_a_wide_cameras_image(case: str) -> None:
    camera, window = WINDOWS[case]
    assert far_window(camera) == window


def test_a_camera_that_looks_back_has_none() -> None:
    back = camera_of(721.5, 1242, 375, (610, 173))
    turned = back.T_camera_ego @ np.diag([-1.0, -1.0, 1.0, 1.0])
    assert far_window(CameraCalibration(back.K, back.distortion, turned, back.width, back.height)) is None


def test_the_outline_tells_where_the_horizon_is_in_the_window() -> None:
    outline = window_outline(camera_of(721.5, 1242, 375, (610, 173)), (290, 145, 931, 273))
    assert outline.horizon == pytest.approx((173 - 145) / 128)
    assert outline.aspect == pytest.approx(128 / 641)
