"""/api: state, result of the shown frame, playback and the source."""

from __future__ import annotations

from fastapi import APIRouter, HTTPException, WebSocket
from fastapi.responses import JSONResponse
from pydantic import ConfigDict, Field

from app.engine.engine import Engine
from app.streaming.stream import Stream
from app.web.routes.shapes.common import ApiModel, StatusJson
from app.web.routes.shapes.result import ResultJson
from app.web.routes.shapes.state import SourceJson, SourcesJson, StateJson
from app.web.source_catalog import catalog
from pipeline.types.result_json import to_json


class PlaybackChange(ApiModel):
    """What to change; absent fields stay as they are."""

    model_config = ConfigDict(extra="forbid")

    playing: bool | None = None
    """False pauses."""
    seek: int | None = Field(None, ge=0, description="Frame index; clamped to the last frame")
    step: int | None = Field(None, ge=-1000, le=1000)
    """Pauses and moves by this many frames."""
    speed: float | None = Field(None, ge=0.1, le=10.0, description="1 is real time")
    loop: bool | None = None
    """Whether playback starts again at the end."""


class SourceChoice(ApiModel):
    """What to open: a path or a URI."""

    uri: str = Field(min_length=1, max_length=4096, examples=["sim:straight"])
    """A path, or a scheme and what follows it."""


def playback_router(engine: Engine, stream: Stream) -> APIRouter:
    """Routes for the engine's playback."""
    router = APIRouter(prefix="/api", tags=["playback"])

    @router.get("/state", responses={200: {"model": StateJson}})
    def state() -> JSONResponse:
        """Get the state: source, position, playback, notices."""
        return JSONResponse(engine.snapshot.state_json())

    @router.get("/result", responses={200: {"model": ResultJson}})
    def result() -> JSONResponse:
        """Get the result of the shown frame. 404 before there is one."""
        processed = engine.snapshot.processed
        if processed is None:
            raise HTTPException(404, "no frame is shown yet")
        return JSONResponse(to_json(processed.result))

    @router.post("/playback", status_code=202)
    def playback(body: PlaybackChange) -> StatusJson:
        """Control playback. The answer arrives with the stream."""
        standing = body.model_dump(include={"playing", "speed", "loop"}, exclude_none=True)
        if standing:
            engine.control.change(**standing)
        if body.seek is not None:
            engine.control.seek(body.seek)
        if body.step is not None:
            engine.control.step(body.step)
        return StatusJson(status="accepted")

    @router.get("/sources")
    def sources() -> SourcesJson:
        """List the sources that the dashboard offers, and the open one."""
        offered = [SourceJson(uri=uri, title=title) for uri, title in catalog()]
        return SourcesJson(open=engine.snapshot.uri, sources=offered)

    @router.post("/source", status_code=202)
    def open_source(body: SourceChoice) -> StatusJson:
        """Open a source. If it cannot be opened, the present one stays open and a notice says why."""
        engine.control.change(uri=body.uri.strip(), target=None, steps=0)
        return StatusJson(status="accepted")

    @router.websocket("/stream")
    async def stream_frames(socket: WebSocket) -> None:
        await stream.serve(socket)

    return router
