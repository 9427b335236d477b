"""`cipv labels projects`: sets of recordings with classes, sampled frames and control frames."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated

from app.commands.labels.files import Database, Person, account, say
from app.commands.labels.people import percent
from app.commands.support.arguments import option
from app.labels.project_classes import project_classes
from pipeline.common.files.user_file_errors import given_path


@dataclass(frozen=True)
class LabelProjects:
    """List the projects with their progress, each person's changes and active time, and how well each person labelled
    the control frames. With --set: make the project that a YAML file describes, or change it.

    Example: cipv labels projects --set winter.yaml
    """

    set: Annotated[Path | None, option("FILE")] = None
    """The project's file; see the guide on labeling"""
    database: Database = None
    """Label database; default: $CIPV_LABELS_URL, then sessions/labels.db"""
    person: Person = field(default_factory=account)
    """Author of the change"""
    json: bool = False
    """Print the list as JSON"""

    def __call__(self) -> int:
        from app.labels.projects.control import control_results
        from app.labels.projects.progress import progress
        from app.labels.projects.project_file import read_project
        from app.labels.projects.set_up import set_up
        from app.labels.store.database import open_database

        file = read_project(given_path(self.set)) if self.set is not None else None
        database = open_database(self.database)
        try:
            for note in set_up(database, file, self.person) if file is not None else ():
                say(note)
            found, control = progress(database), control_results(database, project_classes())
        finally:
            database.close()
        if self.json:
            print(json.dumps({"projects": list(map(asdict, found)), "control": list(map(asdict, control))}, indent=2))
            return 0
        for each in found:
            print(
                f"{each.name}: {each.done} of {each.drives} recordings done, lead labelled in {percent(each.labelled)} "
                f"of {each.frames:,} frames, {each.asked:,} of {each.sampled:,} queued frames left"
                f"{f' ({each.sampling})' if each.sampling else ''}"
            )
            for one in each.people:
                print(
                    f"  {one.person}: changes {one.acts:,} ({one.acts_per_frame:.2f} per frame), "
                    f"{one.active_s / 60:.0f} min ({one.s_per_frame:.1f} s per frame)"
                )
            for result in control:
                if result.project == each.name:
                    iou = "-" if result.iou is None else f"{result.iou:.2f}"
                    print(
                        f"  control frames {result.first + 1}-{result.last + 1} of {result.title}: {result.person}: "
                        f"lead {percent(result.lead_share)} right in {result.leads:,} frames, cuboids "
                        f"{result.vehicles:,} right, {result.missed:,} missed, {result.extra:,} extra, median IoU {iou}"
                    )
        if not found:
            say("no projects yet")
        return 0
