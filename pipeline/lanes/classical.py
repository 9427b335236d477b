"""Lane lines without a network: paint is brighter or yellower than the road on both sides of it.

Bertozzi and Broggi, "GOLD" (IEEE Trans. Image Processing 7(1), 1998): in an image row, a marking is a bright band of
the width that perspective gives it there, darker to the left and to the right. False candidates (a car's edge, a kerb)
are left to the robust fit in ground coordinates (``pipeline.lanes.line_fit``).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numba
import numpy as np

from pipeline.lanes.horizon import horizon_share
from pipeline.types import U8, CameraCalibration, RawLanes

NAME = "classical"
_NOTE = "Lane lines by colour and gradient (classical), without a network"
_CAMERA_HEIGHT_M = 1.4
"""Height of a camera behind a windshield; a deviation of 10 % changes the expected width of paint by the same
amount."""
_PAINT_WIDTH_M = 0.15
_ROWS = 90
_BELOW_HORIZON, _ABOVE_EDGE = 0.03, 0.02
"""Shares of the image's height that are ignored below the horizon and above the lower edge."""
_MIN_CONTRAST, _FULL_CONTRAST = 9.0, 60.0
"""Minimum brightness difference between paint and both sides in grey levels, and the difference from which it is
certainly paint."""
_PER_ROW = 12
"""Marking candidates kept of one image row; bounds the arrays."""


@dataclass(frozen=True)
class ClassicalLanes:
    """The detector for images of one camera."""

    name: str
    """Cache key; equal names give equal points."""
    horizon: float
    """Row of the horizon as a share of the image's height; only rows below it are searched."""
    notes: tuple[str, ...] = (_NOTE,)
    """Shown with every result."""

    def detect(self, bgr: U8) -> RawLanes:
        """Centres of possible paint in some ninety rows of an image (H, W, 3) uint8; not grouped into lines."""
        height, width = bgr.shape[:2]
        horizon_px = self.horizon * height
        rows = np.linspace(horizon_px + _BELOW_HORIZON * height, (1.0 - _ABOVE_EDGE) * height - 2, _ROWS)
        rows = np.unique(rows[(rows >= 1) & (rows < height - 1)].astype(np.int64))
        paint_px = np.maximum((rows - horizon_px) * _PAINT_WIDTH_M / _CAMERA_HEIGHT_M, 2.0)
        if width < 64 or not len(rows):
            return RawLanes(self.name, np.zeros((0, 2), np.float32), np.zeros(0, np.float32), np.zeros(0, np.int32))
        points, scores = _paint(np.ascontiguousarray(bgr), rows, paint_px, _MIN_CONTRAST, _FULL_CONTRAST)
        return RawLanes(self.name, points, scores, np.full(len(points), -1, np.int32))

    def of_camera(self, camera: CameraCalibration | None) -> ClassicalLanes:
        """The same for images of another camera; None if it is not known."""
        return replace(open_classical(camera), notes=self.notes)


def open_classical(camera: CameraCalibration | None) -> ClassicalLanes:
    """The detector for images of a calibrated camera, or of an unknown dashboard camera."""
    horizon = horizon_share(camera)
    return ClassicalLanes(NAME if camera is None else f"{NAME}-{horizon:.3f}", horizon)


@numba.njit(cache=True, nogil=True)
def _paint(bgr, rows, paint_px, min_contrast, full_contrast):  # type: ignore[no-untyped-def]  # pragma: no cover
    """For each row, the positions of bands with the width of paint that are brighter (or yellower) than the bands
    beside them."""
    columns = bgr.shape[1]
    points, scores = np.empty((len(rows) * _PER_ROW, 2), np.float32), np.empty(len(rows) * _PER_ROW, np.float32)
    bright, yellow = np.zeros(columns + 1), np.zeros(columns + 1)
    contrast = np.zeros(columns)
    count = 0
    for k in range(len(rows)):
        # prefix sums along the row, over three rows: less noise, and the mean of any band in O(1)
        for u in range(columns):
            light = colour = 0.0
            for v in range(rows[k] - 1, rows[k] + 2):
                blue, green, red = float(bgr[v, u, 0]), float(bgr[v, u, 1]), float(bgr[v, u, 2])
                light += 0.5 * (red + green)
                colour += 0.5 * (red + green) - blue
            bright[u + 1] = bright[u] + light / 3.0
            yellow[u + 1] = yellow[u] + colour / 3.0
        half = max(1, int(paint_px[k] / 2))
        band, gap = 2 * half + 1, half
        reach = half + gap + band
        for u in range(columns):
            contrast[u] = 0.0
        for u in range(reach, columns - reach):
            best = 0.0
            for total in (bright, yellow):
                middle = (total[u + half + 1] - total[u - half]) / band
                left = (total[u - half - gap] - total[u - half - gap - band]) / band
                right = (total[u + half + gap + band + 1] - total[u + half + gap + 1]) / band
                over = middle - max(left, right)
                if over > abs(left - right):  # a step, such as a shadow's edge, is not a band
                    best = max(best, over)
            contrast[u] = best
        found = 0
        u = reach
        while u < columns - reach and found < _PER_ROW:
            if contrast[u] < min_contrast:
                u += 1
                continue
            peak, weight, moment = contrast[u], 0.0, 0.0
            while u < columns - reach and contrast[u] >= min_contrast:
                peak = max(peak, contrast[u])
                weight += contrast[u]
                moment += contrast[u] * u
                u += 1
            points[count, 0], points[count, 1] = moment / weight, rows[k]
            scores[count] = min(1.0, peak / full_contrast)
            count += 1
            found += 1
    return points[:count].copy(), scores[:count].copy()


def warm_up() -> None:
    """Compile the kernel before the first image."""
    open_classical(None).detect(np.zeros((72, 128, 3), np.uint8))
