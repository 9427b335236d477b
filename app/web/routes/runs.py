"""/api/runs: runs of the drive with other parameters. Save, name, compare, use, delete."""

from __future__ import annotations

import logging
from typing import Any, Literal

from fastapi import APIRouter, Query, Response
from pydantic import Field

from app.drive.background_runs import BackgroundRuns, Phase
from app.drive.compare import compare
from app.drive.frame_rows import Row
from app.drive.full_run import DriveRun
from app.drive.open_recording import OpenRecording
from app.drive.run_registry import LONGEST_NAME
from app.engine.engine import Engine
from app.labels.errors import DatabaseError
from app.labels.service.desk import LabelDesk
from app.web.refusals import open_recording, refusing
from app.web.routes.drive import Columns, columns_of, current
from app.web.routes.shapes.common import ApiModel, MetricJson, file_of
from pipeline.params import changes_of, to_yaml

logger = logging.getLogger("cipv.runs")

_MOST_SENTENCES = 100
_NAMED_CHANGES = 3


class Run(ApiModel):
    """One run over the drive."""

    id: int
    """Number of the run."""
    name: str
    """Given by a person; empty otherwise."""
    label: str
    """What it changes against the base."""
    digest: str
    """Equal for equal inputs and parameters."""
    preset: str
    """That its parameters started from."""
    changes: dict[str, tuple[Any, Any]]
    """Parameters that differ from the base's: its value and this run's."""
    done: int
    """Frames that have been run."""
    total: int
    """Frames of the drive."""
    phase: Phase
    """``detect`` while networks see images for the first time, ``run`` afterwards."""
    note: str
    """Why it failed; empty otherwise."""
    kept: bool
    """Saved runs are not discarded when newer ones come."""
    seconds: float
    """Of computing."""


class Runs(ApiModel):
    """The runs of the open recording."""

    base: int | None
    """Number of the run that the present one is compared with; null without one."""
    run: int | None
    """Number of the run of the present parameters; null without one."""
    runs: list[Run]
    """The oldest first."""


class Name(ApiModel):
    """A person's name for a run."""

    name: str = Field("", max_length=LONGEST_NAME)
    """Shown in the list; may be empty."""


class ComparisonJson(ApiModel):
    """Two runs side by side."""

    base: int
    """Number of the run compared with."""
    run: int
    """Number of the run itself."""
    done: int
    """Frames that both have run."""
    differing: list[tuple[int, int]]
    """First and last frame of each range whose lead differs."""
    frames_differing: int
    """In all ranges together."""
    first: dict[int, str]
    """What differs where a range begins, by that frame."""
    metrics: list[MetricJson]
    """Those that need truth only where there is one."""
    truth: Literal["labels", "recording", "simulator"] | None
    """Its source: labels made here, otherwise labels that come with the recording, or the simulator; null without
    any."""
    judged: int
    """Frames with truth."""


