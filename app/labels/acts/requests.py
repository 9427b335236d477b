"""What a person may do to labels, as it comes in. Numbers are checked here; whether it can be done, in ``acts``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from app.core.request_shapes import CuboidShape, Finite, Meters
from app.labels.acts.request_fields import MOST_FRAMES, Comment, Id, Index, Line, Strict, Word
from app.labels.errors import BadAct
from app.labels.store.values import ItemKind
from app.labels.wording import frames_text
from pipeline.common.errors import BadInput
from pipeline.labels.model import Sighting
from pipeline.labels.validate import check_sighting
from pipeline.types import Point2

_MOST_ITEMS = 10_000


class Placed(Strict):
    """Where something is in one frame. bbox: x1 y1 x2 y2 in pixels of the raw image. box_set: the person set it;
    else it follows the cuboid."""

    frame: Index
    cuboid: CuboidShape | None = None
    bbox: tuple[Finite, Finite, Finite, Finite] | None = None
    box_set: bool = False

    def sighting(self) -> Sighting:
        """As a keyframe. BadAct for a box that is none, or when nothing is there."""
        if self.cuboid is None and self.bbox is None:
            raise BadAct("provide a cuboid or a box")
        cuboid = self.cuboid.value() if self.cuboid else None
        sighting = Sighting(self.frame, cuboid, self.bbox, box_set=self.box_set and self.bbox is not None)
        try:
            return check_sighting(sighting, frames_text(self.frame))
        except BadInput as error:
            raise BadAct(str(error)) from None


class Ref(Strict):
    """An item as the person sees it."""

    kind: ItemKind
    id: Id
    revision: Id


class TrackRef(Strict):
    """A track as the person sees it."""

    id: Id
    revision: Id


class _OfItems(Strict):
    items: list[Ref] = Field(min_length=1, max_length=_MOST_ITEMS)


class _OfTrack(Strict):
    track: Id
    revision: Id


class OverFrames(Strict):
    """seen: the revision of the labels that the person saw; what others have said in these frames since is a conflict.
    None says it whatever was said. over_reviewed: what a second person has reviewed there may be cut."""

    seen: Id | None = None
    over_reviewed: bool = False


class Accept(_OfItems):
    """It is so."""

    kind: Literal["accept"]


class Reject(_OfItems):
    """It is not so. It stays known, so that it is not proposed again."""

    kind: Literal["reject"]


class SendBack(_OfItems):
    """Review: tracks are to be looked at again; they carry the comment."""

    kind: Literal["send_back"]
    comment: Comment


class ReviewOk(_OfItems):
    """Review: a second person says that it is so."""

    kind: Literal["review_ok"]


class Remove(_OfItems):
    """Labels that should never have been."""

    kind: Literal["remove"]


class SetSighting(_OfTrack, Placed):
    """A keyframe; with ``interpolate`` the frames around follow."""

    kind: Literal["set_sighting"]
    interpolate: bool = True


class DropKeyframe(_OfTrack):
    """The frame follows its neighbours again."""

    kind: Literal["drop_keyframe"]
    frame: Index


class DropSightings(_OfTrack):
    """The vehicle is not there from first to last."""

    kind: Literal["drop_sightings"]
    first: Index
    last: Index


class SizeAlong(_OfTrack):
    """The same size in every frame, the near side held."""

    kind: Literal["size_along"]
    size: tuple[Meters, Meters, Meters]


class Flip(_OfTrack):
    """It faces the other way, in every frame."""

    kind: Literal["flip"]


class Refit(_OfTrack):
    """The cuboid onto the points in and near it."""

    kind: Literal["refit"]
    frame: Index


class AddTrack(Placed):
    """A vehicle that nobody saw."""

    kind: Literal["add_track"]
    label: Word


class Lift(Strict):
    """A vehicle from where it is in the image: a box around it, or a pixel on it."""

    kind: Literal["lift"]
    frame: Index
    label: Word = "car"
    bbox: tuple[Finite, Finite, Finite, Finite] | None = None
    pixel: tuple[Finite, Finite] | None = None


class AddMeasured(Placed):
    """What a lift comes to: nobody sends it. how: what it was measured by, in words."""

    kind: Literal["lift"]
    label: Word
    how: str


class Relabel(_OfTrack):
    """It is of another class."""

    kind: Literal["relabel"]
    label: Word


class Split(_OfTrack):
    """From a frame on it is another one."""

    kind: Literal["split"]
    frame: Index


class Merge(Strict):
    """Two are one: the first goes on, where both are it is as the first says."""

    kind: Literal["merge"]
    tracks: tuple[TrackRef, TrackRef]


class SetLead(OverFrames):
    """Who leads from first to last, whatever was said there before."""

    kind: Literal["set_lead"]
    first: Index
    last: Index
    lead: Id | Literal["none", "unknown"]


class ClearLead(OverFrames):
    """Nobody has said who leads from first to last."""

    kind: Literal["clear_lead"]
    first: Index
    last: Index


class TrimLead(OverFrames):
    """A range begins or ends elsewhere: it is from first to last now, whatever was said where it was not before."""

    kind: Literal["trim_lead"]
    range: Id
    revision: Id
    first: Index
    last: Index


class SetPath(OverFrames):
    """The ego lane's lines in a frame: ego x, y from the bumper on."""

    kind: Literal["set_path"]
    frame: Index
    left: Line | None
    right: Line | None

    def lines(self) -> tuple[tuple[Point2, ...] | None, tuple[Point2, ...] | None]:
        """BadAct when there is neither."""
        if self.left is None and self.right is None:
            raise BadAct("provide a left or a right line")
        return (
            tuple(self.left) if self.left is not None else None,
            tuple(self.right) if self.right is not None else None,
        )


class RemovePath(OverFrames):
    """The pipeline's path is right after all."""

    kind: Literal["remove_path"]
    frame: Index


class AddEvent(OverFrames):
    """Something happens: ``cut_in``, ``cut_out``, or another word."""

    kind: Literal["add_event"]
    frame: Index
    event: Word
    tracks: list[Id] = Field(default_factory=list, max_length=100)


class Tag(OverFrames):
    """A word about the frames from first to last, or no more."""

    kind: Literal["tag"]
    first: Index
    last: Index
    tag: Word
    on: bool = True


class Propose(Strict):
    """The present run's objects as proposals."""

    kind: Literal["propose"]
    first: Index = 0
    last: Index = MOST_FRAMES
    source: Literal["run"] = Field("run", alias="from")


class Import(Strict):
    """The truth that comes with the recording."""

    kind: Literal["import"]
    what: Literal["truth"] = "truth"


Act = Annotated[
    Accept | Reject | SendBack | ReviewOk | Remove | SetSighting | DropKeyframe | DropSightings | SizeAlong | Flip
    | Refit | AddTrack | Lift | Relabel | Split | Merge | SetLead | ClearLead | TrimLead | SetPath | RemovePath
    | AddEvent | Tag | Propose | Import,
    Field(discriminator="kind"),
]  # fmt: skip
