"""Acts that affect a whole drive: proposals of the current run, and imported labels."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import cast

from app.drive.full_run import DriveRun
from app.drive.open_recording import OpenRecording
from app.drive.run_results import moments_of, seen_of
from app.labels.acts.around import sweeps_of
from app.labels.acts.leads import clear
from app.labels.acts.tags import put_tag
from app.labels.errors import ActRefused
from app.labels.store.draft import Draft
from app.labels.store.drive_labels import DriveLabels
from app.labels.store.frame_ranges import free_spans
from app.labels.tasks import TaskWork
from app.labels.wording import frames_text, outside_text
from pipeline.common.progress import Progress, silent
from pipeline.labels.cuboids.refine import refined
from pipeline.labels.headings import own_poses
from pipeline.labels.model import EventLabel, LabelSet, LabelTrack, LeadRange, Origin, PathLabel, Sighting
from pipeline.labels.propose import Proposals, known_as, propose
from pipeline.labels.recorded_truth import truth_labels

_ALL = 100
"""Percent."""


def proposing(labels: DriveLabels, recording: OpenRecording, person: str, first: int, last: int) -> TaskWork:
    """The current run's objects in frames first … last as proposals. ActRefused if the run has not got that far."""
    run = recording.runs.current
    last = min(last, recording.setup.total - 1)
    if run is None or run.done <= last:
        done = run.done if run is not None else 0
        raise ActRefused(f"{done} of {last + 1} frames are computed: wait for the rest")
    if first > last:
        raise ActRefused(outside_text(first, last, recording.setup.total))

    def work(progress: Progress) -> str:
        progress(0, _ALL)
        found = _proposals(recording, run, first, last, lambda done, total: progress(_ALL * done // (total + 1), _ALL))
        said = put_proposals(labels, found, person, first, last, lambda *_: progress(_ALL - 1, _ALL))
        progress(_ALL, _ALL)
        return said

    return work


def put_proposals(
    labels: DriveLabels, found: Proposals, person: str, first: int, last: int, progress: Progress = silent
) -> str:
    """Store proposals in the labels of a drive, as one act; returns a sentence with the outcome. Nothing is written if
    ``progress`` raises."""
    counts: list[int] = []

    def apply(draft: Draft) -> str:
        counts.append(_put_proposals(draft, found, first, last))
        progress(1, 2)
        return f"proposed {counts[-1]} tracks in {frames_text(first, last)}"

    acted = labels.log.act("propose", person, apply)
    known = len(found.tracks) - counts[-1]
    flat = sum(all(each.cuboid is None for each in track.sightings) for track in found.tracks)
    more = [
        f"{known} more are already labelled" if known else "",
        f"{flat} seen by the camera only, without a cuboid" if flat else "",
    ]
    return "; ".join((acted.what, *filter(None, more)))


def importing(
    labels: DriveLabels, found: LabelSet, person: str, notes: Sequence[str], progress: Progress = silent
) -> str:
    """Import labels of this drive from another source, as one act, in addition to existing labels; returns a sentence
    with the outcome. A track whose id is taken gets a new one. A track that already exists with the same positions is
    not duplicated, and is overwritten by the file if nobody has edited it here. Leads and paths in the file replace
    existing ones. ActRefused for a lead or event of a missing track. Nothing is written if ``progress`` raises."""
    known: list[int] = []

    def apply(draft: Draft) -> str:
        numbers = _put_tracks(draft, found.tracks, known) or {each: each for each in draft.all("track")}
        for lead in found.leads:
            clear(draft, lead.first, lead.last)
            who = _numbered(numbers, lead.lead, "the lead") if isinstance(lead.lead, int) else lead.lead
            draft.add("lead", replace(lead, lead=who))
        drawn = {path.frame for path in found.paths}
        for number, item in draft.all("path").items():
            if cast("PathLabel", item.value).frame in drawn:
                draft.put("path", number, None)
        for path in found.paths:
            draft.add("path", path)
        events = {_happening(cast("EventLabel", item.value)) for item in draft.all("event").values()}
        for event in found.events:
            renamed = replace(event, tracks=tuple(_numbered(numbers, each, event.kind) for each in event.tracks))
            if _happening(renamed) not in events:
                draft.add("event", renamed)
        for tag in found.tags:
            put_tag(draft, tag)
        progress(1, 1)
        return f"imported {len(found.tracks) - len(known)} tracks and {len(found.leads)} ranges of the lead"

    said = labels.log.act("import", person, apply).what
    twice = (f"{len(known)} tracks are already here, identical in every frame",) if known else ()
    return "; ".join((said, *twice, *notes))


def _put_tracks(draft: Draft, tracks: Sequence[LabelTrack], known: list[int]) -> dict[int, int]:
    """The tracks' ids here, by their id in the file; ids of existing tracks are added to ``known``."""
    numbers: dict[int, int] = {}
    there = {(each.label, each.sightings): each for each in _as_they_are(draft)}
    for track in tracks:
        same = there.get((track.label, track.sightings))
        if same is not None:
            numbers[track.id] = same.id
            known.append(same.id)
            if _is_untouched(same):
                draft.put("track", same.id, replace(track, id=same.id, sightings=()))
            continue
        numbers[track.id] = draft.number_for(track)
        draft.add("track", replace(track, id=numbers[track.id], sightings=()))
        draft.put_sightings(numbers[track.id], {each.frame: each for each in track.sightings})
    return numbers


def _numbered(numbers: Mapping[int, int], track: int, what: str) -> int:
    """The id here of a track in the file."""
    if track not in numbers:
        raise ActRefused(f"{what} is #{track}: track not found in file or database")
    return numbers[track]


def _happening(event: EventLabel) -> tuple[int, str, tuple[int, ...]]:
    """Key that identifies an event."""
    return event.frame, event.kind, event.tracks


def _is_untouched(label: LabelTrack | LeadRange) -> bool:
    """Whether it is a proposal of the pipeline that nobody has reviewed or sent back."""
    return label.state == "proposed" and label.origin.maker == "pipeline" and not label.comment


def _as_they_are(draft: Draft) -> list[LabelTrack]:
    """Every track in its current state, with its sightings."""
    return [
        replace(cast("LabelTrack", item.value), sightings=tuple(draft.sightings(number).values()))
        for number, item in draft.all("track").items()
    ]


def importing_truth(labels: DriveLabels, recording: OpenRecording, person: str) -> TaskWork:
    """Import the truth that comes with the recording."""

    def work(progress: Progress) -> str:
        source = recording.setup.source
        origin = Origin("import", source.title, int(time.time() * 1000))
        found, notes = truth_labels(source, recording.names(), origin, progress)
        if not found.tracks:
            raise ActRefused("this recording has no ground truth")
        return importing(labels, found, person, notes, progress)

    return work


def _proposals(recording: OpenRecording, run: DriveRun, first: int, last: int, progress: Progress) -> Proposals:
    rows = run.rows()[: last + 1]
    frames = {index: seen_of(records) for index, records in run.objects() if first <= index <= last}
    leads = {index: rows[index].cipv_id for index in range(first, last + 1)}
    origin = Origin(
        "pipeline",
        run.name or f"run {run.number}",
        int(time.time() * 1000),
        recording.digest(run.params),
        recording.calibration_digest(run.params),
    )
    moments = moments_of(rows)
    found = propose(frames, leads, origin, moments)
    tracks = refined(found.tracks, sweeps_of(recording), own_poses(moments), progress)
    return replace(found, tracks=tracks)


def _put_proposals(draft: Draft, found: Proposals, first: int, last: int) -> int:
    """Number of proposed tracks. A track that a person has edited is not proposed again; an untouched one is replaced
    and keeps its id. A lead is proposed where no person has set one."""
    known = [
        replace(cast("LabelTrack", item.value), sightings=tuple(draft.sightings(number, first, last).values()))
        for number, item in draft.all("track").items()
    ]
    replaced = {track.id for track in known if _is_untouched(track)}
    same = known_as(found.tracks, known)
    numbers, count = dict(same), 0
    for track in found.tracks:
        if track.id in same and same[track.id] not in replaced:
            continue
        count += 1
        number = numbers.get(track.id)
        if number is None:
            number = numbers[track.id] = draft.number_for(track)
            draft.add("track", replace(track, id=number, sightings=()))
        else:
            draft.put("track", number, replace(track, id=number, sightings=()))
        there = draft.sightings(number, first, last)
        fresh: dict[int, Sighting | None] = dict.fromkeys(there)
        draft.put_sightings(number, fresh | {each.frame: each for each in track.sightings})
    _put_leads(draft, found.leads, numbers, first, last)
    return count


def _put_leads(draft: Draft, leads: Sequence[LeadRange], numbers: dict[int, int], first: int, last: int) -> None:
    said: set[int] = set()
    for number, item in draft.all("lead").items():
        old = cast("LeadRange", item.value)
        if _is_untouched(old) and first <= old.first and old.last <= last:
            draft.put("lead", number, None)
        else:
            said.update(range(old.first, old.last + 1))
    for lead in leads:
        who = numbers[lead.lead] if isinstance(lead.lead, int) else lead.lead
        for start, end in free_spans(lead.first, lead.last, said):
            draft.add("lead", replace(lead, first=start, last=end, lead=who))
