"""Responses of /api/labels about labels, as types."""

from __future__ import annotations

from typing import Literal

from app.labels.service.filmstrip import Why
from app.labels.store.values import ItemKind
from app.web.routes.shapes.common import ApiModel, Point
from pipeline.labels.model import Heading, Maker, State


class OriginJson(ApiModel):
    """Who made a label, and with what."""

    maker: Maker
    """Kind of author."""
    name: str
    """The person, or the file or run that it came from."""
    t_unix_ms: int
    """When, in Unix milliseconds."""
    params: str | None
    """Digest of what the pipeline ran with; null for others."""
    calibration: str | None
    """Digest of what the pipeline ran with; null for others."""
    how: str
    """What its place was measured by, where a person only pointed at it; empty otherwise."""


class LabelItem(ApiModel):
    """What every label has."""

    id: int
    """Among those of its kind."""
    revision: int
    """The act that changed it last; an edit carries the one that it is based on."""


class StatedItem(LabelItem):
    """A label that can be proposed, accepted and reviewed."""

    state: State
    """How far it has come."""
    origin: OriginJson
    """Who made it."""
    comment: str
    """Why it was sent back; empty otherwise."""
    reviewer: str
    """Who found it right, another than its author; empty while nobody has."""
    author: str
    """Whose decision it is, and who cannot review it: who set it, or accepted or imported it where the pipeline or a
    file made it; empty while it is only proposed by these."""


class AttributeJson(ApiModel):
    """One attribute of a track over a range of frames."""

    first: int
    """First frame of the range."""
    last: int
    """Last frame of the range, inclusive."""
    name: str
    """As in the class list."""
    value: str
    """One of the attribute's values."""


class TrackHead(StatedItem):
    """A track without its sightings."""

    label: str
    """Class of the vehicle."""
    confidence: float | None
    """Of a proposal: how sure it is a road user, 0–1; null for others."""
    heading: Heading
    """What told front from rear of a proposal: ``motion``, ``lane`` or ``unknown``, which somebody has to look at;
    empty once somebody has."""
    attributes: list[AttributeJson]
    """What is said of it besides its class, in ranges of frames."""
    first: int | None
    """First frame; null while it has no sighting."""
    last: int | None
    """Last frame; null while it has no sighting."""
    keyframes: list[int]
    """Frames put there by a person or a file."""
    sightings: int
    """How many."""


class LeadJson(StatedItem):
    """The lead in a range of frames."""

    first: int
    """First frame of the range."""
    last: int
    """Last frame, included."""
    lead: int | Literal["none", "unknown"]
    """Id of a track; ``none`` when nobody leads, ``unknown`` when it cannot be told."""


class PathLabelJson(StatedItem):
    """The borders of the ego lane in a frame: ego x, y."""

    frame: int
    """The only one that the lines hold in."""
    left: list[Point] | None
    """From near to far; null where only the other was drawn."""
    right: list[Point] | None
    """From near to far; null where only the other was drawn."""


class EventLabelJson(StatedItem):
    """Something that happens at a frame."""

    frame: int
    """When."""
    kind: str
    """``cut_in``, ``cut_out``, or another word."""
    tracks: list[int]
    """Who takes part."""


class TagJson(LabelItem):
    """A tag on a range of frames."""

    first: int
    """First frame of the range."""
    last: int
    """Last frame, included."""
    tag: str
    """The word."""
    origin: OriginJson
    """Who said it."""


class ItemKey(ApiModel):
    """A reference to an item."""

    kind: ItemKind
    """Numbers are unique within a kind only."""
    id: int
    """Among those of its kind."""


class Removed(ItemKey):
    """An item that is gone."""


class LabelledDrive(ApiModel):
    """The recording that labels belong to."""

    id: str
    """Of its content: the same wherever it lies."""
    uri: str
    """As it was opened."""
    count: int
    """Of its frames."""


class LabelChanges(ApiModel):
    """Everything that changed after the revision asked for."""

    revision: int
    """The newest; the next ``since``."""
    drive: LabelledDrive
    """Whose labels they are."""
    tracks: list[TrackHead]
    """Added or changed."""
    leads: list[LeadJson]
    """Added or changed."""
    paths: list[PathLabelJson]
    """Added or changed."""
    events: list[EventLabelJson]
    """Added or changed."""
    tags: list[TagJson]
    """Added or changed."""
    removed: list[Removed]
    """Items that are gone."""


class LabelsOfPerson(LabelChanges):
    """Changes, and whether the person who asks can undo and redo."""

    can_undo: bool
    """Of the person who asks."""
    can_redo: bool
    """Of the person who asks."""


class ProblemJson(ApiModel):
    """Something implausible in the labels."""

    frame: int
    """Where to look."""
    track: int | None
    """What it is about; null for the lead alone."""
    words: str
    """One sentence."""


class ChecksJson(ApiModel):
    """The outcome of all checks."""

    revision: int
    """The act after which the labels were checked."""
    problems: list[ProblemJson]
    """By frame."""


class StillJson(ApiModel):
    """One frame of a track."""

    frame: int
    """Of the drive, from 0."""
    why: Why
    """Why this frame was chosen."""
    inside: int | None
    """Points in its cuboid; null without points or cuboid."""
    beside: int | None
    """Points right beside its cuboid; null without points or cuboid."""


class NextJson(ApiModel):
    """The next frame with something to do."""

    frame: int | None
    """Null when there is none."""
    why: str
    """One sentence."""
    item: ItemKey | None
    """What it is about, where that is one label."""
    left: int
    """How many such places there are in the drive."""
