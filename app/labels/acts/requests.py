"""Requests to change labels. Values are validated here; ``acts`` decides whether the change is possible."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from app.core.request_shapes import Finite, Meters
from app.labels.acts.request_fields import (
    MOST_FRAMES,
    Comment,
    Id,
    Index,
    Line,
    OfItems,
    OfTrack,
    OverFrames,
    Placed,
    Strict,
    TrackRef,
    Word,
)
from app.labels.errors import BadAct
from pipeline.types import Point2


class Accept(OfItems):
    """Accept labels."""

    kind: Literal["accept"]


class Reject(OfItems):
    """Reject labels. They stay in the database, so that they are not proposed again."""

    kind: Literal["reject"]


class SendBack(OfItems):
    """Review: send labels back to be corrected, with a comment."""

    kind: Literal["send_back"]
    comment: Comment
    """What is wrong, for whoever corrects it."""


class ReviewOk(OfItems):
    """Review: approve labels as a second person."""

    kind: Literal["review_ok"]


class Remove(OfItems):
    """Delete labels."""

    kind: Literal["remove"]


class ClearAll(Strict):
    """Remove all labels, so that a second person can label the recording independently. Frames that are queued for
    labeling stay queued."""

    kind: Literal["clear_all"]
    revision: Id
    """Number of the last act that its author has seen; after a later one, it is refused."""


class SetSighting(OfTrack, Placed):
    """Set a keyframe; with ``interpolate`` the frames around it follow."""

    kind: Literal["set_sighting"]
    interpolate: bool = True
    """Whether the frames up to the neighbouring keyframes follow."""


class DropKeyframe(OfTrack):
    """Remove a keyframe; the frame is interpolated again."""

    kind: Literal["drop_keyframe"]
    frame: Index
    """Whose keyframe goes."""


class DropSightings(OfTrack):
    """Remove a track from a range of frames."""

    kind: Literal["drop_sightings"]
    first: Index
    """First frame that loses its sighting."""
    last: Index
    """Last such frame, inclusive."""


class SizeAlong(OfTrack):
    """Give a track the same size in every frame; its near side stays in place."""

    kind: Literal["size_along"]
    size: tuple[Meters, Meters, Meters]
    """Length, width, height."""


class Flip(OfTrack):
    """Reverse a track's heading in every frame."""

    kind: Literal["flip"]


class Refit(OfTrack):
    """Fit a cuboid to the points in and near it."""

    kind: Literal["refit"]
    frame: Index
    """Whose points decide."""


class Propagate(OfTrack):
    """Carry a track on beyond its ends, as far as its points are found."""

    kind: Literal["propagate"]
    way: Literal["both", "forward", "backward"] = "both"
    """In time."""


class AddTrack(Placed):
    """Add a vehicle that was not proposed."""

    kind: Literal["add_track"]
    label: Word
    """Class of the vehicle."""


class Lift(Strict):
    """Add a vehicle by its place in the image: a box around it, or a pixel on it."""

    kind: Literal["lift"]
    frame: Index
    """Whose image was clicked."""
    label: Word = "car"
    """Class of the vehicle; decides how large it is taken to be."""
    bbox: tuple[Finite, Finite, Finite, Finite] | None = None
    """x1 y1 x2 y2 in pixels of the raw image; None when ``pixel`` is given."""
    pixel: tuple[Finite, Finite] | None = None
    """x, y in the raw image; None when ``bbox`` is given."""


class Relabel(OfTrack):
    """Change a track's class."""

    kind: Literal["relabel"]
    label: Word
    """The new class."""


class SetAttribute(OfTrack):
    """Set or clear an attribute of a track over a range of frames."""

    kind: Literal["set_attribute"]
    name: Word
    """Of the attribute, as in the class list."""
    value: Word | None
    """One of the attribute's values; None clears it."""
    first: Index
    """First frame of the range."""
    last: Index
    """Last frame of the range, inclusive."""


