"""What /api/labels answers about labels, as types."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel

from app.labels.service.filmstrip import Why
from app.labels.store.values import ItemKind
from app.web.routes.shapes import CuboidJson, Point
from pipeline.labels.model import Heading, State


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
    """A track without its sightings. first, last: frames; null while it has none. sightings: how many. confidence: of a
    proposal, how sure it is a road user, 0–1; null for others. heading: what told front from rear of a proposal:
    ``motion``, ``lane`` or ``unknown``, which somebody has to look at; empty once somebody has."""

    label: str
    confidence: float | None
    heading: Heading
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
    """keyframe: a person or a file put it there; else it follows those that are. box_set: somebody set the box; else it
    is where the cuboid is in the picture."""

    cuboid: CuboidJson | None
    bbox: tuple[float, float, float, float] | None
    keyframe: bool
    box_set: bool


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
    confidence: float | None
    heading: Heading
    sightings: list[PlacedFrame]


class ProblemJson(BaseModel):
    """What can hardly be so. track: what it is about; null for the lead alone."""

    frame: int
    track: int | None
    words: str


class ChecksJson(BaseModel):
    """Of the labels as they were after act ``revision``."""

    revision: int
    problems: list[ProblemJson]


class StillJson(BaseModel):
    """One frame of a track. inside, beside: points in its cuboid and right beside it; null without points or cuboid."""

    frame: int
    why: Why
    inside: int | None
    beside: int | None


class NextJson(BaseModel):
    """frame: null when there is none. why: one sentence. item: what it is about, where that is one label. left: how
    many such places there are in the drive."""

    frame: int | None
    why: str
    item: ItemKey | None
    left: int
