"""What /api/labels answers, as types."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal
from uuid import UUID

from pydantic import BaseModel, Field

from app.labels.requests import Act, Person, PersonOrNobody, Strict
from app.labels.tasks import Kind
from app.labels.values import LONGEST_ITEM, LONGEST_NAME, ItemKind
from app.routes.shapes import CuboidJson, MetricJson, Point
from pipeline.evaluation.experiments.sections import Cell
from pipeline.evaluation.lead import Verdict
from pipeline.labels.model import State

VERSION_NAME = r"^[A-Za-z0-9][A-Za-z0-9._ -]*$"
"""A version's name is shown and asked for in addresses; it is never a path."""


class OriginJson(BaseModel):
    """Who made a label. params, calibration: digests of what the pipeline ran with. how: what its place was measured
    by, where a person only pointed at it; empty otherwise."""

    maker: Literal["pipeline", "person", "import"]
    name: str
    t_unix_ms: int
    params: str | None
    calibration: str | None
    how: str


class LabelItem(BaseModel):
    """revision: the act that changed it last; an edit carries the one that it is based on."""

    id: int
    revision: int


class StatedItem(LabelItem):
    """comment: why it was sent back. reviewer: who found it right, another than who made it; empty while nobody has."""

    state: State
    origin: OriginJson
    comment: str
    reviewer: str


class TrackHead(StatedItem):
    """A track without its sightings. first, last: frames; null while it has none. sightings: how many."""

    label: str
    first: int | None
    last: int | None
    keyframes: list[int]
    sightings: int


class LeadJson(StatedItem):
    """Who leads from first to last."""

    first: int
    last: int
    lead: int | Literal["none", "unknown"]


class PathLabelJson(StatedItem):
    """The ego lane's lines in a frame, ego x, y."""

    frame: int
    left: list[Point] | None
    right: list[Point] | None


class EventLabelJson(StatedItem):
    """kind: ``cut_in``, ``cut_out``, or another word."""

    frame: int
    kind: str
    tracks: list[int]


class TagJson(LabelItem):
    """A word about the frames from first to last."""

    first: int
    last: int
    tag: str
    origin: OriginJson


class ItemKey(BaseModel):
    """Which item."""

    kind: ItemKind
    id: int


class Removed(ItemKey):
    """What is no longer there."""


class LabelledDrive(BaseModel):
    """id: of its content: the same wherever it lies."""

    id: str
    uri: str
    count: int


class LabelChanges(BaseModel):
    """Everything that changed after ``since``."""

    revision: int
    drive: LabelledDrive
    tracks: list[TrackHead]
    leads: list[LeadJson]
    paths: list[PathLabelJson]
    events: list[EventLabelJson]
    tags: list[TagJson]
    removed: list[Removed]


class LabelsOfPerson(LabelChanges):
    """can_undo, can_redo: of the person who asks."""

    can_undo: bool
    can_redo: bool


class PlacedJson(BaseModel):
    """keyframe: a person or a file put it there; else it follows those that are."""

    cuboid: CuboidJson | None
    bbox: tuple[float, float, float, float] | None
    keyframe: bool


class PlacedTrack(PlacedJson):
    """A track in a frame."""

    track: int


class PlacedFrame(PlacedJson):
    """A frame of a track."""

    frame: int


class Window(BaseModel):
    """By frame, whatever is in it."""

    revision: int
    sightings: dict[int, list[PlacedTrack]]


class WholeTrack(StatedItem):
    """With every sighting."""

    label: str
    sightings: list[PlacedFrame]


class HistoryJson(BaseModel):
    """One act in an item's life. before, after: the item, null where it was not there; of a track, with the sightings
    that the act changed. note: what there was to say about it."""

    act: int
    what: str
    note: str
    person: str
    t_unix_ms: int
    before: dict[str, Any] | None
    after: dict[str, Any] | None
    undone: bool