class Split(OfTrack):
    """Split a track in two at a frame."""

    kind: Literal["split"]
    frame: Index
    """First frame of the second track."""


class Merge(Strict):
    """Merge two tracks. In frames that have both, the first one's sighting is kept."""

    kind: Literal["merge"]
    tracks: tuple[TrackRef, TrackRef]
    """The one that goes on, then the one that becomes part of it."""


class SetLead(OverFrames):
    """Set the lead in a range of frames, replacing what was labelled there."""

    kind: Literal["set_lead"]
    first: Index
    """First frame of the range."""
    last: Index
    """Last frame, inclusive."""
    lead: Id | Literal["none", "unknown"]
    """Track that leads; ``none`` when nobody does, ``unknown`` when it cannot be told."""


class ClearLead(OverFrames):
    """Clear the lead in a range of frames."""

    kind: Literal["clear_lead"]
    first: Index
    """First frame of the range."""
    last: Index
    """Last frame, inclusive."""


class TrimLead(OverFrames):
    """Move the ends of a lead range; frames that it gains are overwritten."""

    kind: Literal["trim_lead"]
    range: Id
    """Number of the lead range that changes."""
    revision: Id
    """As the person saw it; a newer one in the database is a conflict."""
    first: Index
    """Its new first frame."""
    last: Index
    """Its new last frame, inclusive."""


class SetPath(OverFrames):
    """Draw the borders of the ego lane in a frame: ego x, y from the bumper outwards."""

    kind: Literal["set_path"]
    frame: Index
    """The only frame that the lines hold in."""
    left: Line | None
    """From near to far; None where the lane has no left line."""
    right: Line | None
    """From near to far; None where the lane has no right line."""

    def lines(self) -> tuple[tuple[Point2, ...] | None, tuple[Point2, ...] | None]:
        """BadAct if both are missing."""
        if self.left is None and self.right is None:
            raise BadAct("provide a left or a right line")
        return (
            tuple(self.left) if self.left is not None else None,
            tuple(self.right) if self.right is not None else None,
        )


class RemovePath(OverFrames):
    """Remove a drawn path; the pipeline's applies again."""

    kind: Literal["remove_path"]
    frame: Index
    """Whose labelled path goes."""


class AddEvent(OverFrames):
    """Add an event: ``cut_in``, ``cut_out``, or another word."""

    kind: Literal["add_event"]
    frame: Index
    """When it happens; a range of frames is two events."""
    event: Word
    """Free text besides the two known kinds."""
    tracks: list[Id] = Field(default_factory=list, max_length=100)
    """Who takes part; may be empty."""


class Tag(OverFrames):
    """Add a tag to a range of frames, or remove it from them."""

    kind: Literal["tag"]
    first: Index
    """First frame of the range."""
    last: Index
    """Last frame, inclusive."""
    tag: Word
    """Free text, such as ``night``."""
    on: bool = True
    """False takes the word away from these frames."""


class Propose(Strict):
    """Propose the current run's objects as labels."""

    kind: Literal["propose"]
    first: Index = 0
    """First frame to propose for."""
    last: Index = MOST_FRAMES
    """Last frame, inclusive; beyond the drive means to its end."""
    source: Literal["run"] = Field("run", alias="from")
    """Only the present run proposes so far."""


class Import(Strict):
    """Import the ground truth that comes with the recording."""

    kind: Literal["import"]
    what: Literal["truth"] = "truth"
    """Only the recording's own truth so far; files are uploaded."""


Act = Annotated[
    Accept | Reject | SendBack | ReviewOk | Remove | ClearAll | SetSighting | DropKeyframe | DropSightings | SizeAlong
    | Flip | Refit | Propagate | AddTrack | Lift | Relabel | SetAttribute | Split | Merge | SetLead | ClearLead
    | TrimLead | SetPath | RemovePath | AddEvent | Tag | Propose | Import,
    Field(discriminator="kind"),
]  # fmt: skip
