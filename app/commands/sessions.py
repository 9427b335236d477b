"""`cipv import`, `export`, `info` and `recover`: sessions and what they are made from."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from app.bars import frames_progress
from app.export import Kind, export_clip
from app.options import LineOptions, SourceOptions
from app.playing.playback import timeline_s
from app.progress import opened_recording
from pipeline.errors import BadInput
from pipeline.recording.info import Info, Rhythm, info, info_of_source
from pipeline.recording.rewrite import recover
from pipeline.recording.save import save
from pipeline.run import Detectors
from pipeline.sources.base import Source

_WIDE = 120
"""Columns of what is written to a file or another program."""
_SAME_RATE = 0.05
"""Rates that differ less are one."""


@dataclass(frozen=True)
class Import:
    """Make a session of any recording: one MCAP file that opens here, in Foxglove and in rerun.

    Example: cipv import astyx:PATH --out drive.mcap
    """

    source: SourceOptions
    out: Path
    """The session to write; a new file ending in .mcap"""

    def __call__(self) -> int:
        source = self.source.open()
        with frames_progress() as bar:
            task = bar.add_task(source.title, total=len(source))
            save(source, self.out, progress=lambda done, total: bar.update(task, completed=done, total=total))
        print(f"cipv: {self.out}: {len(source)} frames, {_size(self.out.stat().st_size)}", file=sys.stderr)
        return 0


@dataclass(frozen=True)
class Export:
    """Write a recording, or a clip of it, as a rerun recording, a session or a table of its objects.

    Example: cipv export drive.mcap --from 12 --to 20 --rrd clip.rrd --csv clip.csv
    """

    source: SourceOptions
    from_s: Annotated[float | None, tyro.conf.arg(name="from", metavar="S")] = None
    """Begin at this second of the drive"""
    to_s: Annotated[float | None, tyro.conf.arg(name="to", metavar="S")] = None
    """End at this second of the drive"""
    rrd: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Write a rerun recording; the line is run anew, with the parameters that were recorded"""
    mcap: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Write a session"""
    csv: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Write a row for each object of each frame: the recorded results, else of the line run anew"""
    line: LineOptions = field(default_factory=LineOptions)

    def __call__(self) -> int:
        asked: tuple[tuple[Kind, Path | None], ...] = ("mcap", self.mcap), ("rrd", self.rrd), ("csv", self.csv)
        wanted: dict[Kind, Path] = {kind: path for kind, path in asked if path is not None}
        if not wanted:
            raise BadInput("nothing to write; say --rrd FILE, --mcap FILE or --csv FILE")
        source = self.source.open()
        first, last = _between(source, self.from_s, self.to_s)
        params = self.line.parameters() if self.line.changes_parameters() else None
        detectors = self.line.open_detectors(source) if wanted.keys() - {"mcap"} else Detectors()
        with frames_progress() as bar:
            for kind, path in wanted.items():
                task = bar.add_task(path.name, total=last + 1 - first)

                def show(done: int, total: int, task: object = task) -> None:
                    bar.update(task, completed=done, total=total)  # type: ignore[arg-type]

                export_clip(source, first, last, path, kind, params=params, detectors=detectors, progress=show)
        for path in wanted.values():
            print(f"cipv: {path}: {last + 1 - first} frames, {_size(path.stat().st_size)}", file=sys.stderr)
        return 0


@dataclass(frozen=True)
class ShowInfo:
    """What a recording holds: topics, rates, gaps, duration.

    Example: cipv info drive.mcap --json
    """

    source: tyro.conf.Positional[str]
    """An MCAP file, or any other source"""
    json: bool = False
    """Print the figures as JSON"""

    def __call__(self) -> int:
        if self.source.lower().endswith(".mcap"):
            found = info(Path(self.source.removeprefix("mcap:")).expanduser())
            _print_json(asdict(found)) if self.json else _print_info(found)
            return 0
        source = opened_recording(self.source)
        frames = info_of_source(source)
        if self.json:
            _print_json({"uri": source.uri, "title": source.title, "frames": asdict(frames), "notes": source.notes})
        else:
            print("\n".join((f"{source.title}: {_rhythm(frames)}", *source.notes)))
        return 0


