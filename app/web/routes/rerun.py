"""/rerun and /api/rerun: the drive in rerun's web viewer, all files of which are served locally."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from urllib.parse import urlencode

from fastapi import APIRouter, HTTPException, Query, Request
from fastapi.responses import FileResponse
from starlette.background import BackgroundTask

from app.clips.exports import write_clip
from app.engine.engine import Engine
from app.views.rerun.start_options import RerunStartOptions
from app.views.rerun.web import FILES, ViewerFiles
from app.web.guards.quotas import while_waited_for
from app.web.refusals import open_recording, refusing
from app.web.routes.clips import clip_of
from app.web.routes.shapes.common import ApiModel, file_of
from pipeline.common.progress import Progress

AROUND = 50
"""Frames before and after the shown one that are opened by default."""
MOST_FRAMES = 600
_AT_ONCE = 2
"""Maximum replays written at a time; further requests wait, and are dropped when the client disconnects."""

_POLICY = (
    "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; img-src 'self' blob: "
    "data:; font-src 'self' data:; connect-src 'self' blob: data:; worker-src 'self' blob:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'self'"
)
"""What the viewer needs: WebAssembly, and styles that it sets itself. It may connect only to this server."""
_TYPES = {"re_viewer.js": "text/javascript", "re_viewer_bg.wasm": "application/wasm"}
_PAGE = Path(__file__).resolve().parents[3] / "static" / "rerun" / "index.html"


class Address(ApiModel):
    """Where this drive is open in the viewer."""

    url: str
    """Of the viewer's page, with the drive in it."""
    first: int
    """First frame that it shows."""
    last: int
    """Last frame, included."""


def rerun_router(engine: Engine, viewer: ViewerFiles) -> APIRouter:
    """Routes for the viewer and its content."""
    router = APIRouter(tags=["rerun"])
    threads = ThreadPoolExecutor(_AT_ONCE, "cipv-rerun")

    @router.get("/api/rerun/open")
    def address(
        first: int | None = Query(None, ge=0, description="First frame; default: the shown one"),
        compact: bool = Query(False, description="Layout for a narrow pane"),
    ) -> Address:
        """Get the address of the drive in the web viewer, paused at the shown frame. The clip begins there, since a
        recording cannot set the viewer's cursor. 409 when the web viewer is not available."""
        with refusing():
            open_recording(engine.drives)
            for name in FILES:
                viewer.path(name)
        begin, end = _span(engine, engine.snapshot.index if first is None else first, None)
        query = urlencode({"first": begin, "last": end, "paused": 1, "compact": int(compact)})
        return Address(url=f"/rerun/?{query}", first=begin, last=end)

    @router.get("/api/rerun.rrd", response_class=FileResponse, responses=file_of("application/octet-stream"))
    async def replay(
        request: Request,
        first: int | None = Query(None, ge=0),
        last: int | None = Query(None, ge=0),
        paused: bool = Query(False, description="Start paused"),
        compact: bool = Query(False, description="Layout for a narrow pane"),
    ) -> FileResponse:
        """Download a clip as a rerun recording, with the present parameters. By default the frames around the shown
        one, at most 600."""
        span = _span(engine, first, last)
        path = await while_waited_for(
            request, threads, lambda progress: _written(engine, span, RerunStartOptions(paused, compact), progress)
        )
        name = f"drive-{span[0]:06d}-{span[1]:06d}.rrd"
        gone = BackgroundTask(path.unlink, missing_ok=True)
        return FileResponse(path, filename=name, media_type="application/octet-stream", background=gone)

    def file(name: str) -> Callable[[], FileResponse]:
        def send() -> FileResponse:
            with refusing():
                path = viewer.path(name)
            return FileResponse(path, media_type=_TYPES[name], headers={"cache-control": "no-cache"})

        return send

    for name in FILES:
        router.add_api_route(f"/rerun/{name}", file(name), include_in_schema=False, response_class=FileResponse)

    @router.get("/rerun/", response_class=FileResponse, include_in_schema=False)
    def page() -> FileResponse:
        """The page that contains the viewer."""
        headers = {"content-security-policy": _POLICY, "cache-control": "no-cache"}
        return FileResponse(_PAGE, headers=headers)

    return router


def _written(engine: Engine, span: tuple[int, int], start: RerunStartOptions, progress: Progress) -> Path:
    """A new file; it is removed if it cannot be written or the client disconnects."""
    progress(0, 1)
    with refusing(), tempfile.NamedTemporaryFile(prefix="cipv-", suffix=".rrd", delete=False) as file:
        path = Path(file.name)
        try:
            write_clip(replace(clip_of(engine, *span), start=start), "rrd", path, progress)
        except BaseException:
            path.unlink(missing_ok=True)
            raise
    return path


def _span(engine: Engine, first: int | None, last: int | None) -> tuple[int, int]:
    """The frames to open; 422 for an invalid range."""
    shown = engine.snapshot
    end = max(shown.count - 1, 0)
    start = max(0, shown.index - AROUND) if first is None else first
    stop = min(end, start + 2 * AROUND if last is None else last)
    if start > stop:
        raise HTTPException(422, f"first: the recording has {shown.count} frames")
    return start, min(stop, start + MOST_FRAMES - 1)
