"""A second detector pass for distant vehicles: the part of the image around the road's vanishing point, at native
resolution.

A detector receives a wide image scaled down: a car at 80 m, 40 px wide in an image of 2048 px, is 16 px wide in its
input. In a window of native pixels, the same network detects it. The window is the smallest that contains the road
ahead: a square around the car's heading, shifted sideways with the curve that ego motion implies. It depends on the
frame alone, never on tracks, so boxes can be cached and computed ahead, and a wrong track cannot move the window away.
It still contains the lead: see docs/reference/accuracy-distances.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from pipeline.common.geometry import iou_matrix
from pipeline.inference.graph import MULTIPLE
from pipeline.inference.runtime import DetectorError
from pipeline.types import F32, U8, Frame, Mask, PixelWindow, RawBoxes
from pipeline.vision.detector import Detector, open_detector

WINDOW_PX = 416
"""Side of the window: YOLOX-nano's own input. At 1800 px of focal length ±6.6°, at 720 px ±16°."""
LOOK_AHEAD_M = 60.0
"""Distance along the curve at which the window is centred: about where vehicles become too small in the whole image."""
_GRID_PX = 16
"""The window moves in steps of this size, so that yaw rate noise does not move it."""
_SLOWEST_MPS = 3.0
"""Below this speed, yaw rate over speed says nothing about the road."""
_WORTH_IT = 0.8
"""If the whole image is already processed at this share of the native resolution, a second pass adds nothing."""
_CUT_PX = 3.0
"""A box this close to an inner edge of the window is considered cut."""
_SURE_PX = 50.0
"""Width of a box in the network's input from which the pass over the whole image finds every vehicle. Of 926 candidates
this wide in the windows of Astyx, KITTI 0052 and 0009 and a video, 19 had no counterpart in the whole image, and none
of these was a vehicle: they were the road ahead, taken for a car as wide as the window, the gap between vehicles, and
parts of them. Of those 12 to 16 px wide, 3 % had none, of smaller ones 20 % and more."""
_COUNTERPART_IOU = 0.4
"""Overlap above which a box of the whole image is the same vehicle."""


class WindowDetector(Protocol):
    """A detector that runs on the window."""

    @property
    def name(self) -> str:
        """Equal names give equal boxes."""
        ...

    def detect(self, bgr: U8) -> RawBoxes:
        """Candidates in an image (H, W, 3) uint8."""
        ...


@dataclass(frozen=True)
class FarView:
    """A detector and the size of its window."""

    detector: WindowDetector
    """At the window's input size."""
    size_px: int = WINDOW_PX
    """Side of the window, in pixels of the image."""
    sure_px: float = math.inf
    """Boxes at least this wide, in pixels of the image, are also found in the whole image if they are vehicles."""

    @property
    def name(self) -> str:
        """Equal names give equal boxes for equal frames."""
        return f"{self.detector.name}-far{self.size_px}"

    def of(self, frame: Frame | None) -> FarLook:
        """The far view of one frame's image; None uses the middle of an image of which nothing else is known."""
        return FarLook(self, frame)

    def added_to(self, whole: RawBoxes, far: RawBoxes) -> RawBoxes:
        """The candidates of both passes, except those of the window that the whole image would have to contain too."""
        wide = far.boxes[:, 2] - far.boxes[:, 0] >= self.sure_px
        kept = ~wide
        if wide.any():
            kept[wide] = (iou_matrix(far.boxes[wide], whole.boxes) > _COUNTERPART_IOU).any(axis=1)
        return whole.with_far(far, kept)


