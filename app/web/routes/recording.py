"""/api/recording: record the shown frames to a session."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fastapi import APIRouter

from app.engine.engine import Engine
from app.web.refusals import refusing
from app.web.routes.shapes.common import ApiModel
from app.web.routes.shapes.state import RecordingJson

if TYPE_CHECKING:
    from pipeline.recording.recording_state import RecordingState


class RecordingChoice(ApiModel):
    """Start or stop recording."""

    on: bool
    """True starts."""


def recording_router(engine: Engine) -> APIRouter:
    """Routes for the engine's recording."""
    router = APIRouter(prefix="/api", tags=["recording"])

    @router.get("/recording")
    def read() -> RecordingJson | None:
        """Get the state of the recording. Null while nothing is recorded. The same as ``state.recording`` in the stream
        and in /api/state."""
        return _json(engine.recorder.state)

    @router.post("/recording")
    def record(body: RecordingChoice) -> RecordingJson | None:
        """Begin or end recording. Beginning answers with the new recording (with the present one, where one goes on
        already), ending with the finished one, null where there was none. The file is a session: open it with
        POST /api/source {"uri": file}. Marks made meanwhile (POST /api/marks) are in it. 409 with a sentence when
        nothing is open or no file can be made. Opening another source ends the recording."""
        with refusing():
            state = engine.recorder.start(engine.source, engine.detectors) if body.on else engine.recorder.stop()
        engine.control.change()
        return _json(state)

    return router


def _json(state: RecordingState | None) -> RecordingJson | None:
    return RecordingJson(**state.to_json()) if state is not None else None
