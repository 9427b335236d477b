"""Assignment of vehicles to the cells of the grid, and the targets of these cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.inference.graph import Size
from pipeline.types import F32
from pipeline.vision.heads.decoder import grid_centres

RANGES_PX = {8: (0.0, 56.0), 16: (40.0, 128.0), 32: (96.0, np.inf)}
"""Range of box sizes, as the geometric mean of both sides in pixels, for each stride. The ranges overlap, so that every
size has a stride."""
RADIUS_CELLS = 1.0
MIN_VISIBLE, MIN_HEIGHT_PX = 0.25, 5.0
"""A vehicle less visible than this is ignored; less than ``_HIDDEN`` of a vehicle visible is background."""
_HIDDEN = 0.05

BACKGROUND, IGNORED = -1, -2


@dataclass(frozen=True)
class Targets:
    """Targets of the N cells of an image."""

    labels: npt.NDArray[np.int64]
    """(N,) int64 class index, ``BACKGROUND`` or ``IGNORED``."""
    boxes: F32
    """(N, 4) float32 x1 y1 x2 y2 in network pixels; zero for cells without a class."""


def assign(boxes: F32, labels: npt.NDArray[np.int64], visible: F32, size: Size) -> Targets:
    """Assign (M, 4) boxes with (M,) classes and (M,) visible shares to the cells of an input of (height, width).

    Each cell whose centre lies within ``RADIUS_CELLS`` of a box's centre is assigned to that box (centre sampling, Tian
    2019), at every stride whose range contains the box's size. If two boxes compete, the more visible one wins.
    """
    cells, strides = grid_centres(size)
    centres, stride = (cells + 0.5) * strides, strides[:, 0]
    wanted = np.full(len(cells), BACKGROUND, dtype=np.int64)
    chosen = np.zeros((len(cells), 4), dtype=np.float32)
    low, high = (np.array([RANGES_PX[int(s)][end] for s in stride]) for end in (0, 1))
    for row in np.argsort(visible, kind="stable"):
        box = boxes[row]
        width, height = float(box[2] - box[0]), float(box[3] - box[1])
        if visible[row] < _HIDDEN or width <= 0.0 or height <= 0.0:
            continue
        side = float(np.sqrt(width * height))
        away = np.abs(centres - (box[:2] + box[2:]) / 2).max(axis=1)
        mine = (away < RADIUS_CELLS * stride) & (low <= side) & (side < high)
        clear = visible[row] >= MIN_VISIBLE and height >= MIN_HEIGHT_PX
        wanted[mine] = labels[row] if clear else IGNORED
        chosen[mine] = box if clear else 0.0
    return Targets(wanted, chosen)
