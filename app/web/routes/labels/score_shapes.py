"""What /api/labels answers about a run that is judged by labels, as types."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import BaseModel

from app.web.routes.shapes import MetricJson
from pipeline.evaluation.lead_verdict import Verdict
from pipeline.evaluation.report_sections import Cell


class SizesJson(BaseModel):
    """Sizes of errors, metres or m/s."""

    min: float
    max: float
    mae: float


class ErrorsJson(BaseModel):
    """A row of the paper's Table 4. vehicles: ``all``, or of a range. seen_by: VL, V, L or ``any``. Null where nothing
    says how far off it is."""

    vehicles: str
    seen_by: str
    count: int
    distance: SizesJson | None
    lateral: SizesJson | None
    longitudinal: SizesJson | None
    speed: SizesJson | None


class BadFrameJson(BaseModel):
    """A frame to look at first. truth_m: how far off the lead is; error_m: of the CIPV's distance."""

    frame: int
    verdict: Verdict
    truth_m: float | None
    error_m: float | None


class ScoreJson(BaseModel):
    """revision: of the labels. judged: frames in which they say who leads. metrics: empty while nobody stands behind
    any label. notes: what does not count, and why. errors: by range and by sensor. worst: the worst frame first."""

    revision: int
    run: int
    judged: int
    metrics: list[MetricJson]
    notes: list[str]
    errors: list[ErrorsJson]
    worst: list[BadFrameJson]


def errors_json(row: Sequence[Cell]) -> ErrorsJson:
    """One of ``error_rows``."""
    vehicles, seen_by, count, *figures = row
    sizes = [
        {"min": figures[n], "max": figures[n + 1], "mae": figures[n + 2]} if figures[n] is not None else None
        for n in range(0, len(figures), 3)
    ]
    named = dict(zip(("distance", "lateral", "longitudinal", "speed"), sizes, strict=True))
    return ErrorsJson.model_validate({"vehicles": vehicles, "seen_by": seen_by, "count": count, **named})