def runs_router(engine: Engine, drives: BackgroundRuns) -> APIRouter:
    """Routes for the runs of the open recording."""
    router = APIRouter(prefix="/api", tags=["what if"])

    @router.get("/runs")
    def runs() -> Runs:
        """List the runs of the open recording, oldest first."""
        return _runs_json(drives.recording)

    @router.get("/runs/{number}/columns")
    def columns(number: int, first: int = Query(0, alias="from", ge=0)) -> Columns:
        """Get the columns of a run from a frame on."""
        recording = open_recording(drives)
        with refusing():
            return columns_of(recording, recording.runs.get(number), first)

    @router.post("/runs/{number}/keep")
    def keep(number: int, body: Name) -> Runs:
        """Save a run under a name, or rename it. Unsaved runs are discarded when newer ones are made."""
        recording = open_recording(drives)
        with refusing():
            recording.runs.keep(number, body.name)
        drives.changed()
        return _runs_json(recording)

    @router.post("/runs/{number}/base")
    def base(number: int) -> Runs:
        """Make a run the base of comparison."""
        recording = open_recording(drives)
        with refusing():
            recording.runs.compare_with(number)
        drives.changed()
        return _runs_json(recording)

    @router.post("/runs/{number}/use")
    def use(number: int) -> Runs:
        """Use the parameters of a run. The change can be undone."""
        recording = open_recording(drives)
        with refusing():
            run = recording.runs.get(number)
        engine.control.set_params(run.params, run.preset)
        drives.want(run.params, run.preset)
        return _runs_json(recording)

    @router.delete("/runs/{number}")
    def delete(number: int) -> Runs:
        """Delete a run. The current run and the base cannot be deleted."""
        recording = open_recording(drives)
        with refusing():
            recording.runs.delete(number)
        drives.changed()
        return _runs_json(recording)

    @router.get("/runs/{number}/params.yaml", response_class=Response, responses=file_of("application/yaml"))
    def preset_file(number: int) -> Response:
        """Download the parameters of a run as a file for `cipv run --params`."""
        with refusing():
            params = open_recording(drives).runs.get(number).params
        headers = {"content-disposition": f'attachment; filename="cipv-run-{number}.yaml"'}
        return Response(to_yaml(params), media_type="application/yaml", headers=headers)

    @router.get("/compare")
    def comparison(base: int | None = None, run: int | None = None) -> ComparisonJson:
        """Compare two runs. Defaults to the base and the present run."""
        recording = open_recording(drives)
        with refusing():
            new = recording.runs.get(run) if run is not None else current(recording)
            old = recording.runs.get(base) if base is not None else recording.runs.base or new
        judged = _judged_by_labels(engine.labels, old, new)
        found = compare(*(judged or (old.rows(), new.rows())))
        truth: Literal["labels", "recording", "simulator"] = "simulator" if recording.setup.simulated else "recording"
        return ComparisonJson(
            base=old.number,
            run=new.number,
            done=found.frames,
            differing=list(found.differing),
            frames_differing=found.frames_differing,
            first=dict(list(found.sentences.items())[:_MOST_SENTENCES]),
            metrics=[MetricJson(**vars(metric)) for metric in found.metrics],
            truth=None if not found.judged else "labels" if judged is not None else truth,
            judged=found.judged,
        )

    return router


def _judged_by_labels(desk: LabelDesk, base: DriveRun, run: DriveRun) -> tuple[list[Row], list[Row]] | None:
    """The rows of both runs, judged by labels made here; None if no label is accepted, or while the label database is
    unavailable: then the recording's own truth is used."""
    try:
        labels = desk.labels
        first, second = desk.scores.judged_rows(labels, base), desk.scores.judged_rows(labels, run)
    except DatabaseError as error:  # runs can be compared without labels as well
        logger.warning("compared without labels: %s", error)
        return None
    return (first, second) if first is not None and second is not None else None


def label_of(changes: dict[str, tuple[Any, Any]], preset: str) -> str:
    """The label of a run: what it changes, or the preset it started from."""
    if not changes:
        return f"preset {preset}"
    named = [f"{name} {old} → {new}" for name, (old, new) in list(changes.items())[:_NAMED_CHANGES]]
    rest = len(changes) - len(named)
    return ", ".join(named) + (f" and {rest} more" if rest else "")


def _runs_json(recording: OpenRecording | None) -> Runs:
    if recording is None:
        return Runs(base=None, run=None, runs=[])
    registry = recording.runs
    base, run = registry.base, registry.current
    return Runs(
        base=base.number if base else None,
        run=run.number if run else None,
        runs=[_run_json(recording, each, base or each) for each in registry.all()],
    )


def _run_json(recording: OpenRecording, run: DriveRun, base: DriveRun) -> Run:
    changes = changes_of(base.params, run.params)
    return Run(
        id=run.number,
        name=run.name,
        label=label_of(changes, run.preset),
        digest=recording.digest(run.params),
        preset=run.preset,
        changes=changes,
        done=run.done,
        total=run.total,
        phase="failed" if run.note else "done" if run.is_complete else "run",
        note=run.note,
        kept=run.kept,
        seconds=round(run.seconds, 3),
    )
