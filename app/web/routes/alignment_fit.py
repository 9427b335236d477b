"""/api/alignment/fit: fit the alignment to the open recording. Nothing is changed: who asked applies the result."""

from __future__ import annotations

from typing import Annotated, Literal

import yaml
from fastapi import APIRouter, HTTPException, Response
from pydantic import BaseModel, ConfigDict, Field

from app.core.jobs import JobState
from app.drive.alignment_fit import AlignmentFitting, FitJob
from app.engine.engine import Engine
from app.web.routes.refusals import open_recording, refusing
from app.web.routes.shapes import StatusJson, file_of
from pipeline.calibration.alignment.fit import AlignmentFit, overlap_sentence
from pipeline.calibration.alignment.models import ModelName


class FitChoice(BaseModel):
    """What to fit."""

    model_config = ConfigDict(extra="forbid")

    model: Annotated[ModelName, Field(description="angular needs no calibration")] = "pinhole"
    offset: bool = Field(False, description="pinhole: also fit the camera's lateral and vertical position")


class FitResult(BaseModel):
    """changes: parameters by dotted name, as PATCH /api/params takes them. sigmas: standard deviation of each value.
    iou_before, iou_after: mean overlap of boxes and projected clusters, of held-out frames if the drive is long enough;
    null without an alignment before. text: that in a sentence. warnings: what the drive cannot tell."""

    changes: dict[str, float | str]
    sigmas: dict[str, float]
    frames: int
    pairs: int
    iou_before: float | None
    iou_after: float
    text: str
    warnings: list[str]


class FitJson(BaseModel):
    """state none: no fit was begun for this recording. progress is 0–1."""

    state: JobState | Literal["none"]
    progress: float
    note: str
    result: FitResult | None


def alignment_fit_router(engine: Engine) -> APIRouter:
    """Routes over the one fit."""
    router = APIRouter(prefix="/api/alignment", tags=["alignment"])
    fitting = AlignmentFitting(engine.drives)

    @router.post("/fit", status_code=202)
    def begin(body: FitChoice) -> FitJson:
        """Fit the alignment to the whole recording in the background. 409 while a fit runs or without a detector, 404
        without a recording."""
        with refusing():
            recording = open_recording(engine.drives)
            return _json(fitting.begin(recording, body.model, engine.control.peek().params, body.offset))

    @router.get("/fit")
    def read() -> FitJson:
        """Get the progress of the fit and its result."""
        return _json(fitting.job)

    @router.delete("/fit")
    def cancel() -> StatusJson:
        """Cancel the fit, or forget its result."""
        if not fitting.cancel():
            raise HTTPException(404, "there is no fit")
        return StatusJson(status="removed")

    @router.get("/fit.yaml", response_class=Response, responses=file_of("application/yaml"))
    def download() -> Response:
        """Download the fitted parameters as a file for `cipv run --params`."""
        job = fitting.job
        if job is None or job.result is None:
            raise HTTPException(404, "there is no fit")
        section = {"alignment": {"model": job.result.model, **job.result.values}}
        headers = {"content-disposition": 'attachment; filename="cipv-alignment.yaml"'}
        return Response(yaml.safe_dump(section, sort_keys=False), media_type="application/yaml", headers=headers)

    return router


def _json(job: FitJob | None) -> FitJson:
    if job is None:
        return FitJson(state="none", progress=0.0, note="", result=None)
    now = job.status
    result = _result(job.result) if job.result is not None else None
    return FitJson(state=now.state, progress=now.fraction, note=now.error or "", result=result)


def _result(fit: AlignmentFit) -> FitResult:
    return FitResult(
        changes=fit.changes,
        sigmas={f"alignment.{name}": value for name, value in fit.sigmas.items()},
        frames=fit.frames,
        pairs=fit.pairs,
        iou_before=fit.before.mean_iou if fit.before is not None else None,
        iou_after=fit.after.mean_iou,
        text=overlap_sentence(fit),
        warnings=list(fit.warnings),
    )
