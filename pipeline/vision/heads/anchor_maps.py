"""Raw maps with three anchors in each cell, as YOLOv3 brought them and v5 kept them: one map a stride."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from pipeline.inference.graph import Size
from pipeline.types import F32
from pipeline.vision.heads.decoder import STRIDES, BoxOutputs, Decoded, above

ANCHORS: Mapping[int, tuple[Size, ...]] = {
    8: ((10, 13), (16, 30), (33, 23)),
    16: ((30, 61), (62, 45), (59, 119)),
    32: ((116, 90), (156, 198), (373, 326)),
}
"""Anchor widths and heights in input pixels by stride, of YOLOv3 on COCO (Redmon 2018, section 2.3); also used by v5.
"""


def are_maps(answer: BoxOutputs, axes: tuple[int, int], dims: int) -> bool:
    """Whether the outputs are one map per stride, each with three anchors with the same number of channels. axes: of
    rows and columns. dims: number of dimensions of each map; with 4, the anchors are stacked in the channels."""
    shapes = [output.shape for output in answer.outputs]
    if len(shapes) != len(STRIDES) or any(len(shape) != dims or shape[0] != 1 for shape in shapes):
        return False
    grids = sorted((shape[axes[0]], shape[axes[1]]) for shape in shapes)
    channels = {shape[1] if dims == 4 else 3 * shape[-1] for shape in shapes}
    anchors = dims == 4 or all(shape[1] == 3 for shape in shapes)
    fits = grids == sorted((answer.size[0] // s, answer.size[1] // s) for s in STRIDES)
    return fits and anchors and len(channels) == 1 and min(channels) % 3 == 0 and min(channels) // 3 > 5


def decode_maps(
    maps: Sequence[F32],
    size: Size,
    floor: float,
    centre_of: Callable[[F32, F32, int], F32],
    extent_of: Callable[[F32, F32], F32],
) -> Decoded:
    """Decode maps, each (3, rows, columns, 5+C) of logits; returned finest stride first for any order of the
    outputs."""
    parts = []
    for rows in sorted(maps, key=lambda m: -m.shape[1] * m.shape[2]):
        stride = size[0] // rows.shape[1]
        anchor, y, x = np.nonzero(sigmoid(rows[..., 4]) >= floor)
        kept = rows[anchor, y, x]
        anchors = np.asarray(ANCHORS[stride], dtype=np.float32)[anchor]
        centre = centre_of(kept[:, :2], np.column_stack([x, y]).astype(np.float32), stride)
        scores = sigmoid(kept[:, 4:5]) * sigmoid(kept[:, 5:])
        parts.append(above(centre, extent_of(kept[:, 2:4], anchors), scores, floor))
    return (
        np.concatenate([boxes for boxes, _, _ in parts]),
        np.concatenate([scores for _, scores, _ in parts]),
        np.concatenate([classes for _, _, classes in parts]),
    )


def sigmoid(t: F32) -> F32:
    """1 / (1 + e^−t), without overflow for large logits."""
    return (1.0 / (1.0 + np.exp(-np.clip(t, -60.0, 60.0)))).astype(np.float32)
