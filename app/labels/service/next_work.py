"""Finds the next frame to work on: without a lead, with a proposal, sent back, not reviewed, or judged differently."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, cast

from app.drive.full_run import DriveRun
from app.labels.store.values import KINDS, Item, ItemKind
from app.labels.wording import lead_text
from pipeline.evaluation.lead_verdict import Judged
from pipeline.labels.model import COUNTED_STATES, NEXT_TAG, EventLabel, FrameTag, LabelTrack, LeadRange, PathLabel

if TYPE_CHECKING:
    from app.labels.service.scoring import LabelScores
    from app.labels.store.drive_labels import DriveLabels, LabelSetChanges

What = Literal["unlabelled", "asked", "disagreement", "proposed", "sent_back", "unreviewed"]
LabelKey = tuple[ItemKind, int]
"""Kind and id of a label."""
_NOTHING: dict[What, str] = {
    "unlabelled": "the lead is labelled in every frame there",
    "asked": "no frames there are queued for labeling",
    "disagreement": "the pipeline and the accepted labels agree there",
    "proposed": "no proposals there",
    "sent_back": "no labels sent back there",
    "unreviewed": "no labels from others to review there",
}


@dataclass(frozen=True)
class WorkPlace:
    """A frame with something to do."""

    frame: int
    """Of the drive, from 0."""
    why: str
    """What is to do there, in words."""
    item: LabelKey | None = None
    """The label concerned, if it is a single one."""


@dataclass(frozen=True)
class Asked:
    """A request for the next piece of work."""

    what: What
    """Kind of work looked for."""
    frame: int
    """Where the person is now."""
    direction: int
    """1 forwards, -1 backwards."""
    person: str = ""
    """The person who asks, because nobody reviews their own labels."""
    after: LabelKey | None = None
    """If the frame has several labels, the one that was just handled; None to go beyond the frame."""


def where_next(
    labels: DriveLabels, scores: LabelScores, run: DriveRun | None, asked: Asked
) -> tuple[WorkPlace | None, str, int]:
    """(the nearest place, the reason or why there is none, number of such places in the drive)."""
    places = _places(labels, scores, run, asked)
    here, way = _order(WorkPlace(asked.frame, "", asked.after)), 1 if asked.direction > 0 else -1
    ahead = [
        each
        for each in places
        if (each.frame != asked.frame or asked.after is not None)
        and (_order(each) > here if way > 0 else _order(each) < here)
    ]
    if not ahead:
        blind = _unjudged(labels, scores, run) if asked.what == "disagreement" and not places else ""
        return None, blind or _NOTHING[asked.what], len(places)
    found = min(ahead, key=_order) if way > 0 else max(ahead, key=_order)
    return found, found.why, len(places)


def _order(place: WorkPlace) -> tuple[int, int, int]:
    kind, number = place.item if place.item is not None else (None, 0)
    return place.frame, KINDS.index(kind) if kind is not None else 0, number


def _places(labels: DriveLabels, scores: LabelScores, run: DriveRun | None, asked: Asked) -> Sequence[WorkPlace]:
    if asked.what == "unlabelled":
        return _unlabelled(labels)
    if asked.what == "asked":
        return _asked(labels)
    if asked.what == "disagreement":
        return _disagreements(labels, scores, run)
    if asked.what == "unreviewed":
        return _unreviewed(labels, asked.person)
    return _waiting(labels, sent_back=asked.what == "sent_back")


def _unlabelled(labels: DriveLabels) -> list[WorkPlace]:
    """Frames without a label by a person; proposals do not count."""
    said: set[int] = set()
    proposed: set[int] = set()
    for lead in _leads(labels):
        if lead.state != "rejected":
            (proposed if lead.state == "proposed" else said).update(range(lead.first, lead.last + 1))
    return [
        WorkPlace(index, "lead only proposed" if index in proposed else "lead not labelled")
        for index in range(len(labels.info.t_ns))
        if index not in said
    ]


def _asked(labels: DriveLabels) -> list[WorkPlace]:
    """Starts of requested frame ranges whose lead is not labelled."""
    unlabelled = {place.frame for place in _unlabelled(labels)}
    tags = sorted((cast("FrameTag", item.value) for item in labels.items("tag").values()), key=lambda tag: tag.first)
    return [
        WorkPlace(first, f"queued: {tag.origin.name}")
        for tag in tags
        if tag.tag == NEXT_TAG
        and (first := next((n for n in range(tag.first, tag.last + 1) if n in unlabelled), None)) is not None
    ]


def _waiting(labels: DriveLabels, *, sent_back: bool) -> list[WorkPlace]:
    """Starts of labels that are proposed, or were sent back."""
    places = []
    for frame, item in _begun(labels.changes()):
        value = item.value
        if isinstance(value, FrameTag) or value.state != "proposed" or (sent_back and not value.comment):
            continue
        why = f"{_name(item)}: {value.comment}" if value.comment else f"{_name(item)} is proposed"
        places.append(WorkPlace(frame, why, (item.kind, item.id)))
    return places


def _unreviewed(labels: DriveLabels, person: str) -> list[WorkPlace]:
    """Starts of accepted labels that no second person has reviewed; their author does not review them."""
    found = labels.changes()
    places = []
    for frame, item in _begun(found):
        value = item.value
        if isinstance(value, FrameTag) or value.state not in COUNTED_STATES or value.reviewer:
            continue
        author = found.authors.get((item.kind, item.id), "")
        if not person or person != author:
            places.append(WorkPlace(frame, f"{_name(item)} by {author or value.origin.name}", (item.kind, item.id)))
    return places


def _begun(found: LabelSetChanges) -> Iterable[tuple[int, Item]]:
    """Every label, with its first frame."""
    for item in found.items:
        value = item.value
        if isinstance(value, LabelTrack):
            if item.id in found.extents:
                yield found.extents[item.id][0], item
        elif isinstance(value, LeadRange | FrameTag):
            yield value.first, item
        else:
            yield value.frame, item


def _name(item: Item) -> str:
    value = item.value
    if isinstance(value, LeadRange):
        return f"the lead {lead_text(value.lead)}"
    if isinstance(value, PathLabel):
        return "the path"
    return value.kind if isinstance(value, EventLabel) else f"#{item.id}"


def _disagreements(labels: DriveLabels, scores: LabelScores, run: DriveRun | None) -> list[WorkPlace]:
    from app.labels.service.scoring import disagreements  # imported with the first request

    score = scores.score(labels, run) if run is not None else None
    if run is None or score is None:
        return []
    rows, leads = run.rows(), list(_leads(labels))
    return [
        WorkPlace(index, _otherwise(each, rows[index].cipv_id, leads, index)) for index, each in disagreements(score)
    ]


def _unjudged(labels: DriveLabels, scores: LabelScores, run: DriveRun | None) -> str:
    """Why no disagreements can be found; empty if they can."""
    score = scores.score(labels, run) if run is not None else None
    if score is not None and any(frame.judged is not None for frame in score.frames):
        return ""
    _, truth = scores.truth(labels)
    return " ".join(("no frame is scored:", *(truth.notes[:1] if truth is not None else ("nothing is accepted yet",))))


def _otherwise(judged: Judged, cipv: int | None, leads: Iterable[LeadRange], index: int) -> str:
    lead = next((each.lead for each in leads if each.first <= index <= each.last and each.state != "rejected"), None)
    says = f"#{lead}" if isinstance(lead, int) else "none" if judged.verdict == "false" else "another"
    ours = f"#{cipv}" if cipv is not None else "none"
    beside = f", {judged.error_m:+.1f} m off" if judged.error_m is not None else ""
    return f"the pipeline says {ours}{beside}, the labels say {says}"


def _leads(labels: DriveLabels) -> Iterable[LeadRange]:
    return (cast("LeadRange", item.value) for item in labels.items("lead").values())
