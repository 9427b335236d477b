"""The web server: page, API, stream and 3D view on one port."""

from __future__ import annotations

import asyncio
import socket
import ssl
import threading
from collections.abc import AsyncIterator, Callable, Iterable, Iterator
from contextlib import asynccontextmanager, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import uvicorn
from fastapi import Depends, FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, Response

from app.clips.export_queue import ExportQueue
from app.core.shared_view_state import SharedViewState
from app.drive.alignment_scenes import AlignmentScenes
from app.drive.alignment_versions import AlignmentVersions
from app.drive.fitting import AlignmentFitting, TimeFitting
from app.drive.marks import Marks
from app.engine.engine import Engine
from app.fleet.desk import FleetDesk
from app.streaming.stream import Stream
from app.views.colors import palette_css
from app.views.rerun.web import ViewerFiles
from app.views.viser.proxy import viser_router
from app.web.api_description import REFUSALS, described_by, titled
from app.web.guards.access import Access, Guard
from app.web.guards.audit import Audit
from app.web.guards.connections import LimitedProtocol, TlsHandshake
from app.web.guards.limits import LARGEST_FILE, LARGEST_MESSAGE, BodyLimit
from app.web.guards.log_limit import limit_logs
from app.web.guards.own_name import own_name
from app.web.guards.quotas import RoleQuota
from app.web.guards.tokens import Tokens
from app.web.metrics import Metrics
from app.web.page_files import PageFiles
from app.web.routers import ROUTERS, Services
from app.web.routes.labels.files import IMPORT
from pipeline.common.files.user_files import Overloaded

_BACKLOG = 100
"""Connections queued by the system until they are accepted. When file descriptors run out, Python 3.11 tries to accept
this many at once."""


def create_app(
    engine: Engine,
    viser_port: Callable[[], int | None] = lambda: None,
    hosts: Iterable[str] = (),
    marks: Marks | None = None,
    looks: SharedViewState | None = None,
    tokens: Tokens | None = None,
    audit: Path | None = None,
    alignments: AlignmentVersions | None = None,
    fleet: FleetDesk | None = None,
) -> FastAPI:
    """The application for a running engine. ``hosts``: names other than loopback by which it may be addressed.
    ``marks``: storage of marks; None discards them at the end. ``looks``: receives the view state of the pages.
    ``tokens``: tokens that clients must have; None if only this machine can connect. ``audit``: the audit log; None for
    none. ``alignments``: saved alignments; None discards them at the end. ``fleet``: the tables that the Fleet view
    searches."""
    access = Access(hosts)
    stream = Stream(looks, engine.page_frames, lambda: engine.control.change(playing=False))
    exports, viewer, metrics = ExportQueue(engine.drives.changed), ViewerFiles(), Metrics(engine, stream)
    services = Services(
        engine,
        stream,
        marks or Marks(),
        exports,
        viewer,
        metrics,
        alignments or AlignmentVersions(),
        AlignmentScenes(),
        AlignmentFitting(engine.drives),
        TimeFitting(engine.drives),
        fleet,
    )

    @asynccontextmanager
    async def listening(_: FastAPI) -> AsyncIterator[None]:
        stream.publish(engine.snapshot)
        ends = [engine.listen(stream.publish), engine.listen(metrics.saw)]
        yield
        for end in ends:
            end()
        stream.close()
        if fleet is not None:
            fleet.close()
        await asyncio.to_thread(exports.close)
        viewer.close()

    app = FastAPI(
        title="CIPV Studio",
        version="1",
        openapi_url=None,
        lifespan=listening,
        responses=REFUSALS,
        dependencies=[Depends(own_name)],
    )
    app.openapi = titled(app)  # type: ignore[method-assign]
    app.add_middleware(BodyLimit, files={IMPORT: LARGEST_FILE})
    if audit is not None:
        app.add_middleware(Audit, file=audit)
    app.add_middleware(RoleQuota)
    app.add_middleware(Guard, access=access, tokens=tokens)  # the last middleware added runs first
    app.add_exception_handler(RequestValidationError, _one_sentence)
    app.add_exception_handler(Overloaded, _overloaded)
    for make_router in ROUTERS:
        app.include_router(make_router(services))
    app.include_router(viser_router(viser_port, access.allowed))
    app.add_api_route("/openapi.json", described_by(app), methods=["GET", "HEAD"], include_in_schema=False)
    app.add_api_route("/palette.css", _palette, include_in_schema=False)
    app.mount("/", PageFiles(engine.drives.turn.asked), name="pages")
    return app


