"""/api/clip and /api/jobs: export a part of the drive as a file, in the background."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, HTTPException
from fastapi.responses import FileResponse
from pydantic import Field

from app.clips.clip import Clip
from app.clips.export_queue import ExportQueue, ExportStatus
from app.clips.exports import EXPORTERS, submit
from app.core.jobs import JobState
from app.engine.engine import Engine
from app.web.refusals import open_recording, refusing
from app.web.routes.shapes.common import ApiModel, StatusJson, file_of
from app.web.routes.shapes.names import one_of

ClipKind = Annotated[str, *one_of(EXPORTERS)]


class ClipChoice(ApiModel):
    """What to export."""

    first: int = Field(ge=0)
    """First frame."""
    last: int = Field(ge=0)
    """Last frame, included."""
    kind: ClipKind
    """Of file."""


class JobJson(ApiModel):
    """An export."""

    id: str
    """As its URL has it."""
    kind: str
    """Of file."""
    first: int
    """First frame of the clip."""
    last: int
    """Last frame, included."""
    state: JobState
    """``done``, ``failed`` and ``cancelled`` are final."""
    progress: float
    """0–1."""
    note: str
    """Why it failed; empty otherwise."""
    file: str | None
    """The download's name; null until it is done."""
    bytes: int | None
    """The download's size; null until it is done."""


class JobList(ApiModel):
    """Exports, the oldest first."""

    jobs: list[JobJson]
    """Those that ended are listed too."""


def clips_router(engine: Engine, jobs: ExportQueue) -> APIRouter:
    """Routes for exports."""
    router = APIRouter(prefix="/api", tags=["clips"])

    @router.post("/clip", status_code=202)
    def export(body: ClipChoice) -> JobJson:
        """Export a clip with the present parameters. Runs in the background; 409 for an invalid range."""
        with refusing():
            return _json(submit(jobs, clip_of(engine, body.first, body.last), body.kind))

    @router.get("/jobs")
    def every() -> JobList:
        """List exports, oldest first."""
        return JobList(jobs=[_json(job) for job in jobs.all()])

    @router.get("/jobs/{number}")
    def one(number: str) -> JobJson:
        """Get the progress of an export."""
        job = jobs.get(number)
        if job is None:
            raise HTTPException(404, "export not found")
        return _json(job)

    @router.delete("/jobs/{number}")
    def cancel(number: str) -> StatusJson:
        """Cancel an export, or delete a finished one."""
        if not jobs.cancel(number):
            raise HTTPException(404, "export not found")
        return StatusJson(status="removed")

    @router.get("/jobs/{number}/file", response_class=FileResponse, responses=file_of("application/octet-stream"))
    def download(number: str) -> FileResponse:
        """Download the file of a finished export."""
        job, path = jobs.get(number), jobs.path(number)
        if job is None or path is None:
            raise HTTPException(404, "file not found")
        return FileResponse(path, filename=job.file, media_type="application/octet-stream")

    return router


def clip_of(engine: Engine, first: int, last: int) -> Clip:
    """A part of the open recording with the current parameters."""
    shown = engine.snapshot
    recording = open_recording(engine.drives)
    return Clip(recording, engine.control.peek().params, first, last, engine.drives.turn, shown.title, shown.rate_hz)


def _json(job: ExportStatus) -> JobJson:
    return JobJson(**vars(job))
