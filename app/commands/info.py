"""`cipv info`: show what a recording contains."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.table import Table

from app.commands.support.arguments import option
from pipeline.common.errors import BadInput
from pipeline.common.files.remote_files import is_remote
from pipeline.common.files.signing import expected_key
from pipeline.common.files.user_file_errors import given_path
from pipeline.recording.info import Info, Rhythm, info, info_of_source

_WIDE = 120
"""Width in characters of output to a file or another program."""
_SAME_RATE = 0.05
"""Rates that differ by a smaller share are shown as one."""


@dataclass(frozen=True)
class ShowInfo:
    """Show what a recording contains: topics, rates, gaps, duration.

    Example: cipv info drive.mcap --json
    """

    source: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SOURCE")]
    """An MCAP file, or any other source"""
    json: bool = False
    """Print the figures as JSON"""
    quick: bool = False
    """Skip the check for changes since recording, which reads the whole MCAP file"""
    public_key: Annotated[Path | None, option("FILE")] = None
    """Public key that the session must be signed with, of `cipv keys new`; exit code 1 if it is not"""

    def __call__(self) -> int:
        if self.source.lower().endswith(".mcap") and not is_remote(self.source):
            if self.quick and self.public_key is not None:
                raise BadInput("--quick does not check signatures; leave out --quick or --public-key")
            key = None if self.quick else expected_key(self.public_key)
            found = info(given_path(self.source.removeprefix("mcap:")), is_quick=self.quick, key=key)
            _print_json(asdict(found)) if self.json else _print_info(found)
            is_trusted = found.chain is not None and found.chain.is_signed_whole()
            return 0 if key is None or is_trusted else 1
        if self.public_key is not None:
            raise BadInput(f"{self.source}: only sessions, files ending in .mcap, are signed")
        from app.commands.support.open_with_progress import opened_recording

        source = opened_recording(self.source)
        frames = info_of_source(source)
        if self.json:
            _print_json({"uri": source.uri, "title": source.title, "frames": asdict(frames), "notes": source.notes})
        else:
            print("\n".join((f"{source.title}: {_rhythm(frames)}", *source.notes)))
        return 0


def _print_json(values: dict[str, object]) -> None:
    print(json.dumps(values, indent=1, ensure_ascii=False, allow_nan=False))


def _print_info(found: Info) -> None:
    about = found.about
    title = f"{about.title} ({about.origin})" if about else f"profile {found.profile!r}"
    print(f"{found.path}: {title}, {size_text(found.bytes)}, {found.duration_s:.1f} s")
    if found.frames is not None:
        print(f"frames by header time: {_rhythm(found.frames)}")
    Console(width=None if sys.stdout.isatty() else _WIDE).print(_topics_table(found))
    for line in (*(about.notes if about else ()), *(f"mark: {mark}" for mark in found.marks)):
        print(line)
    if found.chain is not None:
        print("; ".join((f"hash chain: {found.chain.state}", *found.chain.changed)))
        print(f"signature: {found.chain.signature}")
    for line in found.missing_neighbours:
        print(line)
    if found.problem is not None:
        print(f"{found.problem}; run `cipv recover {found.path}` to repair it")
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
    """The rate over the whole recording and, if it differs, the rate between gaps."""
    if beat.rate_hz is None or beat.usual_step_s is None:
        return ""
    usual_hz = 1.0 / beat.usual_step_s
    differs = abs(usual_hz - beat.rate_hz) > _SAME_RATE * beat.rate_hz
    return f"{beat.rate_hz:.2f}{unit}" + (f" (usually {usual_hz:.2f})" if differs else "")


def _rhythm(frames: Rhythm) -> str:
    rate = "" if frames.rate_hz is None else f", {_rate(frames, ' Hz')}"
    gaps = "" if not frames.gaps else f", {frames.gaps} gaps, the longest {frames.longest_gap_s:.2f} s"
    return f"{frames.count} frames, {frames.duration_s:.1f} s{rate}{gaps}"


def size_text(count: int) -> str:
    """A number of bytes in readable units."""
    for unit, name in ((1e9, "GB"), (1e6, "MB")):
        if count >= unit:
            return f"{count / unit:.1f} {name}"
    return f"{count / 1e3:.0f} kB"
