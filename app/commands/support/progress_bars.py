"""Progress bars on standard error, so that results can go to standard output."""

from __future__ import annotations

from rich.console import Console
from rich.progress import (
    BarColumn,
    DownloadColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TaskProgressColumn,
    TextColumn,
    TimeRemainingColumn,
)

from pipeline.common.progress import Progress as Told


def frames_progress() -> Progress:
    """A bar that counts frames."""
    return _bar(MofNCompleteColumn())


def bytes_progress() -> Progress:
    """A bar that counts bytes."""
    return _bar(DownloadColumn())


def share_progress() -> Progress:
    """A bar that shows a percentage."""
    return _bar(TaskProgressColumn())


def drives_progress() -> Progress:
    """A bar that counts drives and shows the field ``rate`` of its task."""
    return _bar(MofNCompleteColumn(), TextColumn("{task.fields[rate]}"))


def task_progress(bar: Progress, name: str, total: int | None = None) -> Told:
    """Add a task to the bar and return the callback that reports its progress."""
    task = bar.add_task(name, total=total)
    return lambda done, of: bar.update(task, completed=done, total=of)


def _bar(*counts: ProgressColumn) -> Progress:
    """A bar that disappears when done and is not shown if standard error is not a terminal."""
    columns = (TextColumn("{task.description}"), BarColumn(), *counts, TimeRemainingColumn())
    console = Console(stderr=True)
    return Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
