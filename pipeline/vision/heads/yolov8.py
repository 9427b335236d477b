"""YOLOv8 and v11: one column a cell, no objectness (their export script)."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.inference.graph import Size
from pipeline.types import F32
from pipeline.vision.heads.decoder import STRIDE_SETS, BoxOutputs, Decoded, Decoder, Head, above


def decode(outputs: Sequence[F32], size: Size, floor: float) -> Decoded:
    """(1, 4+C, N): centre and size in pixels, then class probabilities."""
    rows = outputs[0][0].T
    return above(rows[:, :2], rows[:, 2:4], rows[:, 4:], floor)


def _recognise(answer: BoxOutputs) -> Decoder | None:
    table = answer.single
    if table is None or len(table) <= 4 or table.shape[1] not in {answer.cells(each) for each in STRIDE_SETS}:
        return None
    return Decoder("yolov8", len(table) - 4, True, 1 / 255, False, decode)


COLUMNS = Head("YOLOv8/v11", _recognise)
