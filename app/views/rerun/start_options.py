"""How rerun opens a replay; apart from what needs rerun, which takes half a second to import."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RerunStartOptions:
    """paused: it stands still at its first frame instead of playing. compact: laid out for a narrow pane, the camera
    above and one other view at a time below it."""

    paused: bool = False
    compact: bool = False


PLAYING = RerunStartOptions()
"""As a file opens that somebody keeps."""
