"""How rerun opens a replay; apart from what needs rerun, which takes half a second to import."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RerunStartOptions:
    """paused: it starts paused at the first frame. compact: for a narrow pane, the camera above and one other view at a
    time below."""

    paused: bool = False
    compact: bool = False


PLAYING = RerunStartOptions()
"""How a saved file opens."""
