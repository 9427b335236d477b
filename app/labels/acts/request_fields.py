"""Fields of label requests: numbers, names and words from users, validated and cleaned."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from app.core.request_shapes import CuboidShape, Finite
from app.labels.errors import BadAct
from app.labels.store.values import LONGEST_NAME, ItemKind
from app.labels.wording import frames_text
from pipeline.common.errors import BadInput
from pipeline.labels.model import Sighting
from pipeline.labels.validate import check_sighting

_LARGEST_ID = 2**63 - 1
MOST_FRAMES = 2**31 - 1
_MOST_POINTS = 1000
_MOST_ITEMS = 10_000


def clean(text: str) -> str:
    """The text on one line, without characters that a terminal or page would interpret."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def _named(text: str) -> str:
    cleaned = clean(text)
    if not cleaned:
        raise ValueError("a name is needed")
    return cleaned


def _commented(text: str) -> str:
    cleaned = clean(text)
    if not cleaned:
        raise ValueError("a comment is needed: say what to check")
    return cleaned


Id = Annotated[int, Field(ge=0, le=_LARGEST_ID)]
Index = Annotated[int, Field(ge=0, le=MOST_FRAMES)]
Person = Annotated[str, Field(max_length=LONGEST_NAME), AfterValidator(_named)]
PersonOrNobody = Annotated[str, Field(max_length=LONGEST_NAME), AfterValidator(clean)]
"""Cleaned in the same way as ``Person``, so that both give the same name; empty if anonymous."""
Word = Annotated[str, Field(max_length=40), AfterValidator(_named)]
Comment = Annotated[str, Field(max_length=1000), AfterValidator(_commented)]
Line = Annotated[list[tuple[Finite, Finite]], Field(min_length=2, max_length=_MOST_POINTS)]


class Strict(BaseModel):
    """A model without additional keys."""

    model_config = ConfigDict(extra="forbid", use_attribute_docstrings=True)


class Placed(Strict):
    """A position in one frame."""

    frame: Index
    """Of the drive, from 0."""
    cuboid: CuboidShape | None = None
    """In the ego frame; None where it is only seen in the image."""
    bbox: tuple[Finite, Finite, Finite, Finite] | None = None
    """x1 y1 x2 y2 in pixels of the raw image; None where it is outside."""
    box_set: bool = False
    """Whether the person set the box; else it follows the cuboid."""

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
    """An item, in the revision that the person saw."""

    kind: ItemKind
    """Numbers are unique within a kind only."""
    id: Id
    """Of the item among those of its kind."""
    revision: Id
    """As the person saw it; a newer one in the database is a conflict."""


class TrackRef(Strict):
    """A track, in the revision that the person saw."""

    id: Id
    """Of the track in this drive."""
    revision: Id
    """As the person saw it; a newer one in the database is a conflict."""


class OfItems(Strict):
    """An act on items of any kind."""

    items: list[Ref] = Field(min_length=1, max_length=_MOST_ITEMS)
    """Each as the person saw it: one newer item refuses the whole act."""


class OfTrack(Strict):
    """An act on one track."""

    track: Id
    """Its number in this drive."""
    revision: Id
    """As the person saw the track; a newer one in the database is a conflict."""


class OverFrames(Strict):
    """An act on a range of frames."""

    seen: Id | None = None
    """The revision of the labels that the person saw; what others have changed in these frames since is a conflict.
    None overrides whatever they did."""
    over_reviewed: bool = False
    """Whether what a second person has reviewed there may be cut."""
