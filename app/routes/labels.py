"""/api/labels: what people say is true of the open recording, read."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, HTTPException, Query, Response
from fastapi.responses import JSONResponse

from app.labels.answers import changes_json, history_json, track_json, window_json
from app.labels.desk import LabelDesk
from app.labels.values import ItemKind
from app.routes.label_shapes import HistoryJson, LabelChanges, WholeTrack, Window
from app.routes.refusals import refusing

MOST_FRAMES = 200
_LARGEST = 2**62


def labels_router(desk: LabelDesk) -> APIRouter:
    """Routes that read labels."""
    router = APIRouter(prefix="/api/labels", tags=["labels"])

    @router.get("", responses={200: {"model": LabelChanges}})
    def changes(since: int = Query(0, ge=0, le=_LARGEST)) -> Response:
        """What changed after act ``since``; 0 for everything. Ask again whenever ``state.labels.revision`` is
        another."""
        with refusing():
            labels = desk.labels
            return JSONResponse(changes_json(labels.info, labels.changes(since)))

    @router.get("/frames", responses={200: {"model": Window}})
    def frames(first: Annotated[int, Query(ge=0)], last: Annotated[int, Query(ge=0)]) -> Response:
        """Where tracks are, frame by frame; at most 200 frames."""
        if not first <= last < first + MOST_FRAMES:
            raise HTTPException(422, f"first to last: at least one frame, and {MOST_FRAMES} at most")
        with refusing():
            return JSONResponse(window_json(desk.labels, first, last))

    @router.get("/tracks/{number}", responses={200: {"model": WholeTrack}})
    def track(number: int) -> Response:
        """A whole track."""
        with refusing():
            return JSONResponse(track_json(desk.labels.track(number)))

    @router.get("/history", responses={200: {"model": list[HistoryJson]}})
    def history(kind: ItemKind, number: Annotated[int, Query(alias="id", ge=0, le=_LARGEST)]) -> Response:
        """The acts that changed a label, newest first, at most 200."""
        with refusing():
            return JSONResponse([history_json(entry) for entry in desk.labels.log.history(kind, number)])

    return router
