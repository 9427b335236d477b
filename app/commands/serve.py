"""`cipv serve` and `cipv demo`: open the dashboard."""

from __future__ import annotations

import os
import webbrowser
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from app.commands.support.arguments import option
from app.commands.support.first_use_tuning import FirstUseTuning
from app.commands.support.open_with_progress import opened
from app.commands.support.options import PipelineOptions, SourceName, planned
from app.core.detection_cache import DetectionCache
from app.core.kept_detections import KeptDetections
from app.core.server_address import DEFAULT_PORT
from app.core.session_folder import SESSIONS
from app.core.shared_view_state import SharedViewState
from app.core.stop_signals import skip_teardown
from app.engine.engine import Engine
from app.labels import URL_VARIABLE
from app.labels.project_classes import project_classes
from app.labels.service.desk import LabelDesk
from app.views.lazy_scene import LateScene
from app.web.serve import serve
from pipeline.common.errors import BadInput
from pipeline.common.progress import Progress
from pipeline.detection import detector_for, lanes_for
from pipeline.inference.model_registry import store
from pipeline.lanes.open_detector import LaneDetector
from pipeline.sources import open_any
from pipeline.sources.along_route import along_route
from pipeline.types.source import AnySource
from pipeline.vision.detector import Detector

if TYPE_CHECKING:
    from app.fleet.desk import FleetDesk
    from app.labels.store.database import Database
    from app.views.rerun.feed import RerunFeed


@dataclass(frozen=True)
class ServerOptions:
    """Where the dashboard listens."""

    host: Annotated[str, tyro.conf.arg(metavar="ADDRESS")] = "127.0.0.1"
    """Address to listen on. With 0.0.0.0 other machines can connect, using the link with a token printed at startup"""
    port: Annotated[int | None, option("PORT")] = None
    """Port to listen on; by default the first free one from 8420"""
    allow_host: Annotated[tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="NAME")] = ()
    """Another host name of this server, e.g. behind a proxy; requires the token"""
    token: bool = False
    """Require a token on this machine too; without it, every local user has full access"""
    tls_cert: Annotated[Path | None, option("PEM")] = None
    """Certificate to serve HTTPS with; needs --tls-key"""
    tls_key: Annotated[Path | None, option("PEM")] = None
    """Private key of the certificate"""
    browser: bool = False
    """Open a browser once the dashboard is ready"""
    rerun: Annotated[str | None, option("URL")] = None
    """Also stream the shown frames to a running rerun viewer, e.g. rerun+http://127.0.0.1:9876/proxy"""
    labels: Annotated[str | None, option("URL")] = None
    """Label database, e.g. postgresql://person@host/cipv; default: $CIPV_LABELS_URL, then sessions/labels.db"""

    fleet: Annotated[str | None, option("DIR")] = None
    """Folder of `cipv batch` that the Fleet view searches, or its address in a store"""

    def fleet_desk(self) -> FleetDesk | None:
        """The tables of ``--fleet``. BadInput if there are none."""
        if self.fleet is None:
            return None
        from app.fleet.desk import FleetDesk
        from app.fleet.extra import need_extra

        need_extra()
        return FleetDesk(self.fleet)

    def label_desk(self) -> LabelDesk:
        """The label database. DatabaseError if a database that was named cannot be opened. The local database is opened
        after the first image is shown; an error in it appears in the dashboard."""
        if self.labels or os.environ.get(URL_VARIABLE):
            return LabelDesk(_open_labels(self.labels), classes=project_classes())
        return LabelDesk(open_later=lambda: _open_labels(None), classes=project_classes())

    def serve(self, engine: Engine) -> int:
        """Serve the dashboard until Ctrl-C. Returns the exit status."""
        if (self.tls_cert is None) != (self.tls_key is None):
            raise BadInput("--tls-cert and --tls-key belong together")
        tls = (self.tls_cert, self.tls_key) if self.tls_cert is not None and self.tls_key is not None else None
        on_ready: Callable[[str], None] | None = webbrowser.open if self.browser else None  # type: ignore[assignment]
        looks, fleet = SharedViewState(), self.fleet_desk()
        with ExitStack() as stack:
            scene = stack.enter_context(LateScene(engine, looks))
            if self.rerun is not None:
                stack.enter_context(_rerun_feed(engine, self.rerun))
            serve(
                engine,
                host=self.host,
                port=DEFAULT_PORT if self.port is None else self.port,
                strict_port=self.port is not None,
                hosts=self.allow_host,
                viser_port=scene.port,
                looks=looks,
                on_ready=on_ready,
                always_token=self.token,
                tls=tls,
                ends_process=True,
                fleet=fleet,
            )
        skip_teardown(0)
        return 0


def _open_labels(url: str | None) -> Database:
    from app.labels.store.database import open_database  # imports SQLAlchemy, too slow before the first image

    return open_database(url)


def _rerun_feed(engine: Engine, url: str) -> RerunFeed:
    from app.views.rerun.feed import RerunFeed  # takes half a second to import

    return RerunFeed(engine, url)


@dataclass(frozen=True)
class Serve:
    """Open the dashboard on a recording.

    Example: cipv serve astyx:PATH --port 8420
    """

    source: SourceName
    server: ServerOptions = field(default_factory=ServerOptions)
    pipeline: PipelineOptions = field(default_factory=PipelineOptions)
    sensors: Literal["lidar", "camera", "both"] = "both"
    """Ablation: run as if the car had this sensor only"""
    rings: int = 16
    """KITTI: LiDAR channels to keep: 16, like a VLP-16, or 64 for all"""
    route: Annotated[Path | None, option("FILE")] = None
    """Planned route, on which GNSS locates the car: CSV, GPX, an NMEA log or an earlier session"""

    def __call__(self) -> int:
        with FirstUseTuning() as tuning:
            return self.server.serve(self.engine(tuning.used))

    def engine(self, on_network: Callable[[object], object] = lambda _: None) -> Engine:
        """The engine for the source, not started yet. BadInput if the source cannot be opened or there is no place for
        networks. on_network: called with every detector that it opens."""
        params = self.pipeline.parameters()
        store()  # like a typo below, reported in the terminal
        route = planned(self.route)
        # opened here, so that a typo is reported in the terminal; a large recording is not opened twice
        first = {self.source: opened(self.source, self.rings)}

        def open_source(uri: str, /, *, progress: Progress) -> AnySource:
            source = first.pop(uri, None)
            if source is None:
                source = open_any(uri, rings=self.rings, progress=progress)
            return along_route(source, route)

        def open_boxes(source: AnySource) -> Detector:
            detector = detector_for(source, self.pipeline.detector)
            on_network(detector)
            return detector

        def open_lanes(source: AnySource) -> LaneDetector | None:
            detector = lanes_for(source, self.pipeline.lanes)
            on_network(detector)
            return detector

        return Engine(
            open_source,
            open_boxes,
            params,
            preset=self.pipeline.preset,
            uri=self.source,
            sensors=self.sensors,
            playing=True,
            whole_drives=True,
            open_lanes=open_lanes,
            lanes_every=self.pipeline.every(),
            far_view_px=self.pipeline.far_px(),
            labels=self.server.label_desk(),
            detections=DetectionCache(kept=KeptDetections(SESSIONS / "detections.db")),
        )


@dataclass(frozen=True)
class Demo:
    """Open the dashboard on a simulated drive. Needs no data and no sensors.

    Example: cipv demo
    """

    server: ServerOptions = field(default_factory=ServerOptions)
    pipeline: PipelineOptions = field(default_factory=PipelineOptions)

    def __call__(self) -> int:
        return Serve("sim:straight", self.server, self.pipeline)()
