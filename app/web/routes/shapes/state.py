"""The open source, playback and background work, as types."""

from __future__ import annotations

from typing import Any, Literal

from app.labels.tasks import TaskKind
from app.web.routes.shapes.common import Exact


class NoticeJson(Exact):
    """A sentence for the user."""

    level: Literal["info", "warning", "error"]
    """Decides how it is shown."""
    text: str
    """One or two sentences."""


class DriveStateJson(Exact):
    """How far the whole drive is computed."""

    revision: int
    """Grows whenever columns, runs, events or marks changed."""
    run: int | None
    """Number of the run of the present parameters; null without one."""
    base: int | None
    """Number of the run that it is compared with; null without one."""
    done: int
    """Frames that have been run."""
    total: int
    """Frames of the drive."""
    running: bool
    """Whether it goes on."""
    phase: Literal["detect", "run", "done", "failed"]
    """``detect`` while networks see images for the first time, ``run`` afterwards."""
    note: str
    """Why it failed; empty otherwise."""


class RecordingJson(Exact):
    """The session that is being recorded."""

    file: str
    """Path on the server."""
    frames: int
    """Written so far."""
    seconds: float
    """Of the drive."""
    bytes: int
    """Written so far."""
    dropped: int
    """Frames and messages that the disk or the machine was too slow for; show it whenever it is not 0."""
    error: str | None
    """Why the recording ended by itself (a full disk); what came before is kept. Null while all is well."""
    dropped_because: str | None
    """What was too slow when data was last dropped, the disk or the machine. Null if nothing was dropped."""
    trouble: str | None
    """What is wrong while recording goes on: a disk that does not respond, or, for a minute, a restart after writing
    hung. Null otherwise."""


class LabelTaskJson(Exact):
    """A task on labels. It stays, with its note or error, until the next one begins."""

    id: int
    """As the request that began it was told."""
    what: TaskKind
    """Kind of work."""
    done: int
    """Units of work finished."""
    total: int
    """Units in all; 0 until the work first reports."""
    note: str
    """What came of it, once it is done."""
    error: str | None
    """Why it failed; null otherwise."""
    running: bool
    """False once it has ended, either way."""


class LabelStateJson(Exact):
    """The labels of what is open."""

    revision: int
    """Number of acts; when it has grown, GET /api/labels?since=."""
    task: LabelTaskJson | None
    """Null before the first."""


class StateJson(Exact):
    """Source, position, playback."""

    uri: str | None
    """As the source was opened; null when nothing is open."""
    title: str
    """Of the recording."""
    rate_hz: float
    """Nominal frame rate; 0 when unknown."""
    count: int
    """Frames; 0 for live sensors."""
    index: int
    """Of the shown frame."""
    frame: str | None
    """The recording's own name of the shown frame; null before the first."""
    time_s: float
    """Place of the shown frame on the playback timeline."""
    duration_s: float
    """Of the whole timeline."""
    playing: bool
    """False holds the shown frame."""
    speed: float
    """Playback rate; 1 is real time."""
    loop: bool
    """Whether playback starts again at the end."""
    busy: str | None
    """What the server is doing while it cannot serve requests; null otherwise."""
    detector: str | None
    """Name of the network for vehicles; null without one."""
    lane_detector: str | None
    """Name of the lane detector; null without one."""
    preset: str
    """That the parameters started from."""
    params_revision: int
    """Grows with every change of parameters."""
    sequence: int
    """Grows with every result."""
    skipped: int
    """Frames since the source was opened that were not shown in time."""
    provisional: bool
    """The shown frame is not as in the whole drive yet: object numbers may differ."""
    drive: DriveStateJson
    """Of the run of the present parameters."""
    can_undo: bool
    """Of changes of parameters that nobody put a name to; a person's own are in /api/labels and /api/params."""
    can_redo: bool
    """As ``can_undo``."""
    labels: LabelStateJson | None
    """Null for what has no labels."""
    live: bool
    """Live sensors, not a recording."""
    streams: dict[str, dict[str, Any]]
    """Health of live sensors, by sensor; empty for a recording."""
    recording: RecordingJson | None
    """Null while nothing is recorded."""
    notices: list[NoticeJson]
    """What there is to tell the person now."""


class SourceJson(Exact):
    """A source that can be opened."""

    uri: str
    """As POST /api/source takes it."""
    title: str
    """For people."""


class SourcesJson(Exact):
    """What can be opened."""

    open: str | None
    """URI of what is open; null when nothing is."""
    sources: list[SourceJson]
    """Recordings found in the server's folders, and simulated drives."""
