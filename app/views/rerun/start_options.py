"""Start options of rerun, kept apart from modules that import rerun, which takes half a second."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RerunStartOptions:
    """Initial view of a recording in rerun."""

    paused: bool = False
    """Whether it is paused at the first frame."""
    compact: bool = False
    """For a narrow pane: the camera above, and below it one other view at a time."""


PLAYING = RerunStartOptions()
"""Options for a saved file."""
