"""YOLOv3's raw maps (Redmon 2018, section 2.1): the network that the paper uses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.inference.graph import Size
from pipeline.types import F32
from pipeline.vision.heads.anchor_maps import are_maps, decode_maps, sigmoid
from pipeline.vision.heads.decoder import BoxOutputs, Decoded, Decoder, Head


def decode(outputs: Sequence[F32], size: Size, floor: float) -> Decoded:
    """Three maps (1, 3·(5+C), h/stride, w/stride) in any order: centre (σ(t)+cell)·stride, size anchor·e^t."""
    return decode_maps(
        [_split_anchors(output) for output in outputs],
        size,
        floor,
        lambda t, cell, stride: (sigmoid(t) + cell) * stride,
        lambda t, anchor: np.exp(np.minimum(t, 20.0)) * anchor,
    )


def _split_anchors(output: F32) -> F32:
    """(1, 3·(5+C), rows, columns) → (3, rows, columns, 5+C)."""
    _, channels, rows, columns = output.shape
    return output.reshape(3, channels // 3, rows, columns).transpose(0, 2, 3, 1)


def _recognise(answer: BoxOutputs) -> Decoder | None:
    if not are_maps(answer, (-2, -1), 4):
        return None
    return Decoder("yolov3 maps", answer.outputs[0].shape[1] // 3 - 5, True, 1 / 255, True, decode)


MAPS = Head("YOLOv3", _recognise)