class Server(uvicorn.Server):
    """Prints its address as soon as it responds, and ends shortly after ``asked`` is set. Compression is off, because
    compressing the stream would cost more than sending it.

    behind_proxy: a proxy on this machine may say in headers who its client is. Otherwise any program here could."""

    def __init__(
        self,
        app: FastAPI,
        address: str,
        on_ready: Callable[[str], None] | None,
        tokens: Tokens | None = None,
        asked: threading.Event | None = None,
        tls: ssl.SSLContext | None = None,
        behind_proxy: bool = False,
    ) -> None:
        def shaking_hands(**given: Any) -> asyncio.Protocol:
            return LimitedProtocol(**given) if tls is None else TlsHandshake(tls, partial(LimitedProtocol, **given))

        super().__init__(
            uvicorn.Config(
                app,
                http=shaking_hands,  # type: ignore[arg-type]
                log_level="warning",
                access_log=False,
                ws_per_message_deflate=False,
                ws_max_size=LARGEST_MESSAGE,
                timeout_graceful_shutdown=1,
                proxy_headers=behind_proxy,
                backlog=_BACKLOG,
            )
        )
        limit_logs()
        self._address = address
        self._tokens = tokens
        self._on_ready = on_ready
        self._asked = asked or threading.Event()

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """The program handles signals itself: uvicorn would raise SIGTERM again at the end, which would kill the
        program before its recording is closed."""
        yield

    async def on_tick(self, counter: int) -> bool:
        return self._asked.is_set() or await super().on_tick(counter)

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        if self.started:
            print(self._address, flush=True)
            link = self._address
            if self._tokens is not None:
                link = f"{self._address}/?token={self._tokens.person}"
                print(f"full access:        {self._address}/?token={self._tokens.shown('person')}", flush=True)
                print(f"in-vehicle display: {self._address}/drive/?token={self._tokens.shown('display')}", flush=True)
            if self._on_ready is not None:
                await asyncio.to_thread(self._on_ready, link)


def _overloaded(_: Request, error: Exception) -> Response:
    return JSONResponse({"detail": str(error)}, 503, {"retry-after": "1"})


def _palette() -> Response:
    """The palette of all views as CSS custom properties for both themes. --image-… are the shades for drawing over a
    photograph, the same in both."""
    dark, light = palette_css("dark"), palette_css("light")
    text = (
        f":root {{\n{dark}\n{dark.replace('--cipv-', '--image-')}\n}}\n"
        f"@media (prefers-color-scheme: light) {{ :root:not([data-theme=dark]) {{\n{light}\n}} }}\n"
        f":root[data-theme=light] {{\n{light}\n}}\n"
    )
    return Response(text, media_type="text/css", headers={"cache-control": "no-cache"})


async def _one_sentence(_: Request, error: Exception) -> JSONResponse:
    """422 with the first validation error: its position and what is wrong."""
    assert isinstance(error, RequestValidationError)
    first = error.errors()[0]
    if first["type"] == "json_invalid":
        return _not_understood(f"the body is not valid JSON: {first['ctx']['error']}")
    if first["loc"] == ("body",) and first["type"] != "missing":
        return _not_understood("the body must be a JSON object, sent as application/json")
    place = ".".join(str(part) for part in first["loc"] if part != "body")
    return _not_understood(f"{place}: {first['msg']}" if place else first["msg"])


def _not_understood(detail: str) -> JSONResponse:
    return JSONResponse({"detail": detail}, status_code=422)
