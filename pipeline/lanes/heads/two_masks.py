"""Two masks (1, 2, h, w), drivable area and lane lines, of BDD100K: TwinLiteNet (0–1, RGB), and YOLOP, which has boxes
(1, n, 6) beside them (letterboxed, ImageNet's mean and spread, RGB)."""

from __future__ import annotations

from pipeline.lanes.heads.head import IMAGENET, LaneHead, LaneOutputs
from pipeline.lanes.heads.masks import from_masks


def recognise(answer: LaneOutputs) -> LaneHead | None:
    """The lane mask is identified by its name, else it is the second output."""
    masks = [i for i, shape in enumerate(answer.shapes) if len(shape) == 4 and shape[:2] == (1, 2)]
    if len(masks) != 2:
        return None
    lanes = next((i for i in masks if answer.names[i].lower().startswith(("ll", "lane"))), masks[1])
    if any(len(shape) == 3 and shape[2] == 6 for shape in answer.shapes):
        return LaneHead("YOLOP", lanes, from_masks, "letterbox", None, *IMAGENET)
    return LaneHead("two masks", lanes, from_masks)
