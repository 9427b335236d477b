"""Exports a clip as a rerun recording."""

from __future__ import annotations

from pathlib import Path

from app.clips.clip import Clip, clip_frames
from pipeline.common.progress import Progress


def write(clip: Clip, path: Path, progress: Progress) -> None:
    """Write a ``.rrd`` file. ReplayError if it cannot be written."""
    from app.views.rerun.view import RerunSink  # takes half a second to import

    with RerunSink(path, clip.title, clip.params.alignment, clip.start) as sink:
        for frame, result in clip_frames(clip, progress):
            sink.show(frame, result)
