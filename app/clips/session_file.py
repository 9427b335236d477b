"""Exports a clip as a session (MCAP) with the recording's own data, without running the pipeline."""

from __future__ import annotations

from pathlib import Path

from app.clips.clip import Clip
from pipeline.common.progress import Progress


def write(clip: Clip, path: Path, progress: Progress) -> None:
    """Write the frames with all data that their source has."""
    clip.recording.save(path, clip.first, clip.last, progress)
