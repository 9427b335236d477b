"""How far something is that takes a while."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int], object]
"""Told (done, total) as the work goes on. What it raises ends the work."""


def silent(done: int, total: int) -> None:
    """For who does not want to know."""
