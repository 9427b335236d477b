"""The context that every act needs besides the labels."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TypeVar, cast

from app.labels.errors import BadAct
from app.labels.store.draft import Draft
from app.labels.store.values import Item
from app.labels.wording import outside_text
from pipeline.labels.classes import ClassList, default_classes
from pipeline.labels.model import EventLabel, LabelTrack, LeadRange, Origin, PathLabel

Stated = LabelTrack | LeadRange | PathLabel | EventLabel
S = TypeVar("S", LabelTrack, LeadRange, PathLabel, EventLabel)


@dataclass(frozen=True)
class Scope:
    """The drive that an act applies to."""

    t_ns: tuple[int, ...]
    """Ticks of all its frames, for interpolation over time."""
    classes: ClassList = field(default_factory=default_classes)
    """Classes available in the project."""

    def check(self, first: int, last: int | None = None) -> None:
        """BadAct for frames outside the recording."""
        count, last = len(self.t_ns), first if last is None else last
        if not 0 <= first <= last < count:
            raise BadAct(outside_text(first, last, count))


def by_person(draft: Draft, how: str = "") -> Origin:
    """how: the measurement, if the person only pointed at the object."""
    return Origin("person", draft.person, draft.t_unix_ms, how=how)


def track_of(draft: Draft, number: int, revision: int | None = None) -> LabelTrack:
    """A track by its id. NoSuchLabel if it does not exist; with ``revision``, Stale if it has changed since."""
    return cast("LabelTrack", draft.get("track", number, revision).value)


def corrected(draft: Draft, track: LabelTrack, *, placed: bool = False) -> None:
    """Mark a track as changed by a person: it is no longer a proposal, the person becomes its author, and earlier
    reviews are void. placed: it was positioned by hand. Until then, a measured position keeps its origin."""
    how = "" if placed else track.origin.how
    state = track.state if how else "corrected"
    draft.put(
        "track", track.id, replace(track, state=state, origin=by_person(draft, how), reviewer="", confidence=None)
    )


def stated(item: Item) -> Stated:
    """Its value, which must have a state. BadAct for a tag."""
    if item.kind == "tag":
        raise BadAct("tags cannot be accepted or rejected")
    return cast("Stated", item.value)
