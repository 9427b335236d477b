"""The queue of recordings to label: their assignee, state and worth."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, cast

from sqlalchemy import Connection, func, or_, select

from app.labels.errors import ActRefused, NoSuchLabel
from app.labels.store.database import Database
from app.labels.store.items import read_items
from app.labels.store.tables import DriveRow, ProjectDriveRow, SightingRow, WorkRow
from app.labels.store.values import ItemKind
from app.labels.work_states import State
from pipeline.labels.model import COUNTED_STATES, NEXT_TAG, EventLabel, FrameTag, LabelTrack, LeadRange, PathLabel

_FRAME_KINDS: tuple[ItemKind, ...] = ("path", "event")


@dataclass(frozen=True)
class Work:
    """Labeling state of one recording."""

    key: str
    """Key derived from its content."""
    title: str
    """Display name."""
    uri: str
    """Where it was first opened."""
    frames: int
    """Number of frames."""
    person: str
    """Person who labels it; empty if unassigned."""
    state: State
    """Its state."""
    labelled: float
    """Share of its frames with a lead set by a person."""
    reviewed: float
    """Share of its accepted tracks that a second person has reviewed."""
    proposals: int
    """Number of untouched proposals."""
    asked: int
    """Frames requested for labeling by `cipv mine`, a project's sampling or a person whose lead is not labelled."""
    worth: float
    """Expected value of a label per frame: uncertain proposals, weighted by their uncertainty (1 at a confidence of
    0.5, 0 at 0 and 1), frames with an unclear lead, and ``asked``."""
    sampled: int
    """Frames requested for labeling, whether labelled since or not."""
    project: str
    """The project that it is in; empty if none."""
    open_proposals: int
    """Labels of any kind that are only proposed, or were sent back."""
    unreviewed: int
    """Accepted labels of any kind that no second person has reviewed."""


def queue(database: Database) -> list[Work]:
    """Unfinished recordings first, then finished ones; each sorted by decreasing ``worth``."""
    with database.reading() as connection:
        rows = connection.execute(
            select(
                DriveRow.id,
                DriveRow.key,
                DriveRow.title,
                DriveRow.uri,
                DriveRow.count,
                WorkRow.person,
                WorkRow.state,
                ProjectDriveRow.project,
            )
            .outerjoin(WorkRow, WorkRow.drive_id == DriveRow.id)
            .outerjoin(ProjectDriveRow, ProjectDriveRow.drive_id == DriveRow.id)
            .where(DriveRow.count > 0)
        ).all()
        found = [_work(connection, row, row.person or "", cast("State", row.state or "open")) for row in rows]
    return sorted(found, key=lambda each: (each.state == "done", -each.worth, each.title, each.key))


def put(
    database: Database,
    drive: str,
    by: str,
    *,
    person: str | None = None,
    state: State | None = None,
    anyway: bool = False,
    allowed: Callable[[str], None] = lambda assigned: None,
) -> Work:
    """Assign a recording, or set its state. drive: its title, address or key. NoSuchLabel if there is none or several;
    ActRefused if it cannot be done: nothing is labelled, its labeler would mark it, or, unless ``anyway``, proposals
    are open or labels not reviewed. allowed: raises an error if the change is not allowed for a recording with this
    assignee."""
    with database.reading() as connection:
        matches = or_(DriveRow.key == drive, DriveRow.title == drive, DriveRow.uri == drive)
        rows = connection.execute(select(DriveRow.id, DriveRow.key).where(matches, DriveRow.count > 0)).all()
    if len(rows) != 1:
        raise NoSuchLabel(f"{drive}: {len(rows) or 'no'} such recordings; `cipv labels queue` lists them")
    number, key = rows[0]
    now = next(each for each in queue(database) if each.key == key)
    allowed(now.person)
    new = replace(now, person=now.person if person is None else person, state=now.state if state is None else state)
    if state == "done" and by == new.person:
        raise ActRefused(f"{by} labels {now.title}: a second person must mark it as done")
    if state in ("review", "done") and not now.labelled:
        raise ActRefused(f"{now.title}: nothing is labelled yet")
    if state == "done" and not anyway and (now.open_proposals or now.unreviewed):
        raise ActRefused(f"{now.title} is not done: {_left(now)}")
    if person and state is None and now.state == "open":
        new = replace(new, state="labeling")
    values = {"drive_id": number, "person": new.person, "state": new.state, "t_unix_ms": int(time.time() * 1000)}
    with database.writing() as connection:
        if not database.insert_new(connection, WorkRow, values):
            connection.execute(
                WorkRow.__table__.update().where(WorkRow.drive_id == number).values(values)  # type: ignore[attr-defined]
            )
    return new


def _left(work: Work) -> str:
    """What keeps a recording from being done."""
    proposals, labels = work.open_proposals, work.unreviewed
    return " and ".join(
        f"{count:,} {noun}{'' if count == 1 else 's'} {'is' if count == 1 else 'are'} {what}"
        for count, noun, what in ((proposals, "proposal", "open"), (labels, "label", "not reviewed"))
        if count
    )


def _work(connection: Connection, drive: Any, person: str, state: State) -> Work:
    tracks = [cast("LabelTrack", item.value) for item in read_items(connection, drive.id, "track").values()]
    leads = [cast("LeadRange", item.value) for item in read_items(connection, drive.id, "lead").values()]
    counted = connection.execute(
        select(SightingRow.track, func.count()).where(SightingRow.drive_id == drive.id).group_by(SightingRow.track)
    )
    lengths = {track: count for track, count in counted}
    proposed = [each for each in tracks if each.state == "proposed"]
    accepted = [each for each in tracks if each.state in COUNTED_STATES]
    unsure = sum(doubt(each) * lengths.get(each.id, 0) for each in proposed)
    unclear = sum(each.last + 1 - each.first for each in leads if is_unclear(each))
    spans = [range(each.first, each.last + 1) for each in leads if each.state in COUNTED_STATES]
    said = sum(map(len, spans))
    tags = [cast("FrameTag", item.value) for item in read_items(connection, drive.id, "tag").values()]
    sampled = {frame for tag in tags if tag.tag == NEXT_TAG for frame in range(tag.first, tag.last + 1)}
    asked = sampled - {frame for span in spans for frame in span}
    others = [item.value for kind in _FRAME_KINDS for item in read_items(connection, drive.id, kind).values()]
    placed = [each for each in tracks if lengths.get(each.id)]
    stated = cast("list[LabelTrack | LeadRange | PathLabel | EventLabel]", [*placed, *leads, *others])
    return Work(
        drive.key,
        drive.title,
        drive.uri,
        drive.count,
        person,
        state,
        min(said / drive.count, 1.0),
        sum(bool(each.reviewer) for each in accepted) / len(accepted) if accepted else 0.0,
        len(proposed),
        len(asked),
        round((unsure + unclear + len(asked)) / drive.count, 3),
        len(sampled),
        drive.project or "",
        sum(each.state == "proposed" for each in stated),
        sum(each.state in COUNTED_STATES and not each.reviewer for each in stated),
    )


def doubt(track: LabelTrack) -> float:
    """How uncertain a proposal is: 1 at a confidence of 0.5, 0 at 0 and 1; 0 for other tracks."""
    is_proposed = track.state == "proposed" and track.confidence is not None
    return 1.0 - abs(2.0 * cast("float", track.confidence) - 1.0) if is_proposed else 0.0


def is_unclear(lead: LeadRange) -> bool:
    """Whether the lead is proposed as unclear."""
    return lead.state == "proposed" and lead.lead == "unknown"
