"""/api/drive: the whole drive as columns, one object's curve, events and marks."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, HTTPException, Query
from pydantic import Field

from app.drive.background_runs import BackgroundRuns
from app.drive.events import event_kinds, find_events
from app.drive.events.event import Event, Severity
from app.drive.events.marks import marks_by_time, recorded_marks
from app.drive.frame_rows import columns_json, object_json
from app.drive.full_run import DriveRun
from app.drive.marks import LIVE, LONGEST_TEXT, MarkRefused, Marks
from app.drive.open_recording import OpenRecording
from app.engine.engine import Engine
from app.engine.snapshot import Snapshot
from app.web.refusals import open_recording, refusing
from app.web.routes.shapes.common import ApiModel, SensorLetters, StatusJson
from app.web.routes.shapes.names import one_of
from pipeline.common.clips import first_frames


class Columns(ApiModel):
    """Columns of the timeline: each is a list for frames ``from`` … done−1."""

    run: int
    """Number of the run."""
    uri: str
    """Of the recording."""
    count: int
    """Frames of the recording."""
    first: int = Field(serialization_alias="from")
    """The first frame that is answered."""
    done: int
    """Frames that have been run."""
    t_s: list[float]
    """Place on the timeline of every frame of the recording, when ``from`` is 0."""
    clips: list[int]
    """Index at which each clip of the recording begins, when ``from`` is 0."""
    columns: dict[str, list[Any]]
    """By name."""


class Curve(ApiModel):
    """One object's values at the frames in which it was."""

    id: int
    """Object number in the run."""
    run: int
    """Number of the run."""
    index: list[int]
    """Numbers of the frames; all lists have this length."""
    source: list[SensorLetters]
    """The letters of its sensors: V, L or VL."""
    carried: list[bool]
    """Predicted, not seen in that frame."""
    in_path: list[bool]
    """Whether it was taken to be in the ego path."""
    distance_m: list[float | None]
    """Null when unknown."""
    closing_speed_mps: list[float | None]
    """Positive when the gap shrinks."""
    ttc_s: list[float | None]
    """Null when the gap does not shrink."""
    path_offset_m: list[float | None]
    """From the path's centre, positive to the left."""
    vl_gap_m: list[float | None]
    """The camera's distance less the LiDAR's; null unless both saw it."""


EventKind = Annotated[str, *one_of(event_kinds())]


class EventJson(ApiModel):
    """Something that happened."""

    kind: EventKind
    """For filters and colours."""
    index: int
    """Of the frame."""
    t_s: float
    """Place on the timeline."""
    text: str
    """One sentence."""
    ids: list[int]
    """Of the objects it is about, the most important first."""
    severity: Severity
    """Decides its colour."""
    mark: int | None
    """Its number, when a person made it; null for others."""


class Events(ApiModel):
    """Events of a run, by frame."""

    run: int | None
    """Number of the run; null before one has begun."""
    events: list[EventJson]
    """By frame."""


class NewMark(ApiModel):
    """A moment to be marked."""

    index: int | None = Field(None, ge=0)
    """Of the frame; absent or null: the shown frame."""
    text: str = Field("", max_length=LONGEST_TEXT)
    """What there is to see; may be empty."""


class MarkJson(ApiModel):
    """A marked moment."""

    id: int
    """Its number in the recording."""
    index: int
    """Of the frame."""
    t_s: float
    """Its place on the timeline."""
    text: str
    """What the person wrote."""
    in_session: bool
    """Whether a session that is being recorded has it."""


