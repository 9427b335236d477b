"""/api: state, result of the shown frame, playback and the source."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, HTTPException, WebSocket
from pydantic import BaseModel, ConfigDict, Field

from app.catalog import catalog
from app.engine import Engine
from app.stream import Stream
from pipeline.results import to_json


class PlaybackChange(BaseModel):
    """What to change; absent fields stay as they are. ``step`` pauses and moves by that many frames."""

    model_config = ConfigDict(extra="forbid")

    playing: bool | None = None
    seek: int | None = Field(None, ge=0, description="Frame index; beyond the end is the last frame")
    step: int | None = Field(None, ge=-1000, le=1000)
    speed: float | None = Field(None, ge=0.1, le=10.0, description="1 is real time")
    loop: bool | None = None


class SourceChoice(BaseModel):
    uri: str = Field(min_length=1, max_length=4096, examples=["sim:straight"])


def playback_router(engine: Engine, stream: Stream) -> APIRouter:
    """Routes over the engine's playback."""
    router = APIRouter(prefix="/api", tags=["playback"])

    @router.get("/healthz")
    def healthz() -> dict[str, Any]:
        """Answers while the server lives; ``engine`` is false when its worker does not."""
        return {"status": "ok", "engine": engine.alive}

    @router.get("/state")
    def state() -> dict[str, Any]:
        """Source, position, playback, notices."""
        return engine.snapshot.state_json()

    @router.get("/result")
    def result() -> dict[str, Any]:
        """The shown frame's result; 404 before there is one."""
        tick = engine.snapshot.tick
        if tick is None:
            raise HTTPException(404, "no frame is shown yet")
        return to_json(tick.result)

    @router.post("/playback", status_code=202)
    def playback(body: PlaybackChange) -> dict[str, str]:
        """Ask for a change; the stream brings what comes of it."""
        standing = body.model_dump(include={"playing", "speed", "loop"}, exclude_none=True)
        if standing:
            engine.control.change(**standing)
        if body.seek is not None:
            engine.control.seek(body.seek)
        if body.step is not None:
            engine.control.step(body.step)
        return {"status": "accepted"}

    @router.get("/sources")
    def sources() -> dict[str, Any]:
        """What can be opened without typing, and what is open."""
        return {"open": engine.snapshot.uri, "sources": [{"uri": uri, "title": title} for uri, title in catalog()]}

    @router.post("/source", status_code=202)
    def open_source(body: SourceChoice) -> dict[str, str]:
        """Open another recording. One that cannot be opened leaves the old one, with a notice."""
        engine.control.change(uri=body.uri.strip(), target=None, steps=0)
        return {"status": "accepted"}

    @router.websocket("/stream")
    async def stream_frames(socket: WebSocket) -> None:
        await stream.serve(socket)

    return router
