"""/api/alignment/time: fit the time offsets of the sensors to the open recording. The fit changes nothing; the client
applies the result."""

from __future__ import annotations

from fastapi import APIRouter, HTTPException

from app.core.jobs import BackgroundJob
from app.drive.fitting import TimeFitting
from app.engine.engine import Engine
from app.web.refusals import open_recording, refusing
from app.web.routes.alignment.progress import FitProgress, progress_of
from app.web.routes.shapes.common import ApiModel, StatusJson
from pipeline.calibration.times import TimeOffsets


class TimeFitResult(ApiModel):
    """The time offsets that the recording determines."""

    changes: dict[str, float]
    """Parameters by dotted name, milliseconds, as PATCH /api/params takes them."""
    sigmas: dict[str, float]
    """Standard deviation of each value."""
    images: int
    """Images that were compared with the LiDAR."""
    speeds: int
    """Ego speeds that were compared with LiDAR odometry."""
    warnings: list[str]
    """What the drive cannot tell."""


class TimeFitJson(FitProgress):
    """The newest fit."""

    result: TimeFitResult | None
    """Null until it is done."""


def time_fit_router(engine: Engine, fitting: TimeFitting) -> APIRouter:
    """Routes for the time fit."""
    router = APIRouter(prefix="/api/alignment/time", tags=["alignment"])

    @router.post("", status_code=202)
    def begin() -> TimeFitJson:
        """Find the time offsets of camera and ego speed from the whole recording, in the background. 409 while a fit
        runs, 404 without a recording."""
        with refusing():
            recording = open_recording(engine.drives)
            return _json(fitting.begin(recording, engine.control.peek().params))

    @router.get("")
    def read() -> TimeFitJson:
        """Get the progress of the fit and its result."""
        return _json(fitting.job)

    @router.delete("")
    def cancel() -> StatusJson:
        """Cancel the fit, or forget its result."""
        if not fitting.cancel():
            raise HTTPException(404, "there is no fit")
        return StatusJson(status="removed")

    return router


def _json(job: BackgroundJob[TimeOffsets] | None) -> TimeFitJson:
    found = job.result if job is not None else None
    return TimeFitJson(**vars(progress_of(job)), result=_result(found) if found is not None else None)


def _result(found: TimeOffsets) -> TimeFitResult:
    return TimeFitResult(
        changes=found.changes,
        sigmas=found.sigmas,
        images=found.images,
        speeds=found.speeds,
        warnings=list(found.warnings),
    )
