"""YOLOv6: one row a cell, centre and size in pixels; it has no objectness and writes ones in its place."""

from __future__ import annotations

import numpy as np

from pipeline.vision.heads.decoder import BoxOutputs, Decoder, Head, decode_objectness


def _recognise(answer: BoxOutputs) -> Decoder | None:
    table = answer.single
    if table is None or len(table) != answer.cells() or table.shape[1] <= 5 or not np.all(table[:, 4] == 1.0):
        return None
    return Decoder("yolov6", table.shape[1] - 5, True, 1 / 255, False, decode_objectness)


ROWS = Head("YOLOv6", _recognise)