@dataclass(frozen=True)
class Recover:
    """Save every complete chunk of an MCAP file that was cut off: by a crash, a full disk, a pulled plug.

    Example: cipv recover cut.mcap --out whole.mcap
    """

    file: tyro.conf.Positional[Path]
    """The file to read; it stays as it is"""
    out: Path | None = None
    """The file to write; else <name>_recovered.mcap beside it"""

    def __call__(self) -> int:
        out = self.out or self.file.with_name(f"{self.file.stem}_recovered.mcap")
        with frames_progress() as bar:
            task = bar.add_task(self.file.name, total=None)
            saved = recover(self.file, out, lambda done, total: bar.update(task, completed=done, total=total))
        lost_bytes = saved.size_bytes - saved.sound_bytes
        hurt = [f"{_size(lost_bytes)} at the end were no whole chunk"] if saved.is_cut else []
        hurt += [f"{saved.lost_chunks} chunks are damaged and left out"] if saved.lost_chunks else []
        what = f"{saved.messages} messages in {saved.chunks} chunks, {saved.frames} frames"
        print(f"cipv: {out}: {what}; {'; '.join(hurt) or 'nothing was missing'}")
        return 0


def _between(source: Source, from_s: float | None, to_s: float | None) -> tuple[int, int]:
    """First and last frame of a part of the drive, in seconds of playback. BadInput when nothing is in between."""
    times_s = timeline_s([source.t_ns(index) for index in range(len(source))], source.rate_hz)
    first = int(np.searchsorted(times_s, from_s - 1e-9)) if from_s is not None else 0
    last = int(np.searchsorted(times_s, to_s + 1e-9, side="right")) - 1 if to_s is not None else len(source) - 1
    if first > last:
        raise BadInput(f"no frame between --from and --to; the drive lasts {times_s[-1]:.1f} s")
    return first, last


def _print_json(values: dict[str, object]) -> None:
    print(json.dumps(values, indent=1, ensure_ascii=False, allow_nan=False))


def _print_info(found: Info) -> None:
    about = found.about
    title = f"{about.title} ({about.origin})" if about else f"profile {found.profile!r}"
    print(f"{found.path}: {title}, {_size(found.bytes)}, {found.duration_s:.1f} s")
    if found.frames is not None:
        print(f"frames by header time: {_rhythm(found.frames)}")
    Console(width=None if sys.stdout.isatty() else _WIDE).print(_topics_table(found))
    for line in (*(about.notes if about else ()), *(f"mark: {mark}" for mark in found.marks)):
        print(line)
    if found.problem is not None:
        print(f"{found.problem}; `cipv recover {found.path}` makes a whole file of it")
    if found.damaged_chunks:
        print(f"{found.damaged_chunks} of {found.chunks} chunks are damaged")


def _topics_table(found: Info) -> Table:
    table = Table(title="topics, by time of recording", title_justify="left", box=None, pad_edge=False)
    for name in ("topic", "schema", "count", "Hz", "gaps", "longest"):
        table.add_column(name, no_wrap=True, justify="left" if name in ("topic", "schema") else "right")
    for topic in found.topics:
        beat = topic.rhythm
        longest = "" if beat.longest_gap_s is None else f"{beat.longest_gap_s:.3f} s"
        table.add_row(topic.topic, topic.schema, str(beat.count), _rate(beat), str(beat.gaps or ""), longest)
    return table


def _rate(beat: Rhythm, unit: str = "") -> str:
    """Over the whole, with what it is between gaps where that is another."""
    if beat.rate_hz is None or beat.usual_step_s is None:
        return ""
    usual_hz = 1.0 / beat.usual_step_s
    differs = abs(usual_hz - beat.rate_hz) > _SAME_RATE * beat.rate_hz
    return f"{beat.rate_hz:.2f}{unit}" + (f" (usually {usual_hz:.2f})" if differs else "")


def _rhythm(frames: Rhythm) -> str:
    rate = "" if frames.rate_hz is None else f", {_rate(frames, ' Hz')}"
    gaps = "" if not frames.gaps else f", {frames.gaps} gaps, the longest {frames.longest_gap_s:.2f} s"
    return f"{frames.count} frames, {frames.duration_s:.1f} s{rate}{gaps}"


def _size(count: int) -> str:
    for unit, name in ((1e9, "GB"), (1e6, "MB")):
        if count >= unit:
            return f"{count / unit:.1f} {name}"
    return f"{count / 1e3:.0f} kB"
