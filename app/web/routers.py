"""All parts of the API, in the order in which OpenAPI lists them.

To add one, write a module in ``app/web/routes`` with a function that makes its router, and register it in ``ROUTERS``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from fastapi import APIRouter

from app.clips.export_queue import ExportQueue
from app.drive.alignment_scenes import AlignmentScenes
from app.drive.alignment_versions import AlignmentVersions
from app.drive.fitting import AlignmentFitting, TimeFitting
from app.drive.marks import Marks
from app.engine.engine import Engine
from app.fleet.desk import FleetDesk
from app.streaming.stream import Stream
from app.views.rerun.web import ViewerFiles
from app.web.metrics import Metrics
from app.web.routes.account import account_router
from app.web.routes.alignment.files import alignment_files_router
from app.web.routes.alignment.fit import alignment_fit_router
from app.web.routes.alignment.pairs import alignment_pairs_router
from app.web.routes.alignment.score import alignment_router
from app.web.routes.alignment.time import time_fit_router
from app.web.routes.alignment.versions import alignment_versions_router
from app.web.routes.clips import clips_router
from app.web.routes.drive import drive_router
from app.web.routes.fleet import fleet_router
from app.web.routes.health import health_router
from app.web.routes.help import help_router
from app.web.routes.labels.acts import label_acts_router
from app.web.routes.labels.close_ups import label_close_ups_router
from app.web.routes.labels.files import label_files_router
from app.web.routes.labels.reading import labels_router
from app.web.routes.labels.work import label_work_router
from app.web.routes.params import params_router
from app.web.routes.playback import playback_router
from app.web.routes.project import project_router
from app.web.routes.recording import recording_router
from app.web.routes.rerun import rerun_router
from app.web.routes.runs import runs_router


@dataclass(frozen=True, eq=False)
class Services:
    """The objects that the routes use."""

    engine: Engine
    """Plays, seeks and computes the shown frame."""
    stream: Stream
    """The state and frames that pages follow."""
    marks: Marks
    """Marks of all recordings on this machine."""
    exports: ExportQueue
    """Running and finished exports of clips."""
    viewer: ViewerFiles
    """The files of rerun's web viewer."""
    metrics: Metrics
    """For /metrics."""
    alignments: AlignmentVersions
    """Saved alignments."""
    scenes: AlignmentScenes
    """The frames used to score an alignment."""
    fitting: AlignmentFitting
    """The running alignment fit."""
    time_fitting: TimeFitting
    """The running fit of the time offsets."""
    fleet: FleetDesk | None
    """The tables of a fleet; None without one."""


ROUTERS: list[Callable[[Services], APIRouter]] = [
    lambda on: health_router(on.engine, on.metrics),
    lambda on: account_router(),
    lambda on: playback_router(on.engine, on.stream),
    lambda on: params_router(on.engine),
    lambda on: recording_router(on.engine),
    lambda on: drive_router(on.engine, on.engine.drives, on.marks),
    lambda on: runs_router(on.engine, on.engine.drives),
    lambda on: labels_router(on.engine.labels),
    lambda on: label_close_ups_router(on.engine.labels),
    lambda on: label_acts_router(on.engine.labels),
    lambda on: label_files_router(on.engine.labels),
    lambda on: label_work_router(on.engine.labels),
    lambda on: clips_router(on.engine, on.exports),
    lambda on: alignment_router(on.engine, on.scenes),
    lambda on: alignment_fit_router(on.engine, on.fitting),
    lambda on: time_fit_router(on.engine, on.time_fitting),
    lambda on: alignment_versions_router(on.engine, on.alignments, on.scenes, on.fitting),
    lambda on: alignment_files_router(on.engine),
    lambda on: alignment_pairs_router(on.engine),
    lambda on: project_router(on.engine),
    lambda on: fleet_router(on.fleet),
    lambda on: rerun_router(on.engine, on.viewer),
    lambda on: help_router(),
]