def drive_router(engine: Engine, drives: BackgroundRuns, marks: Marks) -> APIRouter:
    """Routes for the whole-drive runs."""
    router = APIRouter(prefix="/api", tags=["drive"])
    known = _EventsOnce()

    @router.get("/drive")
    def drive(first: int = Query(0, alias="from", ge=0)) -> Columns:
        """Get the columns of the present run from a frame on. Ask again from ``done`` while ``run`` stays the same."""
        recording = open_recording(drives)
        return columns_of(recording, current(recording), first)

    @router.get("/drive/object/{object_id}")
    def curve(object_id: int, run: int | None = None) -> Curve:
        """Get the curves of one object over the drive. Object numbers are those of the run."""
        recording = open_recording(drives)
        with refusing():
            of = current(recording) if run is None else recording.runs.get(run)
        return Curve(id=object_id, run=of.number, **object_json(of.objects(), object_id))

    @router.get("/drive/events")
    def events() -> Events:
        """List events and marks by frame. While a run is in progress, up to the frame it has reached. For live sensors,
        the marks made since they were opened: ``t_s`` is their time, ``index`` the tick count."""
        recording = drives.recording
        run = recording.runs.current if recording is not None else None
        if recording is None or run is None:
            return Events(run=None, events=_live_marks(engine.snapshot, marks))
        marked = [
            Event("mark", mark.index, mark.text or "marked", mark=mark.id) for mark in marks.of(recording.setup.uri)
        ]
        marked += recorded_marks([row.t_ns for row in run.rows()], recording.marks)
        marked += marks_by_time(marks.of(LIVE), recording.stamps_ns, round(1e9 / recording.setup.source.rate_hz))
        times = recording.setup.timeline_s
        found = sorted([*known.of(run), *marked], key=lambda event: event.index)
        return Events(
            run=run.number,
            events=[
                EventJson(**event.to_json(float(times[event.index]))) for event in found if event.index < len(times)
            ],
        )

    @router.post("/marks", status_code=201)
    def mark(body: NewMark) -> MarkJson:
        """Mark a frame. The mark is stored with the recording, and written to the session that is being recorded. For
        live sensors it marks the shown tick, is stored by its time, and appears on every recording of that time."""
        shown = engine.snapshot
        if shown.uri is None:
            raise HTTPException(409, "no recording is open")
        if shown.live and shown.processed is None:
            raise HTTPException(409, "no data from the sensors yet")
        index = shown.index if body.index is None or shown.live else body.index
        if not shown.live and index >= max(shown.count, 1):
            raise HTTPException(422, f"index: the recording has {shown.count} frames")
        in_session = index == shown.index and engine.recorder.mark(body.text or "marked")
        t_ns = shown.processed.frame.t_ns if shown.live and shown.processed is not None else None
        try:
            made = marks.add(_marks_of(shown), index, body.text, t_ns=t_ns, in_session=in_session)
        except MarkRefused as error:
            raise HTTPException(409, str(error)) from None
        drives.changed()
        t_s = shown.time_s if index == shown.index else _time_s(drives, index)
        return MarkJson(id=made.id, index=made.index, t_s=t_s, text=made.text, in_session=in_session)

    @router.delete("/marks/{number}")
    def unmark(number: int) -> StatusJson:
        """Remove a mark."""
        shown = engine.snapshot
        if shown.uri is None or not marks.remove(_marks_of(shown), number):
            raise HTTPException(404, f"mark {number} not found")
        drives.changed()
        return StatusJson(status="removed")

    return router


def _marks_of(shown: Snapshot) -> str:
    """Key under which the marks of the shown recording or sensors are stored."""
    return LIVE if shown.live else shown.uri or ""


def _time_s(drives: BackgroundRuns, index: int) -> float:
    recording = drives.recording
    return float(recording.setup.timeline_s[index]) if recording is not None else 0.0


def _live_marks(shown: Snapshot, marks: Marks) -> list[EventJson]:
    """Marks made since the sensors were opened, by time."""
    if not shown.live or shown.processed is None:
        return []
    opened_ns = shown.processed.frame.t_ns - round(shown.time_s * 1e9)
    made = [(mark.t_ns, mark) for mark in marks.of(LIVE) if mark.t_ns is not None and mark.t_ns >= opened_ns]
    return [
        EventJson(**Event("mark", mark.index, mark.text or "marked", mark=mark.id).to_json((t_ns - opened_ns) / 1e9))
        for t_ns, mark in sorted(made, key=lambda one: one[0])
    ]


def current(recording: OpenRecording) -> DriveRun:
    """The run with the current parameters; 404 if there is none."""
    run = recording.runs.current
    if run is None:
        raise HTTPException(404, "no run has started yet")
    return run


def columns_of(recording: OpenRecording, run: DriveRun, first: int) -> Columns:
    """The columns of a run from a frame on."""
    rows = run.rows(first)
    return Columns(
        run=run.number,
        uri=recording.setup.uri,
        count=run.total,
        first=min(first, run.done),
        done=first + len(rows) if rows else min(first, run.done),
        t_s=[round(float(t), 4) for t in recording.setup.timeline_s] if first == 0 else [],
        clips=first_frames(recording.stamps_ns.tolist(), run.params.time.reset_gap_s) if first == 0 else [],
        columns=columns_json(rows),
    )


class _EventsOnce:
    """Events of the last requested run; recomputed only after it has progressed."""

    def __init__(self) -> None:
        self._held: tuple[DriveRun, int, list[Event]] | None = None

    def of(self, run: DriveRun) -> list[Event]:
        rows, held = run.rows(), self._held
        if held is not None and held[0] is run and held[1] == len(rows):
            return held[2]
        found = find_events(rows, [records for _, records in run.objects()[: len(rows)]], run.params)
        self._held = (run, len(rows), found)
        return found
