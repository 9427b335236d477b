"""What people say is true of a drive: tracks of vehicles, who the lead is in each frame, path, events and tags.

One ``LabelSet`` belongs to one recording. It is a plain value: the database stores it act by act, formats write and
read it whole, scores compare it with results. Frames are counted from 0 as the source counts them; ego frame, metres,
radians: x forward, y left, z up.
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
    """Who made a label. name: the person, or the file or run that it came from. params, calibration: digests of what
    the pipeline ran with; None for the other makers. t_unix_ms: when. how: what its place was measured by, where a
    person only pointed at it; empty otherwise."""

    maker: Literal["pipeline", "person", "import"]
    name: str
    t_unix_ms: int
    params: str | None = None
    calibration: str | None = None
    how: str = ""


@dataclass(frozen=True)
class Sighting:
    """A track in one frame. cuboid: None where only the picture shows it. bbox: pixels of the raw picture; None where
    only the LiDAR shows it. keyframe: put there by a person or an import; otherwise interpolated between keyframes.
    box_set: a person or a file says what the box is; else it follows the cuboid, if there is one (``boxes.following``).
    truncation: the share, 0–1, of it that lies outside the picture; occlusion: 0 visible, 1 partly, 2 largely hidden;
    None where nobody said it."""

    frame: int
    cuboid: Cuboid | None
    bbox: Box | None = None
    keyframe: bool = True
    box_set: bool = False
    truncation: float | None = None
    occlusion: int | None = None


@dataclass(frozen=True)
class LabelTrack:
    """One vehicle or person over time. label: class name as in ``pipeline.types.VEHICLES`` and COCO. sightings: by
    ascending frame, at most one a frame. comment: what whoever sent it back wants to have looked at. reviewer: who
    found it right, another than who made it; empty while nobody has, and again once it is changed. confidence: of a
    proposal, 0–1, how sure it is a road user at all; None for what nobody asked that of."""

    id: int
    label: str
    sightings: tuple[Sighting, ...]
    state: State
    origin: Origin
    comment: str = ""
    reviewer: str = ""
    confidence: float | None = None
    heading: Heading = ""

    def at(self, frame: int) -> Sighting | None:
        return next((each for each in self.sightings if each.frame == frame), None)


Lead = int | Literal["none", "unknown"]
"""The lead of a frame: a track's id, ``none`` when nothing nearer than ``FARTHEST_LEAD_M`` is in the path, ``unknown``
when one can't tell."""


@dataclass(frozen=True)
class LeadRange:
    """Who is the closest in-path vehicle from frame ``first`` to ``last``, both included. Ranges do not overlap.
    comment, reviewer: as of a track."""

    first: int
    last: int
    lead: Lead
    state: State
    origin: Origin
    comment: str = ""
    reviewer: str = ""


@dataclass(frozen=True)
class PathLabel:
    """The ego path of one frame where the pipeline's is wrong or missing. Lines are ego x, y from the bumper on.
    comment, reviewer: as of a track."""

    frame: int
    left: tuple[Point2, ...] | None
    right: tuple[Point2, ...] | None
    state: State
    origin: Origin
    comment: str = ""
    reviewer: str = ""


@dataclass(frozen=True)
class EventLabel:
    """Something that happens at a frame: ``cut_in``, ``cut_out``, or another word. tracks: who takes part. comment,
    reviewer: as of a track."""

    frame: int
    kind: str
    tracks: tuple[int, ...]
    state: State
    origin: Origin
    comment: str = ""
    reviewer: str = ""


WHOLE_TAG = "all labelled"
"""By this tag a person says that every vehicle of frames is labelled."""


@dataclass(frozen=True)
class FrameTag:
    """A word about the frames ``first`` to ``last``, both included: ``night``, ``rain``, ``sensor dirty``, or
    ``WHOLE_TAG``."""

    first: int
    last: int
    tag: str
    origin: Origin


@dataclass(frozen=True)
class LabelSet:
    """All labels of one recording. source: its URI. frames: the recording's own names of its frames; t_ns: their ticks.
    name: of a frozen version, else ``working``."""

    source: str
    frames: tuple[str, ...]
    t_ns: tuple[int, ...]
    tracks: tuple[LabelTrack, ...] = ()
    leads: tuple[LeadRange, ...] = ()
    paths: tuple[PathLabel, ...] = ()
    events: tuple[EventLabel, ...] = ()
    tags: tuple[FrameTag, ...] = ()
    name: str = "working"
