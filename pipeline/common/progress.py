"""Reporting the progress of long work."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int], object]
"""Called with (done, total) as the work proceeds. If it raises an exception, the work is aborted."""


def silent(done: int, total: int) -> None:
    """Ignores progress: the default for callers that do not show it."""
