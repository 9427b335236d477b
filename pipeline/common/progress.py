"""Reporting the progress of long work."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int], object]
"""Called with (done, total) as the work proceeds. An exception that it raises ends the work."""


def silent(done: int, total: int) -> None:
    """Ignores progress: the default for callers that do not show it."""
