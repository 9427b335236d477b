"""`cipv import`, `export` and `recover`: convert, cut and repair sessions."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro

from app.commands.info import size_text
from app.commands.support.arguments import option
from app.commands.support.options import PipelineOptions, SourceOptions
from app.commands.support.progress_bars import frames_progress, task_progress
from app.core.playback_clock import timeline_s
from pipeline.common.errors import BadInput
from pipeline.detection import Detectors
from pipeline.params import Params
from pipeline.recording.rewrite import recover
from pipeline.recording.save import save
from pipeline.recording.session.source import SessionSource
from pipeline.types.source import Source


@dataclass(frozen=True)
class ImportRecording:
    """Convert any recording to a session: one MCAP file that opens in CIPV Studio, Foxglove and rerun.

    Example: cipv import astyx:PATH --out drive.mcap
    """

    source: SourceOptions
    out: Path
    """The session to write, ending in .mcap; must not exist"""

    def __call__(self) -> int:
        source = self.source.open()
        with frames_progress() as bar:
            save(source, self.out, progress=task_progress(bar, source.title, len(source)))
        print(f"cipv: {self.out}: {len(source)} frames, {size_text(self.out.stat().st_size)}", file=sys.stderr)
        return 0


@dataclass(frozen=True)
class Export:
    """Write a recording, or a clip of it, as a rerun recording, a session or a table of objects.

    Example: cipv export drive.mcap --from 12 --to 20 --rrd clip.rrd --csv clip.csv
    """

    source: SourceOptions
    from_s: Annotated[float | None, option("S", name="from")] = None
    """Start S seconds into the drive"""
    to_s: Annotated[float | None, option("S", name="to")] = None
    """End S seconds into the drive"""
    rrd: Annotated[Path | None, option("FILE")] = None
    """Write a rerun recording; the pipeline runs again, with the recorded parameters unless others are given;
    an existing file is replaced"""
    mcap: Annotated[Path | None, option("FILE")] = None
    """Write a session; must not exist"""
    csv: Annotated[Path | None, option("FILE")] = None
    """Write one row per object and frame: the recorded results, or those of a new run if there are none;
    an existing file is replaced"""
    pipeline: PipelineOptions = field(default_factory=PipelineOptions)

    def __call__(self) -> int:
        from app.clips.clip import Clip  # imports the pipeline, which the other commands here do not need
        from app.clips.csv_table import write_csv
        from app.clips.exports import write_clip

        wanted = {kind: path for kind in ("mcap", "rrd", "csv") if (path := getattr(self, kind)) is not None}
        if not wanted:
            raise BadInput("nothing to write; add --rrd FILE, --mcap FILE or --csv FILE")
        source = self.source.open()
        first, last = _between(source, self.from_s, self.to_s)
        session = source if isinstance(source, SessionSource) else None
        given = self.pipeline.parameters() if self.pipeline.changes_parameters() else None
        params = given or (session.params(first) if session is not None else None) or Params()
        detectors = self.pipeline.open_detectors(source) if wanted.keys() - {"mcap"} else Detectors()
        clip = Clip.of_source(source, params, first, last, detectors)
        with frames_progress() as bar:
            for kind, path in wanted.items():
                if kind == "csv" and given is None and session is not None and session.result(first) is not None:
                    write_csv((session.result(index) for index in range(first, last + 1)), path)
                else:
                    write_clip(clip, kind, path, task_progress(bar, path.name))
        for path in wanted.values():
            print(f"cipv: {path}: {last + 1 - first} frames, {size_text(path.stat().st_size)}", file=sys.stderr)
        return 0


@dataclass(frozen=True)
class Recover:
    """Save every complete chunk of an MCAP file that was cut off by a crash, a full disk or a power failure.

    Example: cipv recover cut.mcap --out whole.mcap
    """

    file: tyro.conf.Positional[Path]
    """The file to read; it is not changed"""
    out: Annotated[Path | None, option("PATH")] = None
    """The file to write; must not exist; default: <name>_recovered.mcap next to it"""

    def __call__(self) -> int:
        out = self.out or self.file.with_name(f"{self.file.stem}_recovered.mcap")
        with frames_progress() as bar:
            saved = recover(self.file, out, task_progress(bar, self.file.name))
        lost_bytes = saved.size_bytes - saved.sound_bytes
        hurt = [f"{size_text(lost_bytes)} at the end are no complete chunk"] if saved.is_cut else []
        hurt += [f"{saved.lost_chunks} damaged chunks left out"] if saved.lost_chunks else []
        what = f"{saved.messages} messages in {saved.chunks} chunks, {saved.frames} frames"
        print(f"cipv: {out}: {what}; {'; '.join(hurt) or 'nothing was lost'}")
        return 0


def _between(source: Source, from_s: float | None, to_s: float | None) -> tuple[int, int]:
    """First and last frame of a part of the drive, given in seconds of playback. BadInput if it contains no frame."""
    times_s = timeline_s([source.t_ns(index) for index in range(len(source))], source.rate_hz)
    first = int(np.searchsorted(times_s, from_s - 1e-9)) if from_s is not None else 0
    last = int(np.searchsorted(times_s, to_s + 1e-9, side="right")) - 1 if to_s is not None else len(source) - 1
    if first > last:
        raise BadInput(f"no frame between --from and --to; the drive lasts {times_s[-1]:.1f} s")
    return first, last
