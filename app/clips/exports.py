"""The export formats of a clip.

To add a format, write a module in this folder with ``write(clip, path, progress)`` and register it in ``EXPORTERS``.
"""

from __future__ import annotations

from functools import partial
from importlib import import_module
from pathlib import Path

from app.clips.clip import Clip
from app.clips.export_queue import ExportQueue, ExportStatus
from pipeline.common.errors import BadInput
from pipeline.common.progress import Progress

MOST_FRAMES = 6000

EXPORTERS: dict[str, str] = {
    "mcap": "app.clips.session_file",
    "rrd": "app.clips.rerun_file",
    "mp4": "app.clips.video",
    "csv": "app.clips.csv_table",
    "html": "app.clips.html_report",
    "ply": "app.clips.point_cloud",
}
"""File suffix → the module that writes it. Modules are imported on first use, since video, MCAP and HTML together take
0.4 s."""


def write_clip(clip: Clip, kind: str, path: Path, progress: Progress) -> None:
    """Write a clip as a file of one kind, a key of ``EXPORTERS``. Progress ends at (total, total)."""
    import_module(EXPORTERS[kind]).write(clip, path, progress)


def submit(queue: ExportQueue, clip: Clip, kind: str) -> ExportStatus:
    """Queue the export of a clip. BadInput if its frames are not in the recording, or too many."""
    total = clip.recording.setup.total
    if not 0 <= clip.first <= clip.last < total:
        raise BadInput(f"a clip must start and end within frames 0 to {total - 1}, in this order")
    if clip.last + 1 - clip.first > MOST_FRAMES:
        raise BadInput(f"a clip can have at most {MOST_FRAMES} frames")
    name = f"clip-{clip.first:06d}-{clip.last:06d}.{kind}"
    return queue.submit(kind, clip.first, clip.last, name, partial(write_clip, clip, kind))