class NextJson(BaseModel):
    """frame: null when there is none. why: one sentence. item: what it is about, where that is one label. left: how
    many such places there are in the drive."""

    frame: int | None
    why: str
    item: ItemKey | None
    left: int


class SizesJson(BaseModel):
    """Sizes of errors, metres or m/s."""

    min: float
    max: float
    mae: float


class ErrorsJson(BaseModel):
    """A row of the paper's Table 4. vehicles: ``all``, or of a range. seen_by: VL, V, L or ``any``. Null where nothing
    says how far off it is."""

    vehicles: str
    seen_by: str
    count: int
    distance: SizesJson | None
    lateral: SizesJson | None
    longitudinal: SizesJson | None
    speed: SizesJson | None


class BadFrameJson(BaseModel):
    """A frame to look at first. truth_m: how far off the lead is; error_m: of the CIPV's distance."""

    frame: int
    verdict: Verdict
    truth_m: float | None
    error_m: float | None


class ScoreJson(BaseModel):
    """revision: of the labels. judged: frames in which they say who leads. metrics: empty while nobody stands behind
    any label. notes: what does not count, and why. errors: by range and by sensor. worst: the worst frame first."""

    revision: int
    run: int
    judged: int
    metrics: list[MetricJson]
    notes: list[str]
    errors: list[ErrorsJson]
    worst: list[BadFrameJson]


def errors_json(row: Sequence[Cell]) -> ErrorsJson:
    """One of ``error_rows``."""
    vehicles, seen_by, count, *figures = row
    sizes = [
        {"min": figures[n], "max": figures[n + 1], "mae": figures[n + 2]} if figures[n] is not None else None
        for n in range(0, len(figures), 3)
    ]
    named = dict(zip(("distance", "lateral", "longitudinal", "speed"), sizes, strict=True))
    return ErrorsJson.model_validate({"vehicles": vehicles, "seen_by": seen_by, "count": count, **named})


Drive = Annotated[str, Field(max_length=LONGEST_ITEM, description="Id of the recording, of GET /api/labels")]


class Sent(Strict):
    """act_id: made by who sends it, one for each act: sent again, the act is not done again, and answered as before."""

    act_id: UUID | None = None

    @property
    def sent_as(self) -> str | None:
        """The id as the log keeps it."""
        return str(self.act_id) if self.act_id is not None else None


class ActBody(Sent):
    """person: whose act it is. drive: the recording that is meant; 409 when another one is open."""

    person: Person
    drive: Drive
    act: Act


class Who(Sent):
    """person: whose newest act is meant. drive: as of an act; null where what is open has no frames to label."""

    person: PersonOrNobody = ""
    drive: Drive | None


class ActedJson(BaseModel):
    """It is on disk. act: its number, null when nothing changed. what: in a few words. changed: what others get as
    changes. note: what there is to say about it."""

    revision: int
    act: int | None
    what: str
    changed: LabelChanges | None
    note: str


class TaskBegun(BaseModel):
    """It goes on; ``state.labels.task`` tells how far it is. task: its id there."""

    status: Literal["begun"]
    what: Kind
    task: int


class StaleJson(BaseModel):
    """Nothing was written. item: what somebody changed; theirs: it as it is now, null when it was removed; yours: what
    was sent."""

    detail: str
    item: ItemKey | None = None
    theirs: dict[str, Any] | None = None
    yours: dict[str, Any] | None = None


class VersionJson(BaseModel):
    """A frozen label set. frames: that have a label."""

    name: str
    person: str
    t_unix_ms: int
    tracks: int
    frames: int


class NewVersion(Strict):
    """Freeze the labels as they are now."""

    name: Annotated[str, Field(min_length=1, max_length=LONGEST_NAME, pattern=VERSION_NAME)]
    person: Person


class NativeFile(BaseModel):
    """Our own file: every field of a label set under its own name."""

    format: Literal["cipv-labels"]
    version: int
    labels: dict[str, Any]


class LostJson(BaseModel):
    """What a format has no place for, a sentence each."""

    lost: list[str]
