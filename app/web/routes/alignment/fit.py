"""/api/alignment/fit: fit the alignment to the open recording. The fit changes nothing; the client applies the
result."""

from __future__ import annotations

from typing import Annotated

import yaml
from fastapi import APIRouter, HTTPException, Response
from pydantic import ConfigDict, Field

from app.core.jobs import BackgroundJob
from app.drive.fitting import AlignmentFitting
from app.engine.engine import Engine
from app.web.refusals import open_recording, refusing
from app.web.routes.alignment.progress import FitProgress, progress_of
from app.web.routes.shapes.common import ApiModel, StatusJson, file_of
from pipeline.calibration.alignment.fit import AlignmentFit, overlap_sentence
from pipeline.calibration.alignment.models import ModelName


class FitChoice(ApiModel):
    """What to fit."""

    model_config = ConfigDict(extra="forbid")

    model: Annotated[ModelName, Field(description="angular needs no calibration")] = "pinhole"
    offset: bool = Field(False, description="pinhole: also fit the camera's lateral and vertical position")


class FitResult(ApiModel):
    """The outcome of a fit."""

    changes: dict[str, float | str]
    """Parameters by dotted name, as PATCH /api/params takes them."""
    sigmas: dict[str, float]
    """Standard deviation of each value."""
    frames: int
    """That were fitted to."""
    pairs: int
    """Boxes paired with a cluster."""
    iou_before: float | None
    """Mean overlap of boxes and projected clusters with the present alignment; null without one."""
    iou_after: float
    """The same with the fit, of held-out frames if the drive is long enough."""
    text: str
    """The outcome in a sentence."""
    warnings: list[str]
    """What the drive cannot tell."""


class FitJson(FitProgress):
    """The newest fit."""

    result: FitResult | None
    """Null until it is done."""


def alignment_fit_router(engine: Engine, fitting: AlignmentFitting) -> APIRouter:
    """Routes for the alignment fit."""
    router = APIRouter(prefix="/api/alignment", tags=["alignment"])

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
        section = {"alignment": job.result.section}
        headers = {"content-disposition": 'attachment; filename="cipv-alignment.yaml"'}
        return Response(yaml.safe_dump(section, sort_keys=False), media_type="application/yaml", headers=headers)

    return router


def _json(job: BackgroundJob[AlignmentFit] | None) -> FitJson:
    found = job.result if job is not None else None
    return FitJson(**vars(progress_of(job)), result=_result(found) if found is not None else None)


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
