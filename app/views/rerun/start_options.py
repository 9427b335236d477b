"""Start options of rerun, kept apart from modules that import rerun, which takes half a second."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RerunStartOptions:
    """How rerun opens a recording."""

    paused: bool = False
    """At the first frame."""
    compact: bool = False
    """For a narrow pane: the camera above, and one other view at a time below."""


PLAYING = RerunStartOptions()
"""How a saved file opens."""
