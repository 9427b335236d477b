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
    """A bar that counts frames and vanishes when done."""
    return _bar(MofNCompleteColumn())


def bytes_progress() -> Progress:
    """A bar that counts bytes."""
    return _bar(DownloadColumn())


def share_progress() -> Progress:
    """A bar that shows how much is done."""
    return _bar(TaskProgressColumn())


def task_progress(bar: Progress, name: str, total: int | None = None) -> Told:
    """A line of the bar, as the callback that work reports its progress to."""
    task = bar.add_task(name, total=total)
    return lambda done, of: bar.update(task, completed=done, total=of)


def _bar(count: ProgressColumn) -> Progress:
    """Vanishes when done; there is none where nobody looks, as in a log."""
    columns = (TextColumn("{task.description}"), BarColumn(), count, TimeRemainingColumn())
    console = Console(stderr=True)
    return Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
