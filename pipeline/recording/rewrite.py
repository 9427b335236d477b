"""One MCAP file from another: a clip of it, or what a cut file still holds. Messages are copied as they are."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.errors import BadInput
from pipeline.recording import topics
from pipeline.recording.container import McapFile, Stored
from pipeline.recording.messages import Damaged
from pipeline.recording.output import Output
from pipeline.recording.session import SessionSource
from pipeline.recording.tick import tick_from

Progress = Callable[[int, int], None]
"""Told (done, total) as the work goes on."""


@dataclass(frozen=True)
class Recovered:
    """What was saved. is_cut: the file's end was missing. sound_bytes: up to where its records were whole, of
    size_bytes. lost_chunks: whole in length, damaged in content."""

    messages: int
    frames: int
    chunks: int
    lost_chunks: int
    sound_bytes: int
    size_bytes: int
    is_cut: bool


def recover(path: Path, out: Path, progress: Progress = lambda done, total: None) -> Recovered:
    """Write every message of every complete chunk of ``path`` to a new, whole file ``out``.

    BadInput when ``path`` is no MCAP file or ``out`` exists.
    """
    with McapFile(path, walk=True) as file:
        directory = file.directory
        total = len(directory.chunks)

        def messages() -> Iterator[Stored]:
            for place in range(total):
                progress(place, total)
                yield from file.chunk(place)
            progress(total, total)

        copied, frames = _copy(messages(), file, out)
        return Recovered(
            messages=copied,
            frames=frames,
            chunks=total - len(file.damaged),
            lost_chunks=len(file.damaged),
            sound_bytes=directory.sound_bytes if directory.is_cut else file.size,
            size_bytes=file.size,
            is_cut=directory.is_cut,
        )


def clip(source: SessionSource, first: int, last: int, out: Path) -> int:
    """Frames ``first`` to ``last``, both included, as a session of their own, with results, marks and all else that
    was recorded meanwhile, and what these frames refer to from before. Returns the number of messages."""
    first_ns = source.log_time_ns(first)
    # a frame's companions (marks, notes) come after it, so the clip goes on to the next frame
    last_ns = source.log_time_ns(last + 1) - 1 if last + 1 < len(source) else 2**63 - 1
    earlier = _referred(source, first, last, first_ns)

    def messages() -> Iterator[Stored]:
        for at_ns, topic in earlier:
            yield from source.file.messages((topic,), at_ns, at_ns)
        yield from source.file.messages(None, first_ns, last_ns)

    copied, _ = _copy(messages(), source.file, out)
    return copied


def _referred(source: SessionSource, first: int, last: int, first_ns: int) -> list[tuple[int, str]]:
    """(log time, topic) of the messages from before the clip that its frames need, in order of time."""
    found: set[tuple[int, str]] = set()
    for stored in source.file.messages((topics.FRAMES,), first_ns, source.log_time_ns(last)):
        try:
            references = tick_from(stored.data).references()
        except Damaged:
            continue
        found |= {(at_ns, topic) for topic, at_ns in references.items() if at_ns < first_ns}
    return sorted(found)


def _copy(messages: Iterable[Stored], file: McapFile, out: Path) -> tuple[int, int]:
    """(messages, frames) written to a new file, with the metadata and, for a session, the list of its frames."""
    if out.exists() and out.samefile(file.path):
        raise BadInput(f"{out}: a file cannot be written over itself; choose another name")
    output, index, copied = Output(out, profile=file.directory.profile), [], 0
    try:
        for name in file.directory.metadata:
            output.add_metadata(name, file.metadata(name) or {})
        for stored in messages:
            output.add(stored.channel, stored.log_time_ns, stored.publish_time_ns, stored.data)
            copied += 1
            if stored.channel == topics.channel(topics.FRAMES):
                index.append((stored.log_time_ns, _header_ns(stored)))
        if topics.METADATA in file.directory.metadata:
            output.add_attachment(topics.INDEX, "application/octet-stream", np.array(index, dtype="<i8").tobytes())
        output.close()
    except BaseException:
        output.discard()
        raise
    return copied, len(index)


def _header_ns(stored: Stored) -> int:
    """A frame's own time; its message's publish time cannot be before 1970."""
    try:
        return tick_from(stored.data).t_ns
    except Damaged:
        return stored.publish_time_ns