@dataclass(frozen=True)
class FarLook:
    """The far view bound to one frame. Its name is the far view's, since the window follows from the frame."""

    view: FarView
    """The detector and the size of the window."""
    frame: Frame | None
    """Its lanes and calibration define the window's position; None uses the middle of the image."""

    @property
    def name(self) -> str:
        """Name of the far view."""
        return self.view.name

    @property
    def notes(self) -> tuple[str, ...]:
        """Empty: the detector already reports its notes for the whole image."""
        return ()

    def detect(self, bgr: U8) -> RawBoxes:
        """Candidates in the window of an image (H, W, 3) uint8, in the image's pixels. Boxes cut by the window are left
        out: they are complete in the whole image."""
        window = window_of(self.frame, (bgr.shape[1], bgr.shape[0]), self.view.size_px)
        x1, y1, x2, y2 = window
        seen = self.view.detector.detect(np.ascontiguousarray(bgr[y1:y2, x1:x2]))
        boxes = seen.boxes + np.array([x1, y1, x1, y1], np.float32)
        whole = is_whole(boxes, window, (bgr.shape[1], bgr.shape[0]))
        labels = tuple(label for label, kept in zip(seen.labels, whole, strict=True) if kept)
        return replace(
            seen,
            model=self.name,
            boxes=boxes[whole],
            scores=seen.scores[whole],
            labels=labels,
            far=window,
            far_count=len(labels),
        )


def open_far_view(detector: Detector, image_size: tuple[int, int], size_px: int = WINDOW_PX) -> FarView | None:
    """The far view with the same network as ``detector`` for images of (width, height). None if the whole image is
    already processed at nearly native resolution."""
    width, height = image_size
    scale = min(detector.input_size[0] / height, detector.input_size[1] / width)
    if scale >= _WORTH_IT:
        return None
    sides = tuple(-(-min(size_px, side) // MULTIPLE) * MULTIPLE for side in (height, width))
    try:
        native = open_detector(str(detector.path), None, detector.threads, (sides[0], sides[1]))
    except DetectorError:  # the graph has a fixed size; the window is scaled to it
        native = open_detector(str(detector.path), None, detector.threads)
    return FarView(native, size_px, _SURE_PX / scale)


def window_of(frame: Frame | None, image_size: tuple[int, int], size_px: int = WINDOW_PX) -> PixelWindow:
    """The window in an image of (width, height): around the vanishing point of the road ahead, clipped to the image.
    The middle of the image if the camera is not known."""
    width, height = image_size
    u, v = width / 2, height / 2
    camera = frame.camera if frame is not None else None
    if camera is not None:
        bearing = _bend_bearing(frame)
        ray = camera.K @ camera.T_camera_ego[:3, :3] @ np.array([np.cos(bearing), np.sin(bearing), 0.0])
        if ray[2] > 0.0:
            u, v = float(ray[0] / ray[2]), float(ray[1] / ray[2])
    across, down = min(size_px, width), min(size_px, height)
    x1 = int(np.clip(round((u - across / 2) / _GRID_PX) * _GRID_PX, 0, width - across))
    y1 = int(np.clip(round((v - down / 2) / _GRID_PX) * _GRID_PX, 0, height - down))
    return x1, y1, x1 + across, y1 + down


def _bend_bearing(frame: Frame | None) -> float:
    """Bearing of the point ``LOOK_AHEAD_M`` ahead on a constant turn, radians to the left."""
    ego = frame.ego if frame is not None else None
    if ego is None or ego.speed_mps is None or ego.yaw_rate_radps is None or ego.speed_mps < _SLOWEST_MPS:
        return 0.0
    return float(np.clip(ego.yaw_rate_radps / ego.speed_mps * LOOK_AHEAD_M / 2, -0.5, 0.5))


def is_whole(boxes: F32, window: PixelWindow, image_size: tuple[int, int]) -> Mask:
    """(M,) whether each box lies completely in the window, apart from cuts by the image's own edges."""
    x1, y1, x2, y2 = window
    width, height = image_size
    low = (np.array([x1, y1]) > 0) & (boxes[:, :2] < np.array([x1, y1]) + _CUT_PX)
    high = (np.array([x2, y2]) < np.array([width, height])) & (boxes[:, 2:] > np.array([x2, y2]) - _CUT_PX)
    return np.logical_not((low | high).any(axis=1))
