"""/api/labels/tracks/…: close-ups of a track, for review."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Response

from app.labels.acts.request_fields import Id, Index
from app.labels.errors import NoSuchLabel
from app.labels.service.desk import LabelDesk
from app.labels.service.filmstrip import close_up_jpeg, filmstrip
from app.web.refusals import refusing
from app.web.routes.labels.shapes import StillJson
from pipeline.labels.model import LabelTrack


def label_close_ups_router(desk: LabelDesk) -> APIRouter:
    """Routes that read frames, which takes some milliseconds per frame."""
    router = APIRouter(prefix="/api/labels/tracks", tags=["labels"])

    @router.get("/{number}/filmstrip")
    def strip(number: Id) -> list[StillJson]:
        """List the frames of a track to look at: its keyframes, and those in which it fits its points worst. Empty for
        a track that is not, or no longer, there."""
        with refusing():
            track = _track(desk, number)
            stills = filmstrip(track, desk.recording) if track is not None else []
        return [
            StillJson(
                frame=each.frame,
                why=each.why,
                inside=each.fit.inside if each.fit is not None else None,
                beside=each.fit.beside if each.fit is not None else None,
            )
            for each in stills
        ]

    @router.get("/{number}/close_up", response_class=Response, responses={200: {"content": {"image/jpeg": {}}}})
    def close_up(number: Id, frame: Annotated[Index, Query()]) -> Response:
        """Get a close-up of a track in a frame: of the image, and of its points from above, the side and behind. 204
        when the track has no sighting there, for example because somebody else just removed it."""
        with refusing():
            track = _track(desk, number)
            jpeg = close_up_jpeg(track, frame, desk.recording, desk.params) if track is not None else None
        return Response(status_code=204) if jpeg is None else Response(jpeg, media_type="image/jpeg")

    return router


def _track(desk: LabelDesk, number: int) -> LabelTrack | None:
    try:
        value = desk.labels.track(number).value
    except NoSuchLabel:
        return None
    assert isinstance(value, LabelTrack)
    return value
