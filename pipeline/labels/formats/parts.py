"""Counts the parts of a label set and describes those that a format cannot express. All formats use it."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, get_args

from pipeline.labels.model import EventLabel, LabelSet, LabelTrack, LeadRange, PathLabel, Sighting

Part = Literal[
    "cuboids", "boxes", "identities", "leads", "paths", "events", "tags", "states", "origins", "comments",
    "reviews", "keyframes", "name", "attributes",
]  # fmt: skip
"""identities: links between sightings of the same track in several frames. states: proposed, accepted, corrected,
rejected. origins: who made a label, when, how, with which parameters. reviews: who approved it. keyframes: which
sightings were interpolated. name: of a frozen version. attributes: properties of tracks other than their class."""

EVERYTHING: frozenset[Part] = frozenset(get_args(Part))

_SIGHTING: frozenset[Part] = frozenset(("cuboids", "boxes", "keyframes"))
"""A format that supports all of these can also represent a sighting without a shape, and a track without sightings."""

_Marked = LabelTrack | LeadRange | PathLabel | EventLabel


def reduce(labels: LabelSet, holds: frozenset[Part]) -> tuple[LabelSet, tuple[str, ...]]:
    """The labels without unsupported content, and a sentence for each kind of content that is lost.

    If states are not supported, rejected labels are left out, because they would be read as true. Tracks stay unchanged
    if neither cuboids nor boxes are supported: a table may still refer to them.
    """
    lost = [sentence for sentence in _lost(labels, holds) if sentence]
    if "states" not in holds:
        labels = replace(
            labels,
            tracks=tuple(track for track in labels.tracks if track.state != "rejected"),
            leads=tuple(each for each in labels.leads if each.state != "rejected"),
            paths=tuple(each for each in labels.paths if each.state != "rejected"),
            events=tuple(each for each in labels.events if each.state != "rejected"),
        )
    if {"cuboids", "boxes"} & holds:
        labels = replace(labels, tracks=tuple(_with_reduced_sightings(track, holds) for track in labels.tracks))
    return replace(
        labels,
        leads=labels.leads if "leads" in holds else (),
        paths=labels.paths if "paths" in holds else (),
        events=labels.events if "events" in holds else (),
        tags=labels.tags if "tags" in holds else (),
    ), tuple(lost)


def _with_reduced_sightings(track: LabelTrack, holds: frozenset[Part]) -> LabelTrack:
    return replace(track, sightings=tuple(_reduced(each, holds) for each in track.sightings if _has_place(each, holds)))


def _has_place(sighting: Sighting, holds: frozenset[Part]) -> bool:
    """Whether any of it can be represented."""
    if holds >= _SIGHTING:
        return True
    return ("cuboids" in holds and sighting.cuboid is not None) or ("boxes" in holds and sighting.bbox is not None)


def _reduced(sighting: Sighting, holds: frozenset[Part]) -> Sighting:
    """The sighting without unsupported content."""
    cuboid = sighting.cuboid if "cuboids" in holds else None
    bbox = sighting.bbox if "boxes" in holds else None
    is_whole = cuboid is sighting.cuboid and bbox is sighting.bbox
    return sighting if is_whole else replace(sighting, cuboid=cuboid, bbox=bbox)


def _lost(labels: LabelSet, holds: frozenset[Part]) -> list[str]:
    missing = EVERYTHING - holds
    sightings = [each for track in labels.tracks for each in track.sightings]
    counted = {
        "leads": (len(labels.leads), "{} of the lead not written: the format cannot hold them", "range", "ranges"),
        "paths": (len(labels.paths), "{} of the ego path not written: the format cannot hold them", "frame", "frames"),
        "events": (len(labels.events), "{} not written: the format cannot hold them", "event", "events"),
        "tags": (len(labels.tags), "{} not written: the format cannot hold them", "frame tag", "frame tags"),
        "comments": (sum(bool(each.comment) for each in _marked(labels)), "{} not written", "comment", "comments"),
        "reviews": (sum(bool(each.reviewer) for each in _marked(labels)), "{} not written", "review", "reviews"),
    }
    lost = [_count(*counted[part]) for part in counted if part in missing]
    if {"cuboids", "boxes"} <= missing:
        tracks = _count(len(labels.tracks), "{} not written: the format cannot hold them", "track")
        return [tracks, *lost, *_lost_marks(labels, missing)]
    without = sum(not _has_place(each, holds) for each in sightings)
    lost.append(_count(without, "{} not written: the format holds neither of their shapes", "sighting"))
    if not holds >= _SIGHTING:
        lost.append(_count(sum(not t.sightings for t in labels.tracks), "{} without sightings not written", "track"))
    if "cuboids" in missing:
        lost.append(
            _count(
                sum(s.cuboid is not None for s in sightings), "{} not written: the format cannot hold them", "cuboid"
            )
        )
    if "boxes" in missing:
        lost.append(
            _count(
                sum(s.bbox is not None for s in sightings),
                "{} in images not written: the format cannot hold them",
                "box",
            )
        )
    if "identities" in missing:
        lost.append(_count(sum(len(t.sightings) > 1 for t in labels.tracks), "{} lose their identity", "track"))
        lost.append("" if not labels.tracks else "the tracks' numbers are not written: the format cannot hold them")
    if "keyframes" in missing:
        lost.append(
            _count(sum(not s.keyframe for s in sightings), "{} written like keyframes", "interpolated position")
        )
    return lost + _lost_marks(labels, missing)


def _lost_marks(labels: LabelSet, missing: frozenset[Part]) -> list[str]:
    states, lost = [each.state for each in _marked(labels)], []
    if "states" in missing:
        lost.append(
            _count(states.count("rejected"), "{} left out: rejected, and the format has no such state", "label")
        )
        lost.append(
            _count(states.count("proposed"), "{} written as if accepted: nobody has reviewed them yet", "label")
        )
        lost.append(_count(states.count("corrected"), "{} written like accepted ones", "corrected label"))
    if "origins" in missing and (labels.tracks or labels.leads):
        lost.append("who made each label, when and with which parameters is not written")
    if "attributes" in missing:
        said = sum(len(track.attributes) for track in labels.tracks)
        lost.append(_count(said, "{} not written: the format cannot hold them", "attribute"))
    if "name" in missing and labels.name != "working":
        lost.append(f"the version's name {labels.name!r} is not written")
    return lost


def _marked(labels: LabelSet) -> tuple[_Marked, ...]:
    return (*labels.tracks, *labels.leads, *labels.paths, *labels.events)


def _count(count: int, sentence: str, one: str, many: str = "") -> str:
    """The sentence with a number and its noun; empty if the number is zero."""
    plural = many or (f"{one}es" if one.endswith("x") else f"{one}s")
    return sentence.format(f"{count:,} {one if count == 1 else plural}") if count else ""
