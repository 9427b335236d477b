"""The progress of a fit, as the page polls it."""

from __future__ import annotations

from typing import Any, Literal

from app.core.jobs import BackgroundJob, JobState
from app.web.routes.shapes.common import ApiModel


class FitProgress(ApiModel):
    """How far a fit is."""

    state: JobState | Literal["none"]
    """``none``: no fit was begun for this recording."""
    progress: float
    """0–1."""
    note: str
    """Why it failed; empty otherwise."""


def progress_of(job: BackgroundJob[Any] | None) -> FitProgress:
    """Of the newest fit; None if there is none."""
    if job is None:
        return FitProgress(state="none", progress=0.0, note="")
    now = job.status
    return FitProgress(state=now.state, progress=now.fraction, note=now.error or "")
