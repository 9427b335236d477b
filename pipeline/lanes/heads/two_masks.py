"""Two masks (1, 2, h, w), drivable area and lane lines, of BDD100K: TwinLiteNet (0–1, RGB), and YOLOP, which has boxes
(1, n, 6) beside them (letterboxed, ImageNet's mean and spread, RGB)."""

from __future__ import annotations

from pipeline.lanes.heads.head import IMAGENET, LaneHead, LaneOutputs
from pipeline.lanes.heads.masks import from_masks, road_edges

_HORIZON = 0.22
"""TwinLiteNet needs only the road, in its own aspect. Cutting off the sky leaves its lines where they were on 11
photographs of 16:9, for 40 % of the processor time: they are 0.0018 of the image's width away from marks made by hand,
before 0.0016 (90 %: 0.0039 and 0.0038). Wider images lost lines by being stretched to 16:9: both lines of the lane were
found in 12 of 23 frames of KITTI 0052 and in 24 of 39 of Astyx, and in 23 and 35 with their own aspect. This horizon
leaves 3° to 5° of sky, so it may be as much higher than the calibration says."""


def recognise(answer: LaneOutputs) -> LaneHead | None:
    """The lane mask is identified by its name, else it is the second output."""
    masks = [i for i, shape in enumerate(answer.shapes) if len(shape) == 4 and shape[:2] == (1, 2)]
    if len(masks) != 2:
        return None
    lanes = next((i for i in masks if answer.names[i].lower().startswith(("ll", "lane"))), masks[1])
    road = next(i for i in masks if i != lanes)
    if any(len(shape) == 3 and shape[2] == 6 for shape in answer.shapes):
        return LaneHead("YOLOP", lanes, from_masks, "letterbox", None, *IMAGENET, road=road, read_road=road_edges)
    return LaneHead(
        "two masks", lanes, from_masks, horizon=_HORIZON, road=road, read_road=road_edges, keeps_aspect=True
    )
