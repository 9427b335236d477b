"""Sets a project up: opens its recordings, checks its control frames, and puts the sampled frames into the queue."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, cast

from app.labels.projects.control import has_labels, pack_truth, within
from app.labels.projects.project_file import ControlEntry, ProjectFile
from app.labels.projects.sampling import SampledDrive, sample
from app.labels.projects.store import ControlSpan, put_project
from app.labels.store.database import Database
from app.labels.store.drive_labels import DriveLabels, info_of
from app.labels.store.frame_ranges import free_spans, outside
from app.labels.store.work import doubt, is_unclear
from pipeline.common.errors import BadInput
from pipeline.labels.model import COUNTED_STATES, NEXT_TAG, FrameTag, LabelSet, LeadRange, Origin
from pipeline.sources import open_source

if TYPE_CHECKING:
    from app.labels.store.draft import Draft


def set_up(database: Database, file: ProjectFile, person: str) -> Iterator[str]:
    """Store a project and tag its frames; yields a note after each step. Everything is checked before anything is
    stored: BadInput, in one sentence, for a recording that cannot be opened or truth that does not belong to it."""
    entries, drives = file.entries, {}
    for address in entries.drives:
        drives[address] = _opened(database, address)
        yield f"{address}: {len(drives[address].info.t_ns):,} frames"
    by_key = {labels.info.key: labels for labels in drives.values()}
    if len(by_key) < len(drives):
        raise BadInput(f"{entries.name}: two of the drives are the same recording")
    control = [
        _span(entry, drives[entry.drive], truth) for entry, truth in zip(entries.control, file.truths, strict=True)
    ]
    put_project(database, file, list(by_key), control, person)
    if entries.sampling is None:
        return
    chosen = sample(entries.sampling, [_sampled(labels) for labels in by_key.values()])
    origin = Origin("pipeline", f"{entries.name}: {entries.sampling.text}", int(time.time() * 1000))
    for key, labels in by_key.items():
        labels.log.act("tag", person, _tagging(entries.name, chosen[key], origin))
    yield f"{sum(map(len, chosen.values())):,} frames to label: {entries.sampling.text}"


def _opened(database: Database, address: str) -> DriveLabels:
    source = open_source(address)
    count = len(source)
    return DriveLabels(database, info_of(source, lambda: tuple(map(str, range(count)))))


def _span(entry: ControlEntry, labels: DriveLabels, truth: LabelSet) -> ControlSpan:
    if truth.t_ns != labels.info.t_ns:
        raise BadInput(f"{entry.truth}: these labels are of another recording than {entry.drive}")
    first, last = (entry.first or 1) - 1, (entry.last or len(truth.t_ns)) - 1
    if last >= len(truth.t_ns):
        raise BadInput(f"{entry.drive}: control frames up to {last + 1}, but it has {len(truth.t_ns)}")
    if not has_labels(within(truth, first, last)):
        raise BadInput(f"{entry.truth}: no accepted labels in frames {first + 1} to {last + 1}")
    return ControlSpan(labels.info.key, first, last, pack_truth(truth, first, last))


def _sampled(labels: DriveLabels) -> SampledDrive:
    """With the worth of each frame, as in the queue."""
    worth: dict[int, float] = {}
    for track in labels.unnamed_set().tracks:
        for each in track.sightings if doubt(track) > 0 else ():
            worth[each.frame] = worth.get(each.frame, 0.0) + doubt(track)
    for lead in _leads(labels):
        for frame in range(lead.first, lead.last + 1) if is_unclear(lead) else ():
            worth[frame] = worth.get(frame, 0.0) + 1.0
    return SampledDrive(labels.info.key, labels.info.t_ns, worth)


def _tagging(project: str, frames: list[int], origin: Origin) -> Callable[[Draft], str]:
    """An act that replaces the earlier sample of the project. Frames of that sample that are labelled stay in it, so
    that a changed sampling does not lose progress."""

    def tag(draft: Draft) -> str:
        leads = [cast("LeadRange", item.value) for item in draft.all("lead").values()]
        said = {n for each in leads if each.state in COUNTED_STATES for n in range(each.first, each.last + 1)}
        others: set[int] = set()
        for number, item in draft.all("tag").items():
            old = cast("FrameTag", item.value)
            if old.tag != NEXT_TAG:
                continue
            if not old.origin.name.startswith(f"{project}: "):
                others.update(range(old.first, old.last + 1))
                continue
            kept = [old]
            for first, last in free_spans(old.first, old.last, said):
                kept = [part for each in kept for part in outside(each, first, last)]
            others.update(n for each in kept for n in range(each.first, each.last + 1))
            draft.put("tag", number, kept[0] if kept else None)
            for part in kept[1:]:
                draft.add("tag", part)
        new = set(frames) - others
        for first, last in free_spans(0, max(new, default=-1), set(range(max(new, default=-1) + 1)) - new):
            draft.add("tag", FrameTag(first, last, NEXT_TAG, origin))
        return f"asked for labels of {len(frames)} frames"

    return tag


def _leads(labels: DriveLabels) -> list[LeadRange]:
    return [cast("LeadRange", item.value) for item in labels.items("lead").values()]
