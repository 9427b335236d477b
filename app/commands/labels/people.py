"""`cipv labels queue`, `agreement` and `effort`: assign recordings, compare two labelers, and show each person's
work."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from app.commands.labels.files import Database, Person, account, say
from app.commands.support.arguments import option
from pipeline.common.errors import BadInput
from pipeline.common.files.user_file_errors import given_path
from pipeline.labels.formats.native import from_json
from pipeline.labels.formats.reading import read_bytes

_MOST_NAMED = 20
State = Literal["open", "labeling", "review", "done"]
"""The states of ``app.labels.store.work``, repeated here because its import takes two seconds."""


@dataclass(frozen=True)
class LabelAgreement:
    """Compare two people's independent labels of one recording: the lead in each frame, overlap and class of cuboids
    that both have, and cuboids that only one has. Both files are native exports.

    Example: cipv labels agreement ada.json bob.json
    """

    first: tyro.conf.Positional[Path]
    """Labels of the first person"""
    second: tyro.conf.Positional[Path]
    """Labels of the second person"""
    json: bool = False
    """Print the figures as JSON"""

    def __call__(self) -> int:
        from pipeline.labels.agreement import agreement  # imports SciPy, which no other command here needs

        first, second = (from_json(read_bytes(given_path(file)), str(file)) for file in (self.first, self.second))
        found = agreement(first, second)
        if self.json:
            print(json.dumps(asdict(found), indent=2))
            return 0
        print(f"lead: {percent(found.lead_share)} of {found.frames:,} frames agree")
        if found.lead_disagreements:
            named = ", ".join(str(frame + 1) for frame in found.lead_disagreements[:_MOST_NAMED])
            print(f"  not in frames {named}{' …' if len(found.lead_disagreements) > _MOST_NAMED else ''}")
        overlap = "-" if found.iou is None else f"{found.iou:.2f}"
        print(f"cuboids: {found.vehicles:,} in both, median IoU {overlap}")
        print(f"  only in the first {found.only_first:,}, only in the second {found.only_second:,}")
        print(f"class: {percent(found.class_share)} agree; reversed: {percent(found.reversed_share)}")
        return 0


@dataclass(frozen=True)
class LabelEffort:
    """List the number of changes and the active time of each person on each recording, in total and per frame. Pauses
    of more than two minutes do not count.

    Example: cipv labels effort --json
    """

    database: Database = None
    """Label database; default: $CIPV_LABELS_URL, then sessions/labels.db"""
    json: bool = False
    """Print the list as JSON"""

    def __call__(self) -> int:
        from app.labels.store.database import open_database
        from app.labels.store.effort import efforts

        database = open_database(self.database)
        try:
            found = efforts(database)
        finally:
            database.close()
        if self.json:
            rates = [{"acts_per_frame": each.acts_per_frame, "s_per_frame": each.s_per_frame} for each in found]
            print(json.dumps([asdict(each) | rate for each, rate in zip(found, rates, strict=True)], indent=2))
            return 0
        for each in found:
            print(
                f"{each.title}: {each.person}: changes {each.acts:,} ({each.acts_per_frame:.2f} per frame), "
                f"{each.active_s / 60:.0f} min ({each.s_per_frame:.1f} s per frame)"
            )
        if not found:
            say("no labels yet")
        return 0


@dataclass(frozen=True)
class LabelQueue:
    """List the recordings to label, most valuable first: assignee, state, how much is labelled and reviewed, and
    priority (uncertain proposals and unclear leads per frame). With --drive and --assign or --state: change one. The
    person who labels a recording cannot mark it as done, and nobody while proposals are open or labels not reviewed.

    Example: cipv labels queue --drive "Astyx HiRes2019" --assign Ada
    """

    drive: Annotated[str | None, option("NAME")] = None
    """Title, address or key of the recording to change"""
    assign: Annotated[str | None, option("PERSON")] = None
    """Assign it to this person"""
    state: Annotated[State | None, option("open|labeling|review|done")] = None
    """Its new state"""
    anyway: bool = False
    """Mark it as done although proposals are open or labels not reviewed"""
    database: Database = None
    """Label database; default: $CIPV_LABELS_URL, then sessions/labels.db"""
    person: Person = field(default_factory=account)
    """Author of the change"""
    json: bool = False
    """Print the list as JSON"""

    def __call__(self) -> int:
        from app.labels.store.database import open_database
        from app.labels.store.work import put, queue

        if (self.drive is None) != (self.assign is None and self.state is None):
            raise BadInput("--drive must be given together with --assign or --state")
        if self.anyway and self.state != "done":
            raise BadInput("--anyway must be given together with --state done")
        database = open_database(self.database)
        try:
            if self.drive is not None:
                put(database, self.drive, self.person, person=self.assign, state=self.state, anyway=self.anyway)
            found = queue(database)
        finally:
            database.close()
        if self.json:
            print(json.dumps([asdict(each) for each in found], indent=2))
            return 0
        for each in found:
            print(
                f"{each.title}: {each.state}, {each.person or 'unassigned'}; labelled {percent(each.labelled)}, "
                f"reviewed {percent(each.reviewed)}, proposals {each.proposals:,}, queued frames {each.asked:,}"
                f", priority {each.worth:.2f}"
            )
        if not found:
            say("no recordings yet: open one and label it, or run `cipv labels propose`")
        return 0


def percent(share: float | None) -> str:
    """A share in words; a dash where there is none."""
    return "-" if share is None else f"{100 * share:.0f} %"
