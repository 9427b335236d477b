"""Images of a fit's residuals: detected boxes and projected clusters in a frame, before and after the fit."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from pipeline.alignment.projection import Alignment
from pipeline.calibration.alignment.fit import AlignmentFit
from pipeline.calibration.alignment.models import FitModel
from pipeline.calibration.alignment.pairs import PairTable
from pipeline.calibration.alignment.scenes import fit_scene
from pipeline.calibration.alignment.search import GATES
from pipeline.params import AlignmentParams, Params
from pipeline.types import F64, U8, Frame

FRAMES = 6
"""Number of images, evenly over the drive."""
_BOX, _BEFORE, _AFTER = (255, 255, 255), (60, 160, 255), (90, 220, 90)
"""Blue, green, red."""
_CAPTION_PX = 26


def residual_image(frame: Frame, fit: AlignmentFit, params: Params) -> U8 | None:
    """(H, W, 3) uint8 blue green red. White: boxes of vehicles that the fit pairs with a cluster. Orange: the cluster
    with the alignment in ``params``, if complete. Green: with the fit. The caption gives the root mean square distance
    of their edges, in pixels. None if no vehicle in the frame is paired."""
    scene = fit_scene(frame, params)
    if scene is None or frame.image is None:
        return None
    place_m = {"forward_m": params.alignment.forward_m}  # no fit changes it
    model = FitModel(fit.model, scene.camera, scene.size, offset=True, place_m=place_m)
    table = PairTable.of([scene])
    fitted = AlignmentParams.model_construct(**{**params.alignment.model_dump(), "model": fit.model, **fit.values})
    found, present = model.vector(fitted), model.vector(params.alignment)
    if found is None:
        return None
    before, after = replace(model, zoom=params.alignment.zoom), replace(model, zoom=fit.values.get("zoom", 1.0))
    rows = table.matched(table.residuals(after.aligned(found)), GATES[-1][1])
    if not len(rows):
        return None
    drawn = frame.image.bgr.copy()
    boxes, whole = table.boxes[table.box[rows]], table.whole[table.box[rows]]
    said = [(f"{len(rows)} vehicles", _BOX)]
    for name, colour, lens, vector in (("before", _BEFORE, before, present), ("after", _AFTER, after, found)):
        if vector is None:
            continue
        rectangles = _rectangles(table, lens.aligned(vector))[rows]
        _draw(drawn, rectangles, colour)
        off = (rectangles - boxes)[whole & np.isfinite(rectangles)]
        said.append((f"{name}: {np.sqrt(np.mean(off**2)):.1f} px" if len(off) else name, colour))
    _draw(drawn, boxes, _BOX)
    _caption(drawn, said)
    return drawn


def _rectangles(table: PairTable, aligned: Alignment) -> F64:
    """(P, 4) x1 y1 x2 y2 of each pair's cluster, pixels; a roof between two rings is taken from the box."""
    left, right, low, high, foot = table.extents(aligned)[table.cluster].T
    top = np.clip(table.boxes[table.box, 1], high, low)
    return np.column_stack([left, top, right, foot])


def _draw(drawn: U8, rectangles: F64, colour: tuple[int, int, int]) -> None:
    reach = 4.0 * max(drawn.shape[:2])
    for x1, y1, x2, y2 in np.clip(rectangles[np.isfinite(rectangles).all(axis=1)], -reach, reach).round().astype(int):
        cv2.rectangle(drawn, (int(x1), int(y1)), (int(x2), int(y2)), colour, 1, cv2.LINE_AA)


def _caption(drawn: U8, parts: list[tuple[str, tuple[int, int, int]]]) -> None:
    drawn[:_CAPTION_PX] //= 3
    x = 8
    for text, colour in parts:
        cv2.putText(drawn, text, (x, _CAPTION_PX - 8), cv2.FONT_HERSHEY_SIMPLEX, 0.55, colour, 1, cv2.LINE_AA)
        x += cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.55, 1)[0][0] + 24
