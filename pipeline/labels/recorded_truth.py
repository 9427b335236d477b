"""The ground truth of a recording as labels: Astyx and KITTI folders, the simulator, and sessions made from them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence

from pipeline.labels.link_identities import linked
from pipeline.labels.model import LabelSet, LabelTrack, Origin, Sighting
from pipeline.types.source import Source, TruthObject
from pipeline.vision.classes import canonical

LINKED = "the labels have no identities over time: vehicles are linked from frame to frame by distance"


def truth_labels(
    source: Source,
    frames: tuple[str, ...],
    origin: Origin,
    progress: Callable[[int, int], object] = lambda done, total: None,
) -> tuple[LabelSet, tuple[str, ...]]:
    """(labels, notes about them). frames: the names of the recording's frames."""
    stamps = tuple(source.t_ns(index) for index in range(len(frames)))
    objects: dict[int, tuple[TruthObject, ...]] = {}
    for index in range(len(frames)):
        truth = source.truth(index)
        if truth is not None:
            objects[index] = truth
        progress(index + 1, len(frames))
    labels = LabelSet(source.uri, frames, stamps, tracks_of(objects, stamps, origin))
    return labels, tuple(_notes(objects, len(frames)))


def tracks_of(
    objects: Mapping[int, tuple[TruthObject, ...]], t_ns: Sequence[int], origin: Origin
) -> tuple[LabelTrack, ...]:
    """Labelled objects of frames as accepted tracks. t_ns: of all frames of the recording.

    Objects with an id become one track over all frames; those without are linked over frames by distance.
    """
    known: dict[int, tuple[str, list[Sighting]]] = {}
    for index, found in sorted(objects.items()):
        for each in found:
            if _has_id(each):
                _add(each, each.id or 0, index, known)
    links = linked({t_ns[index]: alone for index, found in objects.items() if (alone := _without_id(found))})
    first = max(known, default=0)
    for index, found in sorted(objects.items()):
        for each in links[t_ns[index]] if _without_id(found) else ():
            _add(each, first + (each.id or 0), index, known)
    return tuple(
        LabelTrack(number, label, tuple(sightings), "accepted", origin)
        for number, (label, sightings) in sorted(known.items())
    )


def renamed(kinds: Iterable[tuple[str, str]]) -> list[str]:
    """A sentence for each label name that maps to another class here. kinds: name and class of each object."""
    return [f"{count:,} {kind} are read as class {label!r}" for (kind, label), count in sorted(Counter(kinds).items())]


def _has_id(each: TruthObject) -> bool:
    return each.id is not None and each.id >= 0


def _without_id(objects: tuple[TruthObject, ...]) -> tuple[TruthObject, ...]:
    return tuple(each for each in objects if not _has_id(each))


def _add(each: TruthObject, number: int, index: int, known: dict[int, tuple[str, list[Sighting]]]) -> None:
    sightings = known.setdefault(number, (canonical(each.label), []))[1]
    if not sightings or sightings[-1].frame < index:
        box_set = each.bbox is not None
        sightings.append(
            Sighting(
                index, each.cuboid, each.bbox, box_set=box_set, truncation=each.truncation, occlusion=each.occlusion
            )
        )


def _notes(objects: Mapping[int, tuple[TruthObject, ...]], count: int) -> list[str]:
    notes = [f"{count - len(objects)} of {count} frames are not labelled"] if len(objects) < count else []
    every = [each for found in objects.values() for each in found]
    if not all(map(_has_id, every)):
        notes.append(LINKED)
    return notes + renamed((each.called, each.label) for each in every if each.called)
