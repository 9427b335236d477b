"""`cipv labels`: labels of recordings, in the database and as files of other tools. The pipeline and the database are
imported on use, because that takes two seconds."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Annotated

import tyro

from app.commands.labels.files import Database, ExportLabels, ImportLabels, Person, account, say
from app.commands.labels.people import LabelAgreement, LabelEffort, LabelQueue
from app.commands.labels.projects import LabelProjects
from app.commands.support.arguments import option
from app.commands.support.options import PipelineOptions, SourceOptions
from app.commands.support.progress_bars import frames_progress, task_progress
from app.labels.project_classes import FILE as PROJECT_FILE
from app.labels.project_classes import VARIABLE, project_classes
from pipeline.labels.classes import FILE
from pipeline.labels.formats.base import write_file


@dataclass(frozen=True)
class ProposeLabels:
    """Run the pipeline on a recording and save its objects as proposed labels, to be accepted or corrected in the
    dashboard. Objects that a person has reviewed already are not proposed again.

    Example: cipv labels propose astyx:PATH
    """

    source: SourceOptions
    pipeline: PipelineOptions = field(default_factory=PipelineOptions)
    database: Database = None
    """Label database; default: $CIPV_LABELS_URL, then sessions/labels.db"""
    person: Person = field(default_factory=account)
    """Author of the change, who can undo it in the dashboard"""

    def __call__(self) -> int:
        from app.drive.frame_rows import lead_reach_m
        from app.drive.full_run import calibration_digest, digest
        from app.labels.acts.bulk import put_proposals
        from app.labels.store.database import open_database
        from app.labels.store.drive_labels import DriveLabels, info_of
        from pipeline.labels.cuboids.points_of import Clustered, clustered
        from pipeline.labels.cuboids.refine import refined
        from pipeline.labels.headings import Moment, own_poses
        from pipeline.labels.model import Origin
        from pipeline.labels.propose import Seen, propose
        from pipeline.path.yaw_rate import usable_rate
        from pipeline.run import run
        from pipeline.types.source import InParts

        params, source = self.pipeline.parameters(), self.source.open()
        detectors = self.pipeline.open_detectors(source)
        frames: dict[int, list[Seen]] = {}
        leads: dict[int, int | None] = {}
        moments: dict[int, Moment] = {}
        names, calibration = [], ""
        with frames_progress() as bar:
            task = bar.add_task(source.title, total=len(source))
            for frame, result in run(source, params, detectors):
                frames[frame.index] = [
                    Seen(each.id, each.label, each.cuboid, each.bbox, each.in_path, each.carried, each.score)
                    for each in result.objects
                ]
                leads[frame.index] = result.cipv.id if result.cipv is not None else None
                speed, rate = (ego.speed_mps, usable_rate(ego)) if (ego := result.ego) is not None else (None, None)
                moments[frame.index] = Moment(frame.t_ns, speed, rate, lead_reach_m(frame, result))
                names.append(frame.name)
                calibration = calibration or calibration_digest(frame.camera, params)
                bar.update(task, completed=len(names))
        made_from = digest(source.uri, detectors.names, "both", params)
        origin = Origin("pipeline", "cipv labels propose", int(time.time() * 1000), made_from, calibration)
        found = propose(frames, leads, origin, moments)

        @lru_cache(64)
        def sweeps(index: int) -> Clustered | None:
            sweep = source.sweep(index) if isinstance(source, InParts) else source.frame(index).sweep
            return clustered(sweep.points) if sweep is not None else None

        with frames_progress() as bar:
            progress = task_progress(bar, "fitting proposals to points", len(found.tracks))
            found = replace(found, tracks=refined(found.tracks, sweeps, own_poses(moments), progress))
        database = open_database(self.database)
        try:
            kept = DriveLabels(database, info_of(source, lambda: tuple(names)))
            say(put_proposals(kept, found, self.person, 0, len(names) - 1))
        finally:
            database.close()
        return 0


@dataclass(frozen=True)
class ListLabels:
    """List every recording with labels in the database.

    Example: cipv labels list --json
    """

    database: Database = None
    """Label database; default: $CIPV_LABELS_URL, then sessions/labels.db"""
    json: bool = False
    """Print the list as JSON"""

    def __call__(self) -> int:
        from app.labels.store.database import open_database
        from app.labels.store.drive_labels import known_drives

        database = open_database(self.database)
        try:
            drives = known_drives(database)
        finally:
            database.close()
        if self.json:
            print(json.dumps(drives, indent=2))
            return 0
        for drive in drives:
            print(
                f"{drive['title']}: frames {drive['count']:,}, tracks {drive['tracks']:,}, "
                f"changes {drive['revision']:,}, first opened as {drive['uri']}"
            )
        if not drives:
            say(f"{database.name}: no labels yet")
        return 0


@dataclass(frozen=True)
class ListClasses:
    """List the classes, sub-classes, their names in exports, and the attributes that people choose from. With --out:
    write them as a YAML file to edit; sessions/labels.yaml, or the file named by $CIPV_LABEL_CLASSES, is used.

    Example: cipv labels classes --out sessions/labels.yaml
    """

    out: Annotated[Path | None, option("FILE")] = None
    """The file to write; must not exist"""
    json: bool = False
    """Print the list as JSON"""

    def __call__(self) -> int:
        if self.out is not None:
            write_file(self.out, FILE.read_bytes())
            say(f"{self.out}: edit it; {PROJECT_FILE} and the file named by ${VARIABLE} are read at start")
            return 0
        known = project_classes()
        if self.json:
            classes = [vars(each) for each in known.classes.values()]
            print(json.dumps({"classes": classes, "attributes": known.attributes}, indent=2))
            return 0
        for each in known.classes.values():
            names = ", ".join(f"{export}: {called}" for export, called in each.exports.items())
            print(f"{each.name}{f', a kind of {each.of}' if each.of else ''}{f' ({names})' if names else ''}")
        for name, values in known.attributes.items():
            print(f"{name}: {', '.join(values)}")
        return 0


@dataclass(frozen=True)
class Labels:
    """Labels of recordings: propose, list, classes, queue, agreement, effort, export and import."""

    action: (
        Annotated[ProposeLabels, tyro.conf.subcommand("propose")]
        | Annotated[ListLabels, tyro.conf.subcommand("list")]
        | Annotated[ListClasses, tyro.conf.subcommand("classes")]
        | Annotated[LabelQueue, tyro.conf.subcommand("queue")]
        | Annotated[LabelProjects, tyro.conf.subcommand("projects")]
        | Annotated[LabelAgreement, tyro.conf.subcommand("agreement")]
        | Annotated[LabelEffort, tyro.conf.subcommand("effort")]
        | Annotated[ExportLabels, tyro.conf.subcommand("export")]
        | Annotated[ImportLabels, tyro.conf.subcommand("import")]
    )

    def __call__(self) -> int:
        return self.action()
