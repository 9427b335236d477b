"""The part of a wide camera's image in which a lane network sees the road far ahead.

A lane network receives an image of 80° scaled down to its 640 columns: beyond 25 m, a kerb is narrower than a pixel
there, so its line ends, and the path beyond is extrapolated. In the middle of the image at twice the scale, the same
network follows kerbs and the edge of the road to 50 m, at the same cost, but it does not see the lines beside the car.
So the two views take turns.

On KITTI 0009, a street without lane lines, the mean error of the path against the way then driven falls from 0.47 to
0.24 m at 30 m and from 0.67 to 0.37 m at 40 m.
"""

from __future__ import annotations

import numpy as np

from pipeline.common.geometry import F64
from pipeline.lanes.horizon import ImageOutline, horizon_row
from pipeline.types import CameraCalibration, PixelWindow

_COLUMNS, _ROWS = 640, 128
"""The window, in pixels of a camera with ``_PX_PER_RAD``: as many as the network has columns, and as many rows as it
has for the whole image of KITTI, so that both views cost the same. It shows the road from 12 m on."""
_PX_PER_RAD = 720.0
"""Focal length at which the window has native resolution; it is scaled down for a longer one. The window is 48° wide
for every camera."""
_HORIZON = 0.22
"""Share of the window above the horizon: what the network needs (``pipeline.lanes.heads.two_masks``)."""
_WORTH_IT = 0.75
"""If the window is wider than this share of the image, it shows little that the whole image does not. For a camera of
59° (Astyx, 0.79), both lines of the lane were found in 34 of 39 frames with it and in 35 without."""


def far_window(camera: CameraCalibration) -> PixelWindow | None:
    """Where the road ahead vanishes, in pixels; None if the whole image already shows it at about that scale."""
    scale = max(1.0, float(camera.K[0, 0]) / _PX_PER_RAD)
    width, height = round(_COLUMNS * scale), min(round(_ROWS * scale), camera.height)
    if width > _WORTH_IT * camera.width:
        return None
    forward: F64 = camera.K @ camera.T_camera_ego[:3, :3] @ np.array([1.0, 0.0, 0.0])
    if forward[2] <= 0.0:  # the camera does not look ahead
        return None
    x1 = int(np.clip(round(forward[0] / forward[2] - width / 2), 0, camera.width - width))
    y1 = int(np.clip(round(horizon_row(camera) - _HORIZON * height), 0, camera.height - height))
    return x1, y1, x1 + width, y1 + height


def window_outline(camera: CameraCalibration, window: PixelWindow) -> ImageOutline:
    """The outline of the part of a camera's images in a window."""
    x1, y1, x2, y2 = window
    return ImageOutline((horizon_row(camera) - y1) / (y2 - y1), (y2 - y1) / (x2 - x1))
