"""The lines of the ego lane for views: polylines on the road, and pixels of the image."""

from __future__ import annotations

import numpy as np

from pipeline.alignment.projection import Alignment
from pipeline.types import F64
from pipeline.types.lane import EgoLane, LaneLine

_POLYLINE_STEP_M = 1.0
_DRAWN_FROM_M = 1.0
"""Ahead of the camera; nearer points project far outside the image."""


def polylines(lane: EgoLane) -> dict[str, F64]:
    """``left`` and ``right`` as (K, 2) ego x, y, one point per metre where paint supports them; (0, 2) without a
    line."""
    return {"left": _polyline(lane.left), "right": _polyline(lane.right)}


def in_image(lane: EgoLane, aligned: Alignment) -> dict[str, F64]:
    """``left`` and ``right`` as (K, 2) pixels u, v where the lines were seen, NaN behind the camera. The alignment does
    not include the estimated pitch, so each point is moved to where it appears with this pitch."""
    plane = lane.plane
    eye, _ = aligned.rays(np.zeros((0, 2)))
    height_m = float(eye[2] - (plane[0] * eye[0] + plane[1] * eye[1] + plane[2]))
    drawn = {}
    for side, line in polylines(lane).items():
        ahead = line[line[:, 0] > eye[0] + _DRAWN_FROM_M] - eye[:2]
        seemed = ahead / (1.0 - ahead[:, :1] * lane.pitch_rad / height_m) + eye[:2]
        drawn[side] = aligned.project(np.column_stack([seemed, seemed @ plane[:2] + plane[2]]))
    return drawn


def _polyline(line: LaneLine | None) -> F64:
    if line is None:
        return np.zeros((0, 2))
    x = np.append(np.arange(line.x_min_m, line.x_max_m, _POLYLINE_STEP_M), line.x_max_m)
    return np.column_stack([x, line.y_m(x)])
