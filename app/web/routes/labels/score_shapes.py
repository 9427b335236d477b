"""Responses of /api/labels about a run scored against labels, as types."""

from __future__ import annotations

from collections.abc import Sequence

from app.web.routes.shapes.common import ApiModel, MetricJson
from pipeline.evaluation.lead_verdict import Verdict
from pipeline.evaluation.report_sections import Cell


class SizesJson(ApiModel):
    """Absolute errors, metres or m/s."""

    min: float
    """Smallest."""
    max: float
    """Largest."""
    mae: float
    """Mean of the absolute errors."""


class ErrorsJson(ApiModel):
    """A row of the paper's Table 4. Null where nothing says how far off it is."""

    vehicles: str
    """``all``, or of a range."""
    seen_by: str
    """VL, V, L or ``any``."""
    count: int
    """Sightings that were matched with a label."""
    distance: SizesJson | None
    """Of the range."""
    lateral: SizesJson | None
    """Of the nearest face's middle, across the ego axis."""
    longitudinal: SizesJson | None
    """Of the nearest face's middle, along the ego axis."""
    speed: SizesJson | None
    """Along the ego axis."""


class BadFrameJson(ApiModel):
    """A frame to look at first."""

    frame: int
    """Index in the recording."""
    verdict: Verdict
    """On the CIPV."""
    truth_m: float | None
    """How far off the lead is; null where nobody leads."""
    error_m: float | None
    """Of the CIPV's distance; null without one."""


class ScoreJson(ApiModel):
    """A run against the labels."""

    revision: int
    """Of the labels."""
    run: int
    """Number of the run."""
    judged: int
    """Frames in which the labels say who leads."""
    metrics: list[MetricJson]
    """Empty while nobody stands behind any label."""
    notes: list[str]
    """What does not count, and why."""
    errors: list[ErrorsJson]
    """By range and by sensor."""
    worst: list[BadFrameJson]
    """The worst frame first."""


def errors_json(row: Sequence[Cell]) -> ErrorsJson:
    """One row of ``error_rows``."""
    vehicles, seen_by, count, *figures = row
    sizes = [
        {"min": figures[n], "max": figures[n + 1], "mae": figures[n + 2]} if figures[n] is not None else None
        for n in range(0, len(figures), 3)
    ]
    named = dict(zip(("distance", "lateral", "longitudinal", "speed"), sizes, strict=True))
    return ErrorsJson.model_validate({"vehicles": vehicles, "seen_by": seen_by, "count": count, **named})
