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
"""proposed: nobody has looked yet. corrected: a person changed what was proposed. rejected: a person said it is not so;
it is kept, so that it is not proposed again."""


Heading = Literal["", "motion", "lane", "unknown"]
"""What told the front of proposed cuboids from their rear: how the vehicle moved, or the lane it is in. unknown:
nothing did, and somebody has to look. Empty where a person or a file has said it."""

FARTHEST_LEAD_M = 60.0
"""A vehicle in the path that is farther away is not asked for: ``none`` says that nothing nearer is in the path."""


@dataclass(frozen=True)
class Origin:
    """Who made a label."""

    maker: Literal["pipeline", "person", "import"]
    """What kind of maker it is."""
    name: str
    """The person, or the file or run that it came from."""
    t_unix_ms: int
    """When it was made."""
    params: str | None = None
    """Digest of the parameters that the pipeline ran with; None for the other makers."""
    calibration: str | None = None
    """Digest of the calibration that the pipeline ran with; None for the other makers."""
    how: str = ""
    """What its place was measured by, where a person only pointed at it; empty otherwise."""


@dataclass(frozen=True)
class Sighting:
    """A track in one frame."""

    frame: int
    """Which one."""
    cuboid: Cuboid | None
    """In the ego frame; None where only the image shows it."""
    bbox: Box | None = None
    """Pixels of the raw image; None where only the LiDAR shows it."""
    keyframe: bool = True
    """Put there by a person or an import; otherwise interpolated between keyframes."""
    box_set: bool = False
    """A person or a file says what the box is; else it follows the cuboid, if there is one (``boxes.following``)."""
    truncation: float | None = None
    """The share of it, 0–1, that lies outside the image; None where nobody said it."""
    occlusion: int | None = None
    """0 visible, 1 partly, 2 largely hidden; None where nobody said it."""


@dataclass(frozen=True)
class Attribute:
    """What is said of a track in some frames, by the project's class list."""

    first: int
    """First frame."""
    last: int
    """Last frame, included."""
    name: str
    """``motion``, ``brake lights``, …"""
    value: str
    """One of those that the list has for it."""


@dataclass(frozen=True)
class LabelTrack:
    """One vehicle or person over time."""

    id: int
    """Unique within the set."""
    label: str
    """Class name as in ``pipeline.types.VEHICLES`` and COCO."""
    sightings: tuple[Sighting, ...]
    """By ascending frame, at most one a frame."""
    state: State
    """Whether somebody has looked at it, and what they said."""
    origin: Origin
    """Who made it."""
    comment: str = ""
    """What whoever sent it back wants to have looked at."""
    reviewer: str = ""
    """Who approved it, another person than who made it; empty while nobody has, and again once it is changed."""
    confidence: float | None = None
    """Of a proposal, 0–1: how sure it is a road user at all; None where that was not asked."""
    heading: Heading = ""
    """What told its front from its rear."""
    attributes: tuple[Attribute, ...] = ()
    """By name and first frame; those of one name do not overlap."""

    def at(self, frame: int) -> Sighting | None:
        """Its sighting in a frame; None where it is not labelled."""
        return next((each for each in self.sightings if each.frame == frame), None)


Lead = int | Literal["none", "unknown"]
"""The lead of a frame: a track's id, ``none`` when nothing nearer than ``FARTHEST_LEAD_M`` is in the path, ``unknown``
when it is unclear."""


@dataclass(frozen=True)
class LeadRange:
    """Who is the closest in-path vehicle in some frames. Ranges do not overlap."""

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
    """The ego path of one frame where the pipeline's is wrong or missing."""

    frame: int
    """Which one."""
    left: tuple[Point2, ...] | None
    """Its left edge: ego x, y from the bumper on; None where only the other one was drawn."""
    right: tuple[Point2, ...] | None
    """Its right edge, likewise."""
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
    """Who takes part."""
    state: State
    """As of a track."""
    origin: Origin
    """As of a track."""
    comment: str = ""
    """As of a track."""
    reviewer: str = ""
    """As of a track."""


WHOLE_TAG = "all labelled"
"""By this tag a person says that every vehicle of frames is labelled."""
NEXT_TAG = "label next"
"""Frames with this tag are in the labeling queue until their lead is labelled."""


@dataclass(frozen=True)
class FrameTag:
    """A word about some frames."""

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
    """Who the lead is."""
    paths: tuple[PathLabel, ...] = ()
    """Where the car goes."""
    events: tuple[EventLabel, ...] = ()
    """What happens."""
    tags: tuple[FrameTag, ...] = ()
    """What is said of frames."""
    name: str = "working"
    """Of a frozen version, else ``working``."""
