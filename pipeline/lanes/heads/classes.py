"""One mask with a class for each line, (1, 2 or more, h, w), perhaps with the probability (1, k) that each is there:
ENet-SAD and its like (CULane). Class 0 is nothing. CULane's mean and spread, RGB."""

from __future__ import annotations

from pipeline.lanes.heads.head import InputFit, LaneHead, LaneOutputs
from pipeline.lanes.heads.masks import from_masks

_CULANE = ((0.3598, 0.3653, 0.3662), (0.2573, 0.2663, 0.2756))
_CUT_ASPECT = 4.0
"""A wider input is for images with the sky cut off (CULane at 976×208)."""


def recognise(answer: LaneOutputs) -> LaneHead | None:
    """A single map with several classes, too large for a grid of cells."""
    index = answer.only_map()
    if index is None:
        return None
    _, channels, rows, columns = answer.shapes[index]
    if not 2 <= channels <= 16 or rows < 32 or columns < 32:
        return None
    exists = next((i for i, shape in enumerate(answer.shapes) if shape == (1, channels - 1)), None)
    fit: InputFit = "lower" if columns > _CUT_ASPECT * rows else "stretch"
    return LaneHead("classes", index, from_masks, fit, exists, *_CULANE)
