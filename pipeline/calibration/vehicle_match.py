"""What the vehicles that both sensors see say about the pitch of an alignment.

Depth edges along a ring are upright, and where few upright edges of the image end above or below, as in drawn images,
they hardly show pitch: the best match may be 1.5° off. The box of a vehicle ends where it stands on the road that the
LiDAR measures, which shows pitch to about 0.2° in any image. So where enough vehicles are seen, they tell the pitch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pipeline.calibration.alignment.models import FitModel
from pipeline.calibration.alignment.pairs import PairTable
from pipeline.calibration.alignment.scenes import FitScene
from pipeline.calibration.alignment.solve import boxes_off
from pipeline.calibration.edge_match import EdgeScore
from pipeline.params import AlignmentParams

FEWEST_VEHICLES = 12
"""Pairs of boxes and clusters below which edges alone are asked, as for a fit."""
CLEAR_DEG, STEP_DEG = 0.5, 0.25
"""Smallest turn that is reported, more than three times the errors that all frames share; what it is rounded to."""


def with_vehicles(found: EdgeScore, scenes: Sequence[FitScene], params: AlignmentParams) -> EdgeScore:
    """The score of the edges, with the change of pitch that vehicles ask for instead of that of the edges; where no
    match of the edges stands out, vehicles tell the yaw, too. Unchanged with too few vehicles, and with an angular
    model. scenes: of one camera."""
    camera = scenes[0].camera if scenes else None
    if params.model != "pinhole" or camera is None:
        return found
    model = FitModel("pinhole", camera, scenes[0].size, offset=True, place_m={"forward_m": params.forward_m})
    model = replace(model, zoom=params.zoom)
    vector = model.vector(params)
    assert vector is not None
    off = boxes_off(PairTable.of(scenes), model, vector)
    if len(off.rows) < FEWEST_VEHICLES:
        return found
    told = {model.unknowns[k]: round(float(off.vector[k]) / STEP_DEG) * STEP_DEG for k in (0, 1)}
    by_edges = {name: by for name, by in found.better.items() if name != "pitch_deg"}
    if found.score is not None:
        del told["yaw_deg"]
    return replace(found, better=by_edges | {name: by for name, by in told.items() if abs(by) >= CLEAR_DEG})
