"""How far each project is, and what it took."""

from __future__ import annotations

from collections.abc import Sequence

from app.labels.projects.results import PersonEffort, ProjectProgress
from app.labels.projects.store import projects
from app.labels.store.database import Database
from app.labels.store.effort import Effort, efforts
from app.labels.store.work import Work, queue


def progress(database: Database) -> list[ProjectProgress]:
    """All projects by name."""
    work, done = queue(database), efforts(database)
    return [
        _progress(name, sampling, [each for each in work if each.project == name], done)
        for name, sampling in projects(database).items()
    ]


def _progress(name: str, sampling: str, drives: Sequence[Work], done: Sequence[Effort]) -> ProjectProgress:
    frames, keys = sum(each.frames for each in drives), {each.key for each in drives}
    mine = [each for each in done if each.key in keys]
    return ProjectProgress(
        name,
        sampling,
        len(drives),
        sum(each.state == "done" for each in drives),
        frames,
        sum(each.labelled * each.frames for each in drives) / frames if frames else 0.0,
        sum(each.sampled for each in drives),
        sum(each.asked for each in drives),
        tuple(_effort(person, mine) for person in sorted({each.person for each in mine})),
    )


def _effort(person: str, done: Sequence[Effort]) -> PersonEffort:
    theirs = [each for each in done if each.person == person]
    acts, active_s = sum(each.acts for each in theirs), sum(each.active_s for each in theirs)
    frames = sum(each.frames for each in theirs)
    return PersonEffort(person, acts, round(active_s, 1), frames, acts / frames, round(active_s / frames, 3))
