"""YOLOv5 and v7: v3's anchors with bounded sizes, as raw maps or concatenated in the graph (their export scripts)."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.inference.graph import Size
from pipeline.types import F32
from pipeline.vision.heads.anchor_maps import are_maps, decode_maps, sigmoid
from pipeline.vision.heads.decoder import STRIDE_SETS, BoxOutputs, Decoded, Decoder, Head, decode_objectness


def decode(outputs: Sequence[F32], size: Size, floor: float) -> Decoded:
    """Three maps (1, 3, h/stride, w/stride, 5+C): centre (2σ(t)−½+cell)·stride, size anchor·(2σ(t))²."""
    return decode_maps(
        [output[0] for output in outputs],
        size,
        floor,
        lambda t, cell, stride: (2.0 * sigmoid(t) - 0.5 + cell) * stride,
        lambda t, anchor: (2.0 * sigmoid(t)) ** 2 * anchor,
    )


def _maps(answer: BoxOutputs) -> Decoder | None:
    if not are_maps(answer, (-3, -2), 5):
        return None
    return Decoder("yolov5 maps", answer.outputs[0].shape[-1] - 5, True, 1 / 255, True, decode)


def _rows(answer: BoxOutputs) -> Decoder | None:
    """Three anchors in each cell, one row each."""
    table = answer.single
    if table is None or table.shape[1] <= 5 or len(table) not in {3 * answer.cells(each) for each in STRIDE_SETS}:
        return None
    return Decoder("yolov5", table.shape[1] - 5, True, 1 / 255, False, decode_objectness)


MAPS = Head("YOLOv5/v7", _maps)
ROWS = Head("YOLOv5/v7", _rows)
