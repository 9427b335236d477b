"""Outputs of lane networks as points in the image: one file per head, and the choice between them.

To add a head, write a file like ``row_grid.py`` that ends in a ``recognise``, and list it in ``HEADS``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pipeline.lanes.heads import classes, curves, row_grid, two_masks
from pipeline.lanes.heads.head import LaneHead, LaneOutputs, UnknownLaneHead
from pipeline.types import F32

__all__ = ["HEADS", "LaneHead", "UnknownLaneHead", "pick_head"]

HEADS: tuple[Callable[[LaneOutputs], LaneHead | None], ...] = (
    two_masks.recognise,
    curves.recognise,
    row_grid.recognise,
    classes.recognise,
)
"""Each returns its head if it recognises the outputs. The first match is used."""


def pick_head(outputs: Sequence[F32], names: Sequence[str]) -> LaneHead:
    """The head of a network, from the shapes and names of its outputs. UnknownLaneHead if none recognises them."""
    answer = LaneOutputs([np.asarray(output).shape for output in outputs], names)
    for recognise in HEADS:
        head = recognise(answer)
        if head is not None:
            return head
    described = ", ".join("×".join(map(str, shape)) for shape in answer.shapes)
    raise UnknownLaneHead(f"its outputs ({described}) match no known lane network")
