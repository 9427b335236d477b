"""Decoding the outputs of YOLO networks: one file per head, and the choice between them.

To add a head, write a file like ``yolov8.py`` that ends in a ``Head``, and list it in ``HEADS``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pipeline.inference.graph import Size
from pipeline.types import F32
from pipeline.vision.heads import detr, end_to_end, yolov3, yolov5, yolov6, yolov8, yolox
from pipeline.vision.heads.decoder import BoxOutputs, Decoder, Head, UnknownHead

__all__ = ["HEADS", "Decoder", "Head", "UnknownHead", "pick_decoder"]

HEADS: tuple[Head, ...] = (
    yolov3.MAPS,
    yolov5.MAPS,
    end_to_end.MARKED,
    detr.LABELS_BOXES_SCORES,
    yolox.RAW,
    yolov6.ROWS,
    yolox.DECODED,
    yolov5.ROWS,
    yolov8.COLUMNS,
    end_to_end.ROWS,
)
"""The heads in the order in which they are tried. The first one that recognises an output is used, so a specific head
must come before heads that would also accept its outputs."""


def pick_decoder(outputs: Sequence[F32], size: Size, metadata: Mapping[str, str] | None = None) -> Decoder:
    """Select the decoder for a network from its outputs for any image.

    Args:
        outputs: the network's raw outputs. Their values are needed as well as their shapes: YOLOX with and without
            decoding in the graph differs only in these.
        size: the network's input (height, width).
        metadata: properties of the graph; exports of the v8 family set ``end2end`` there.

    Raises:
        UnknownHead: no head recognises the outputs; the text lists their shapes.
    """
    answer = BoxOutputs(outputs, size, metadata or {})
    for head in HEADS:
        decoder = head.recognise(answer)
        if decoder is not None:
            return decoder
    listed = ", ".join("×".join(map(str, output.shape)) for output in outputs) or "nothing"
    known = ", ".join(dict.fromkeys(head.family for head in HEADS))
    raise UnknownHead(
        f"no YOLO head has outputs of shape {listed} at an input of {size[1]}×{size[0]}; known are {known}"
    )
