"""The label model: tracks of vehicles, the lead in each frame, path, events and tags.

A ``LabelSet`` belongs to one recording. It is a plain value: the database stores it act by act, formats write and read
all of it, and scores compare it with results. Frames are counted from 0 as in the source; ego frame, metres, radians: x
forward, y left, z up.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pipeline.common.geometry import Cuboid
from pipeline.types import Box, Point2

State = Literal["proposed", "accepted", "corrected", "rejected"]
"""proposed: not reviewed yet. corrected: a person changed the proposal. rejected: a person marked it as wrong; it is
kept, so that it is not proposed again."""
COUNTED_STATES: tuple[State, ...] = ("accepted", "corrected")
"""States of labels that somebody answers for. A proposal has not been confirmed by anybody."""

Maker = Literal["pipeline", "person", "import"]
"""Type of a label's author."""

Heading = Literal["", "motion", "lane", "unknown"]
"""Source of the heading of proposed cuboids: the vehicle's motion, or its lane. unknown: undetermined, a person must
check it. Empty if it was set by a person or a file."""

FARTHEST_LEAD_M = 60.0
"""Vehicles in the path beyond this distance need no label: ``none`` means that nothing nearer is in the path."""


@dataclass(frozen=True)
class Origin:
    """Who made a label."""

    maker: Maker
    """Type of author."""
    name: str
    """The person, or the file or run that it came from."""
    t_unix_ms: int
    """When it was made."""
    params: str | None = None
    """Digest of the parameters that the pipeline ran with; None for the other makers."""
    calibration: str | None = None
    """Digest of the calibration that the pipeline ran with; None for the other makers."""
    how: str = ""
    """How its position was measured if a person only pointed at it; empty otherwise."""


@dataclass(frozen=True)
class Sighting:
    """A track in one frame."""

    frame: int
    """Which one."""
    cuboid: Cuboid | None
    """In the ego frame; None if it is only seen in the image."""
    bbox: Box | None = None
    """Pixels of the raw image; None if only the LiDAR sees it."""
    keyframe: bool = True
    """Set by a person or an import; otherwise interpolated between keyframes."""
    box_set: bool = False
    """Whether a person or a file set the box; otherwise it follows the cuboid, if there is one
    (``boxes.following``)."""
    truncation: float | None = None
    """Share of it, 0–1, outside the image; None if unknown."""
    occlusion: int | None = None
    """0 visible, 1 partly, 2 largely hidden; None if unknown."""


@dataclass(frozen=True)
class Attribute:
    """An attribute of a track in some frames, as defined by the project's class list."""

    first: int
    """First frame."""
    last: int
    """Last frame, included."""
    name: str
    """``motion``, ``brake lights``, …"""
    value: str
    """One of the values in the class list."""


@dataclass(frozen=True)
class LabelTrack:
    """One vehicle or person over time."""

    id: int
    """Unique within the set."""
    label: str
    """Class name as in ``pipeline.types.VEHICLES`` and COCO."""
    sightings: tuple[Sighting, ...]
    """By ascending frame, at most one per frame."""
    state: State
    """State of the review."""
    origin: Origin
    """Who made it."""
    comment: str = ""
    """Comment of the person who sent it back."""
    reviewer: str = ""
    """Who approved it, never its author; empty until then, and after every change."""
    confidence: float | None = None
    """For a proposal, 0–1: probability that it is a road user; None if not computed."""
    heading: Heading = ""
    """Source of the heading."""
    attributes: tuple[Attribute, ...] = ()
    """Sorted by name and first frame; those with the same name do not overlap."""

    def at(self, frame: int) -> Sighting | None:
        """Its sighting in a frame; None if it is not labelled there."""
        return next((each for each in self.sightings if each.frame == frame), None)


Lead = int | Literal["none", "unknown"]
"""The lead of a frame: a track's id, ``none`` when nothing nearer than ``FARTHEST_LEAD_M`` is in the path, ``unknown``
when it is unclear."""


@dataclass(frozen=True)
class LeadRange:
    """The closest in-path vehicle in some frames. Ranges do not overlap."""

    first: int
    """First frame."""
    last: int
    """Last frame, included."""
    lead: Lead
    """The vehicle."""
    state: State
    """As of a track."""
    origin: Origin
    """As of a track."""
    comment: str = ""
    """As of a track."""
    reviewer: str = ""
    """As of a track."""


@dataclass(frozen=True)
class PathLabel:
    """The ego path of one frame if the pipeline's is wrong or missing."""

    frame: int
    """Which one."""
    left: tuple[Point2, ...] | None
    """Its left edge: ego x, y, starting at the bumper; None if only the right one was drawn."""
    right: tuple[Point2, ...] | None
    """Its right edge, in the same form."""
    state: State
    """As of a track."""
    origin: Origin
    """As of a track."""
    comment: str = ""
    """As of a track."""
    reviewer: str = ""
    """As of a track."""


@dataclass(frozen=True)
class EventLabel:
    """Something that happens at a frame."""

    frame: int
    """Which one."""
    kind: str
    """``cut_in``, ``cut_out``, or another word."""
    tracks: tuple[int, ...]
    """Ids of the tracks involved."""
    state: State
    """As of a track."""
    origin: Origin
    """As of a track."""
    comment: str = ""
    """As of a track."""
    reviewer: str = ""
    """As of a track."""


WHOLE_TAG = "all labelled"
"""Tag by which a person confirms that every vehicle in these frames is labelled."""
NEXT_TAG = "label next"
"""Frames with this tag are in the labeling queue until their lead is labelled."""


@dataclass(frozen=True)
class FrameTag:
    """A tag of some frames."""

    first: int
    """First frame."""
    last: int
    """Last frame, included."""
    tag: str
    """``night``, ``rain``, ``sensor dirty``, ``WHOLE_TAG`` or ``NEXT_TAG``."""
    origin: Origin
    """Who said so."""


@dataclass(frozen=True)
class LabelSet:
    """All labels of one recording."""

    source: str
    """URI of the recording."""
    frames: tuple[str, ...]
    """The recording's own names of its frames."""
    t_ns: tuple[int, ...]
    """Their ticks."""
    tracks: tuple[LabelTrack, ...] = ()
    """Vehicles and persons."""
    leads: tuple[LeadRange, ...] = ()
    """Which vehicle leads, by ranges of frames."""
    paths: tuple[PathLabel, ...] = ()
    """Corrected ego paths."""
    events: tuple[EventLabel, ...] = ()
    """What happens."""
    tags: tuple[FrameTag, ...] = ()
    """Tags of frames."""
    name: str = "working"
    """Name of a frozen version, else ``working``."""
