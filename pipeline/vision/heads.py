"""What the numbers at the end of a YOLO network mean: one pure function a head, and the choice between them.

Every decoder takes the network's raw outputs and its input size ``(height, width)`` and gives candidates scored at or
above a floor: boxes (M, 4) float32 ``x1 y1 x2 y2`` in network-input pixels, scores (M,) float32, class ids (M,) int64.
Scores are the best class's probability times objectness where the head has one.

Heads, by their authors' papers and export scripts: YOLOX (Ge 2021, section 2.1: centre offset and log size on a grid),
YOLOv3 (Redmon 2018, section 2.1: anchors, the network the paper uses), YOLOv5/v7 (2σ forms of the same),
v8/v11 (no objectness), and the end-to-end exports whose rows are final boxes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.inference.graph import Size
from pipeline.types import F32

I64 = npt.NDArray[np.int64]
Decoded = tuple[F32, F32, I64]

STRIDES = (8, 16, 32)
_STRIDE_SETS = (STRIDES, (8, 16, 32, 64), (16, 32))
V3_ANCHORS: Mapping[int, tuple[Size, ...]] = {
    8: ((10, 13), (16, 30), (33, 23)),
    16: ((30, 61), (62, 45), (59, 119)),
    32: ((116, 90), (156, 198), (373, 326)),
}
"""Anchor widths and heights in input pixels by stride, of YOLOv3 on COCO (Redmon 2018, section 2.3); v5 kept them."""


class UnknownHead(ValueError):
    """Outputs that no decoder understands; the text names their shapes."""


@dataclass(frozen=True)
class Decoder:
    """A head's meaning, and the picture it was trained on. ``rgb`` false: BGR. Pixel values are multiplied by
    ``scale``. ``own_grid``: the decoder lays the grid itself, so the graph holds none that a new input size breaks."""

    name: str
    classes: int
    rgb: bool
    scale: float
    own_grid: bool
    decode: Callable[[Sequence[F32], Size, float], Decoded]


def grid_centres(size: Size, strides: Sequence[int] = STRIDES) -> tuple[F32, F32]:
    """(N, 2) cell indices x y and (N, 1) strides, row by row, finest stride first."""
    cells, steps = [], []
    for stride in strides:
        rows, columns = size[0] // stride, size[1] // stride
        y, x = np.mgrid[:rows, :columns]
        cells.append(np.column_stack([x.ravel(), y.ravel()]))
        steps.append(np.full((rows * columns, 1), stride))
    return np.concatenate(cells).astype(np.float32), np.concatenate(steps).astype(np.float32)


def decode_yolox(outputs: Sequence[F32], size: Size, floor: float) -> Decoded:
    """YOLOX as exported by default: (1, N, 5+C), centres and log sizes relative to the grid, probabilities final."""
    rows = outputs[0][0]
    keep = np.flatnonzero(rows[:, 4] >= floor)
    cells, steps = (part[keep] for part in grid_centres(size))
    kept = rows[keep]
    centre = (kept[:, :2] + cells) * steps
    extent = np.exp(np.minimum(kept[:, 2:4], 20.0)) * steps
    return _above(centre, extent, kept[:, 4:5] * kept[:, 5:], floor)


def decode_objectness(outputs: Sequence[F32], size: Size, floor: float) -> Decoded:
    """(1, N, 5+C) with centre and size in pixels: v3/v5/v7 concatenated exports, YOLOX decoded in the graph."""
    rows = outputs[0][0]
    rows = rows[rows[:, 4] >= floor]
    return _above(rows[:, :2], rows[:, 2:4], rows[:, 4:5] * rows[:, 5:], floor)


def decode_v8(outputs: Sequence[F32], size: Size, floor: float) -> Decoded:
    """v8/v11: (1, 4+C, N), centre and size in pixels, class probabilities without objectness."""
    rows = outputs[0][0].T
    return _above(rows[:, :2], rows[:, 2:4], rows[:, 4:], floor)


def decode_end_to_end(outputs: Sequence[F32], size: Size, floor: float) -> Decoded:
    """v10/v26 style: (1, N, 6) rows ``x1 y1 x2 y2 score class``, suppressed in the graph."""
    rows = outputs[0][0]
    rows = rows[(rows[:, 4] >= floor) & np.isfinite(rows).all(axis=1)]
    return rows[:, :4].astype(np.float32), rows[:, 4].astype(np.float32), rows[:, 5].astype(np.int64)


def decode_v3_maps(outputs: Sequence[F32], size: Size, floor: float) -> Decoded:
    """Three raw maps (1, 3·(5+C), h/stride, w/stride) in any order: centre (σ(t)+cell)·stride, size anchor·e^t."""
    return _decode_maps(
        [_split_anchors(output) for output in outputs],
        size,
        floor,
        lambda t, cell, stride: (_sigmoid(t) + cell) * stride,
        lambda t, anchor: np.exp(np.minimum(t, 20.0)) * anchor,
    )


def decode_v5_maps(outputs: Sequence[F32], size: Size, floor: float) -> Decoded:
    """Three raw maps (1, 3, h/stride, w/stride, 5+C): centre (2σ(t)−½+cell)·stride, size anchor·(2σ(t))²."""
    return _decode_maps(
        [output[0] for output in outputs],
        size,
        floor,
        lambda t, cell, stride: (2.0 * _sigmoid(t) - 0.5 + cell) * stride,
        lambda t, anchor: (2.0 * _sigmoid(t)) ** 2 * anchor,
    )


def pick_decoder(outputs: Sequence[F32], size: Size, metadata: Mapping[str, str] | None = None) -> Decoder:
    """The decoder that fits what a network gave for any picture of ``size``. UnknownHead names the shapes otherwise.

    Values are needed beside shapes: YOLOX and its variant decoded in the graph differ in nothing else. metadata: the
    graph's own properties; v8-family exports say ``end2end`` there.
    """
    shapes = [output.shape for output in outputs]
    if len(shapes) == 3 and _are_maps(shapes, size, (-2, -1), 4):
        return Decoder("yolov3 maps", shapes[0][1] // 3 - 5, True, 1 / 255, True, decode_v3_maps)
    if len(shapes) == 3 and _are_maps(shapes, size, (-3, -2), 5):
        return Decoder("yolov5 maps", shapes[0][-1] - 5, True, 1 / 255, True, decode_v5_maps)
    if shapes and len(shapes[0]) == 3 and shapes[0][0] == 1:
        found = _single_output(outputs[0], size, metadata or {})
        if found is not None:
            return found
    listed = ", ".join("×".join(map(str, shape)) for shape in shapes) or "nothing"
    raise UnknownHead(
        f"no YOLO head has outputs of shape {listed} at an input of {size[1]}×{size[0]}; "
        "known are YOLOX, v3/v5/v7, v8/v11 and end-to-end exports"
    )


def _single_output(output: F32, size: Size, metadata: Mapping[str, str]) -> Decoder | None:
    _, rows, columns = output.shape
    cells = [sum((size[0] // s) * (size[1] // s) for s in strides) for strides in _STRIDE_SETS]
    if columns == 6 and metadata.get("end2end") == "True":
        return Decoder("end to end", 0, True, 1 / 255, False, decode_end_to_end)
    if rows == cells[0] and columns > 5:
        if float(np.median(np.abs(output[0, :, :2]))) < STRIDES[0]:
            return Decoder("yolox", columns - 5, False, 1.0, True, decode_yolox)
        if np.all(output[0, :, 4] == 1.0):  # v6 has no objectness and writes ones in its place
            return Decoder("yolov6", columns - 5, True, 1 / 255, False, decode_objectness)
        return Decoder("yolox decoded", columns - 5, False, 1.0, False, decode_objectness)
    if columns > 5 and rows in {3 * n for n in cells}:
        return Decoder("yolov5", columns - 5, True, 1 / 255, False, decode_objectness)
    if rows > 4 and columns in cells:
        return Decoder("yolov8", rows - 4, True, 1 / 255, False, decode_v8)
    if columns == 6 and rows <= 1000:
        return Decoder("end to end", 0, True, 1 / 255, False, decode_end_to_end)
    return None


def _are_maps(shapes: Sequence[tuple[int, ...]], size: Size, axes: tuple[int, int], dims: int) -> bool:
    """Whether the outputs are one map a stride, each with three anchors of the same number of channels."""
    if any(len(shape) != dims or shape[0] != 1 for shape in shapes):
        return False
    grids = sorted((shape[axes[0]], shape[axes[1]]) for shape in shapes)
    channels = {shape[1] if dims == 4 else 3 * shape[-1] for shape in shapes}
    anchors = dims == 4 or all(shape[1] == 3 for shape in shapes)
    fits = grids == sorted((size[0] // s, size[1] // s) for s in STRIDES)
    return fits and anchors and len(channels) == 1 and min(channels) % 3 == 0 and min(channels) // 3 > 5


def _split_anchors(output: F32) -> F32:
    """(1, 3·(5+C), rows, columns) → (3, rows, columns, 5+C)."""
    _, channels, rows, columns = output.shape
    return output.reshape(3, channels // 3, rows, columns).transpose(0, 2, 3, 1)


def _decode_maps(
    maps: Sequence[F32],
    size: Size,
    floor: float,
    centre_of: Callable[[F32, F32, int], F32],
    extent_of: Callable[[F32, F32], F32],
) -> Decoded:
    """Anchored maps, each (3, rows, columns, 5+C) of logits, finest stride first whatever the outputs' order."""
    parts = []
    for rows in sorted(maps, key=lambda m: -m.shape[1] * m.shape[2]):
        stride = size[0] // rows.shape[1]
        anchor, y, x = np.nonzero(_sigmoid(rows[..., 4]) >= floor)
        kept = rows[anchor, y, x]
        anchors = np.asarray(V3_ANCHORS[stride], dtype=np.float32)[anchor]
        centre = centre_of(kept[:, :2], np.column_stack([x, y]).astype(np.float32), stride)
        scores = _sigmoid(kept[:, 4:5]) * _sigmoid(kept[:, 5:])
        parts.append(_above(centre, extent_of(kept[:, 2:4], anchors), scores, floor))
    return (
        np.concatenate([boxes for boxes, _, _ in parts]),
        np.concatenate([scores for _, scores, _ in parts]),
        np.concatenate([classes for _, _, classes in parts]),
    )


def _above(centre: F32, extent: F32, class_scores: F32, floor: float) -> Decoded:
    """Corner boxes of the candidates whose best class reaches the floor; what is not finite is no candidate."""
    if not len(class_scores):
        return np.zeros((0, 4), np.float32), np.zeros(0, np.float32), np.zeros(0, np.int64)
    classes = np.argmax(class_scores, axis=1)
    scores = class_scores[np.arange(len(classes)), classes]
    boxes = np.column_stack([centre - extent / 2, centre + extent / 2])
    keep = (scores >= floor) & np.isfinite(boxes).all(axis=1)
    return boxes[keep].astype(np.float32), scores[keep].astype(np.float32), classes[keep].astype(np.int64)


def _sigmoid(t: F32) -> F32:
    return (1.0 / (1.0 + np.exp(-np.clip(t, -60.0, 60.0)))).astype(np.float32)
