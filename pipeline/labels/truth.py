"""The truth that comes with a recording, as labels: Astyx and KITTI folders, the simulator, sessions made of them."""

from __future__ import annotations

from collections.abc import Callable

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

    Objects that have an id are a track each over all frames; one without is a track of its own in each frame.
    """
    known: dict[int, tuple[str, list[Sighting]]] = {}
    alone: list[tuple[str, Sighting]] = []
    labelled = 0
    for index in range(len(frames)):
        truth = source.truth(index)
        labelled += truth is not None
        for each in truth or ():
            _add(each, index, known, alone)
        progress(index + 1, len(frames))
    tracks = [(number, label, tuple(sightings)) for number, (label, sightings) in sorted(known.items())]
    first = max(known, default=0) + 1
    tracks += [(first + place, label, (sighting,)) for place, (label, sighting) in enumerate(alone)]
    stamps = tuple(source.t_ns(index) for index in range(len(frames)))
    labels = LabelSet(
        source.uri,
        frames,
        stamps,
        tuple(LabelTrack(number, label, sightings, "accepted", origin) for number, label, sightings in tracks),
    )
    return labels, tuple(_notes(labelled, len(frames), len(alone)))


def _add(
    each: TruthObject, index: int, known: dict[int, tuple[str, list[Sighting]]], alone: list[tuple[str, Sighting]]
) -> None:
    sighting, label = Sighting(index, each.cuboid), canonical(each.label)
    if each.id is None or each.id < 0:
        alone.append((label, sighting))
        return
    sightings = known.setdefault(each.id, (label, []))[1]
    if not sightings or sightings[-1].frame < index:
        sightings.append(sighting)


def _notes(labelled: int, count: int, alone: int) -> list[str]:
    notes = []
    if labelled < count:
        notes.append(f"{count - labelled} of {count} frames are not labelled")
    if alone:
        notes.append("no identities over time: each object of each frame is a track of its own")
    return notes
