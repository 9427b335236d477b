"""/api/alignment/pairs: fit the alignment to pairs picked by hand. The pairs stay with the client, and nothing changes;
the client applies the result."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from fastapi import APIRouter
from pydantic import ConfigDict, Field

from app.core.request_shapes import Finite
from app.engine.engine import Engine
from app.web.routes.alignment.shown import shown_frame
from app.web.routes.shapes.common import ApiModel, Point
from pipeline.alignment.projection import resolve
from pipeline.calibration.alignment.models import ModelName
from pipeline.calibration.alignment.point_pair_doubts import PairsRefused
from pipeline.calibration.alignment.point_pairs import CLUSTER_M, PointPair, PointPairFit, fit_point_pairs
from pipeline.types import F64

MOST_PAIRS = 100


class GivenPair(ApiModel):
    """A place that the LiDAR measured, and where it belongs in the image."""

    model_config = ConfigDict(extra="forbid")

    point: tuple[Finite, Finite, Finite]
    """x, y, z in the ego frame, metres."""
    pixel: tuple[Finite, Finite]
    """Column and row of the original image."""
    kind: Literal["point", "cluster"] = "point"
    """``cluster``: where the vehicle of a cluster stands on the road, which counts less."""

    def value(self) -> PointPair:
        return PointPair(np.array(self.point), np.array(self.pixel), CLUSTER_M if self.kind == "cluster" else 0.0)


class GivenPairs(ApiModel):
    """Pairs of one camera, of any frames."""

    model_config = ConfigDict(extra="forbid")

    model: Annotated[ModelName, Field(description="angular needs no calibration")] = "pinhole"
    offset: bool = Field(False, description="pinhole: also fit the camera's lateral and vertical position")
    pairs: list[GivenPair] = Field(max_length=MOST_PAIRS)
    """In the order in which warnings number them, from 1."""


class PairFitJson(ApiModel):
    """The alignment that brings points to their pixels."""

    changes: dict[str, float | str]
    """Parameters by dotted name, as PATCH /api/params takes them."""
    sigmas: dict[str, float]
    """Standard deviation of each value."""
    fitted: list[Point | None]
    """Pixels of the points with the fit; null for one that the camera cannot see."""
    rms_px: float
    """Root mean square distance of these from the picked pixels, without outliers."""
    outliers: list[int]
    """Indices of the pairs that contradict the others and were left out."""
    warnings: list[str]
    """What to check."""


class PairsJson(ApiModel):
    """Pairs with the present parameters, and their fit."""

    present: list[Point | None]
    """Pixels of the points with the present parameters; null for one that the camera cannot see, or without any
    alignment."""
    fit: PairFitJson | None
    """Null if the pairs do not determine it."""
    text: str
    """The outcome in a sentence; why there is no fit, if there is none."""


def alignment_pairs_router(engine: Engine) -> APIRouter:
    """The route of pairs picked by hand."""
    router = APIRouter(prefix="/api/alignment", tags=["alignment"])

    @router.post("/pairs")
    def fit(body: GivenPairs) -> PairsJson:
        """Fit the alignment to pairs of LiDAR points and pixels. Answers without a fit, and why, where the pairs do
        not determine it. 404 when nothing is shown."""
        frame, size = shown_frame(engine)
        params = engine.control.peek().params.alignment
        pairs = [each.value() for each in body.pairs]
        aligned = resolve(params, frame.camera)
        points = np.array([each.point for each in pairs]).reshape(-1, 3)
        present = aligned.project(points) if aligned is not None else np.full((len(pairs), 2), np.nan)
        try:
            found = fit_point_pairs(pairs, body.model, params, frame.camera, size, body.offset)
        except PairsRefused as reason:
            return PairsJson(present=_pixels(present), fit=None, text=f"No fit: {reason}")
        return PairsJson(present=_pixels(present), fit=_json(found), text=_sentence(pairs, present, found))

    return router


def _json(found: PointPairFit) -> PairFitJson:
    return PairFitJson(
        changes=found.changes,
        sigmas={f"alignment.{name}": value for name, value in found.sigmas.items()},
        fitted=_pixels(found.projected),
        rms_px=found.rms_px,
        outliers=list(found.outliers),
        warnings=list(found.warnings),
    )


def _sentence(pairs: Sequence[PointPair], present: F64, found: PointPairFit) -> str:
    used = np.setdiff1d(np.arange(len(pairs)), found.outliers)
    off = present[used] - [pairs[k].pixel for k in used]
    before_px = float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
    before = f"{before_px:.1f} px → " if np.isfinite(before_px) else ""
    return f"Points are {before}{found.rms_px:.1f} px from their pixels (root mean square of {len(used)} pairs)"


def _pixels(uv: F64) -> list[Point | None]:
    return [(u, v) if np.isfinite((u, v)).all() else None for u, v in np.round(uv, 2).tolist()]
