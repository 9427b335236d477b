"""The truth that comes with a recording, as labels: Astyx and KITTI folders, the simulator, sessions made of them."""

from __future__ import annotations

from collections.abc import Callable

from pipeline.labels.link import linked
from pipeline.labels.model import LabelSet, LabelTrack, Origin, Sighting
from pipeline.sources.base import Source, TruthObject
from pipeline.vision.labels import canonical


def truth_labels(
    source: Source,
    frames: tuple[str, ...],
    origin: Origin,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[LabelSet, tuple[str, ...]]:
    """(labels, what is to be said of them). frames: the names of the recording's frames.

    Objects that have an id are a track each over all frames; those without are linked over frames by nearness.
    """
    known: dict[int, tuple[str, list[Sighting]]] = {}
    alone: dict[int, tuple[TruthObject, ...]] = {}
    labelled = 0
    stamps = tuple(source.t_ns(index) for index in range(len(frames)))
    for index in range(len(frames)):
        truth = source.truth(index)
        labelled += truth is not None
        for each in truth or ():
            if each.id is not None and each.id >= 0:
                _add(each, each.id, index, known)
        alone[index] = tuple(each for each in truth or () if each.id is None or each.id < 0)
        progress(index + 1, len(frames))
    links = linked({stamps[index]: objects for index, objects in alone.items() if objects})
    first = max(known, default=0)
    for index, objects in alone.items():
        for each in links[stamps[index]] if objects else ():
            _add(each, first + (each.id or 0), index, known)
    labels = LabelSet(
        source.uri,
        frames,
        stamps,
        tuple(
            LabelTrack(number, label, tuple(sightings), "accepted", origin)
            for number, (label, sightings) in sorted(known.items())
        ),
    )
    return labels, tuple(_notes(labelled, len(frames), any(alone.values())))


def _add(each: TruthObject, number: int, index: int, known: dict[int, tuple[str, list[Sighting]]]) -> None:
    sightings = known.setdefault(number, (canonical(each.label), []))[1]
    if not sightings or sightings[-1].frame < index:
        sightings.append(Sighting(index, each.cuboid))


def _notes(labelled: int, count: int, is_linked: bool) -> list[str]:
    notes = []
    if labelled < count:
        notes.append(f"{count - labelled} of {count} frames are not labelled")
    if is_linked:
        notes.append("the labels follow no identities over time: vehicles are linked over frames by nearness")
    return notes
