"""/api/alignment/versions: saved alignments. Restoring one changes parameters and can be undone in one step."""

from __future__ import annotations

from dataclasses import asdict
from datetime import UTC, datetime
from typing import Any

from fastapi import APIRouter, HTTPException
from pydantic import ConfigDict, Field

from app.drive.alignment_scenes import AlignmentScenes
from app.drive.alignment_versions import LONGEST_NOTE, AlignmentVersion, AlignmentVersions
from app.drive.fitting import AlignmentFitting
from app.engine.engine import Engine
from app.web.refusals import refusing
from app.web.routes.alignment.score import seen_now
from app.web.routes.shapes.common import ApiModel, StatusJson
from pipeline.calibration.edge_match import edge_score
from pipeline.params import with_changes


class KeptAlignment(ApiModel):
    """A version of the present alignment."""

    model_config = ConfigDict(extra="forbid")

    note: str = Field("", max_length=LONGEST_NOTE, description="A note to store with it")


class AlignmentVersionJson(ApiModel):
    """A saved alignment."""

    id: int
    """Of the version; never given twice."""
    saved_at: str
    """Date and time, ISO 8601."""
    drive: str
    """What it was found on."""
    note: str
    """What to remember about it."""
    values: dict[str, Any]
    """Alignment parameters by dotted name, as PATCH /api/params takes them."""
    match: float | None
    """Share of the best nearby alignment's edge score; null where it was not known."""
    iou: float | None
    """Mean overlap of boxes and projected clusters; null unless it was fitted."""
    is_present: bool
    """The parameters have these values now."""


def alignment_versions_router(
    engine: Engine, versions: AlignmentVersions, scenes: AlignmentScenes, fitting: AlignmentFitting
) -> APIRouter:
    """Routes for saved alignments."""
    router = APIRouter(prefix="/api/alignment/versions", tags=["alignment"])

    def listed(version: AlignmentVersion) -> AlignmentVersionJson:
        params = engine.control.peek().params
        return AlignmentVersionJson(**asdict(version), is_present=with_changes(params, version.values) == params)

    @router.get("")
    def read() -> list[AlignmentVersionJson]:
        """List the saved alignments, newest first."""
        return [listed(each) for each in versions.all()]

    @router.post("", status_code=201)
    def keep(body: KeptAlignment) -> AlignmentVersionJson:
        """Save the current alignment with date, recording, score and note. 404 when nothing is shown, 409 when it
        cannot be saved."""
        params = engine.control.peek().params
        seen = seen_now(engine, scenes)
        job = fitting.job
        fit = job.result if job is not None else None
        is_fit = fit is not None and with_changes(params, fit.changes) == params
        drive = engine.snapshot.title or engine.snapshot.uri or ""
        with refusing():
            version = versions.add(
                params,
                drive,
                datetime.now(UTC).isoformat(timespec="seconds"),
                body.note,
                match=edge_score(seen, params.alignment).score,
                iou=fit.after.mean_iou if fit is not None and is_fit else None,
            )
        return listed(version)

    @router.delete("/{number}")
    def remove(number: int) -> StatusJson:
        """Delete a saved alignment. 404 if there is none of this number."""
        with refusing():
            if not versions.remove(number):
                raise HTTPException(404, f"no saved alignment {number}")
        return StatusJson(status="removed")

    return router
