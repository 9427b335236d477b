"""Control frames: frames whose truth is known, in which each person's labels are compared with it.

Nothing in the labels or the queue distinguishes them from other frames, and they do not change which frames are
sampled: a dense run of requested frames would give them away. Only reviewers see the results.
"""

from __future__ import annotations

import zlib
from dataclasses import replace
from typing import Any, cast

from sqlalchemy import select

from app.labels.projects.results import ControlResult
from app.labels.store.database import Database
from app.labels.store.drive_labels import DriveInfo, DriveLabels
from app.labels.store.tables import ControlRow, DriveRow, ProjectDriveRow
from pipeline.labels.agreement import agreement
from pipeline.labels.classes import ClassList, as_bases
from pipeline.labels.formats.native import from_json, to_json
from pipeline.labels.model import COUNTED_STATES, LabelSet, LabelTrack, LeadRange


def pack_truth(truth: LabelSet, first: int, last: int) -> bytes:
    """The labels of some frames, as stored."""
    return zlib.compress(to_json(within(truth, first, last)), 6)


def control_results(database: Database, classes: ClassList) -> list[ControlResult]:
    """Of everybody who labelled control frames, by project, recording and person. classes: the server's, for projects
    without their own."""
    with database.reading() as connection:
        rows = connection.execute(
            select(DriveRow.key, DriveRow.uri, DriveRow.title, ProjectDriveRow.project, ControlRow.__table__)
            .join(DriveRow, DriveRow.id == ControlRow.drive_id)
            .join(ProjectDriveRow, ProjectDriveRow.drive_id == ControlRow.drive_id)
            .order_by(ProjectDriveRow.project, DriveRow.title, DriveRow.id, ControlRow.first)
        ).all()
    return [result for row in rows for result in _results(database, row, classes)]


def _results(database: Database, row: Any, classes: ClassList) -> list[ControlResult]:
    """Of one range of frames, by person. A review does not make a label somebody else's."""
    truth = from_json(zlib.decompress(row.truth), "control frames")
    labels = DriveLabels(database, DriveInfo(row.key, row.uri, row.title, truth.t_ns, lambda: truth.frames))
    known, authors = labels.classes() or classes, labels.authors()
    truth, there = as_bases(truth, known), as_bases(within(labels.label_set(), row.first, row.last), known)
    leads: dict[str, list[LeadRange]] = {}
    for number, item in labels.items("lead").items():
        leads.setdefault(authors.get(("lead", number), ""), []).append(cast("LeadRange", item.value))
    tracks: dict[str, list[LabelTrack]] = {}
    for track in there.tracks:
        tracks.setdefault(authors.get(("track", track.id), ""), []).append(track)
    found = []
    for person in sorted(leads.keys() | tracks.keys()):
        theirs = within(replace(there, leads=tuple(leads.get(person, ()))), row.first, row.last)
        # the lead may be a vehicle that somebody else labelled
        by_lead = agreement(truth, theirs)
        by_vehicle = agreement(truth, replace(theirs, tracks=tuple(tracks.get(person, ()))))
        if person and (by_lead.frames or by_vehicle.vehicles or by_vehicle.only_second):
            found.append(
                ControlResult(
                    project=row.project,
                    title=row.title,
                    person=person,
                    first=row.first,
                    last=row.last,
                    leads=by_lead.frames,
                    lead_share=by_lead.lead_share,
                    vehicles=by_vehicle.vehicles,
                    missed=by_lead.only_first,
                    extra=by_vehicle.only_second,
                    iou=by_vehicle.iou,
                    class_share=by_vehicle.class_share,
                )
            )
    return found


def within(labels: LabelSet, first: int, last: int) -> LabelSet:
    """The vehicles and leads of frames first … last."""
    cut = (
        replace(track, sightings=tuple(each for each in track.sightings if first <= each.frame <= last), attributes=())
        for track in labels.tracks
    )
    return replace(
        labels,
        tracks=tuple(track for track in cut if track.sightings),
        leads=tuple(
            replace(each, first=max(each.first, first), last=min(each.last, last))
            for each in labels.leads
            if each.first <= last and each.last >= first
        ),
        paths=(),
        events=(),
        tags=(),
    )


def has_labels(labels: LabelSet) -> bool:
    """Whether anything in the set counts as truth."""
    stated: tuple[LabelTrack | LeadRange, ...] = (*labels.tracks, *labels.leads)
    return any(each.state in COUNTED_STATES for each in stated)
