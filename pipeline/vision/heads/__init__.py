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
"""The heads in the order in which they are tried: the first that recognises an answer is taken, so a head comes before
those that would take its answers for theirs."""


def pick_decoder(outputs: Sequence[F32], size: Size, metadata: Mapping[str, str] | None = None) -> Decoder:
    """The decoder for a network, by what the network gave for any image.

    Args:
        outputs: the network's raw outputs. Their values are needed beside their shapes: YOLOX and its variant decoded
            in the graph differ in nothing else.
        size: the network's input (height, width).
        metadata: the graph's own properties; exports of the v8 family say ``end2end`` there.

    Raises:
        UnknownHead: no head recognises the outputs; the text names their shapes.
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
