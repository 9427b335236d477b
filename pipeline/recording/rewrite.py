"""Makes one MCAP file from another: a clip, or the readable part of a truncated file. Messages are copied unchanged."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pipeline.common.errors import BadInput
from pipeline.common.progress import Progress, silent
from pipeline.recording import topics
from pipeline.recording.drawn_labels import NOTHING_DRAWN, Drawn
from pipeline.recording.errors import Damaged
from pipeline.recording.mcap import chain
from pipeline.recording.mcap.output import Output
from pipeline.recording.mcap.reader import McapFile, Stored
from pipeline.recording.neighbours import NEIGHBOURS
from pipeline.recording.session.frame_list import FrameList
from pipeline.recording.session.frame_record import FrameRecord, frame_record_from, frame_record_message
from pipeline.recording.session.source import SessionSource
from pipeline.recording.session.velodyne_scan import PACKETS_BEFORE_NS


@dataclass(frozen=True)
class Recovered:
    """Result of a recovery."""

    messages: int
    """Number of messages copied."""
    frames: int
    """Number of complete frames among them."""
    chunks: int
    """Number of chunks read."""
    lost_chunks: int
    """Chunks with a valid length but damaged content."""
    sound_bytes: int
    """Offset up to which the file's records were complete."""
    size_bytes: int
    """Size of the damaged file."""
    is_cut: bool
    """Whether the end of the file was missing."""


def recover(path: Path, out: Path, progress: Progress = silent) -> Recovered:
    """Write every message of every complete chunk of ``path`` to a new, complete file ``out``.

    BadInput if ``path`` is not an MCAP file or has no complete chunk, or if ``out`` exists.
    """
    with McapFile(path, walk=True) as file:
        directory = file.directory
        total = len(directory.chunks)
        if not total:
            raise BadInput(f"{path}: no complete chunk: nothing can be recovered")

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


def clip(
    source: SessionSource,
    first: int,
    last: int,
    out: Path,
    labels: bytes | None = None,
    progress: Progress = silent,
    drawn: Mapping[int, Sequence[Drawn]] = NOTHING_DRAWN,
) -> int:
    """Write frames ``first`` to ``last``, both included, as a separate session, with results, marks and everything else
    recorded in that time. Earlier messages that these frames refer to (calibration, parameters) are moved directly
    before the first frame. Labels contain frame names, so they are copied completely; ``labels`` replaces them, with
    the form shown by viewers in ``drawn``, by frame. ``progress`` counts frames. Returns the number of messages."""
    first_ns = source.log_time_ns(first)
    # related messages of a frame (marks, notes) follow it, so the clip extends to the next frame
    last_ns = source.log_time_ns(last + 1) - 1 if last + 1 < len(source) else 2**63 - 1
    earlier = _referred(source, last, first_ns)
    times = sorted({at_ns for at_ns, _ in earlier})
    to_ns = {at_ns: max(first_ns - len(times) + place, 0) for place, at_ns in enumerate(times)}

    def messages() -> Iterator[Stored]:
        yield from source.file.messages((topics.PACKETS,), first_ns - PACKETS_BEFORE_NS, first_ns - 1)
        for at_ns, topic in earlier:
            for stored in source.file.messages((topic,), at_ns, at_ns):
                yield stored._replace(log_time_ns=to_ns[at_ns])
        at_ns, done = first_ns, 0
        for stored in source.file.messages(None, first_ns, last_ns):
            if stored.channel.topic not in (topics.OF_LABELS if labels is not None else (topics.LABELS,)):
                at_ns, is_frame = stored.log_time_ns, stored.channel.topic == topics.FRAMES
                yield _with_references_moved(stored, to_ns) if is_frame else stored
                if is_frame:
                    for each in drawn.get(first + done, ()):
                        yield Stored(topics.channel(each.topic), at_ns, stored.publish_time_ns, each.data)
                    done += 1
                    progress(done, last + 1 - first)
        said = labels if labels is not None else source.labels()
        if said is not None:
            yield Stored(topics.channel(topics.LABELS), at_ns, source.t_ns(last), said)

    copied, _ = _copy(messages(), source.file, out)
    return copied


def _with_references_moved(stored: Stored, to_ns: Mapping[int, int]) -> Stored:
    try:
        return stored._replace(data=frame_record_message(frame_record_from(stored.data).moved(to_ns)))
    except Damaged:
        return stored


def _referred(source: SessionSource, last: int, first_ns: int) -> list[tuple[int, str]]:
    """(log time, topic) of earlier messages that the clip's frames need, in order of time. first_ns: the clip's start;
    last: its last frame."""
    found: set[tuple[int, str]] = set()
    for stored in source.file.messages((topics.FRAMES,), first_ns, source.log_time_ns(last)):
        try:
            references = frame_record_from(stored.data).references()
        except Damaged:
            continue
        found |= {(at_ns, topic) for topic, at_ns in references.items() if at_ns < first_ns}
    return sorted(found)


def _copy(messages: Iterable[Stored], file: McapFile, out: Path) -> tuple[int, int]:
    """(messages, frames) written to a new file, with the metadata and, for a session, the list of its frames."""
    output, frames, copied = Output(out, profile=file.directory.profile), FrameList(), 0
    try:
        for name in file.directory.metadata.keys() - {chain.NAME, *NEIGHBOURS}:  # the new file has its own chain
            output.add_metadata(name, file.metadata(name) or {})
        for stored in messages:
            output.add(stored.channel, stored.log_time_ns, stored.publish_time_ns, stored.data)
            copied += 1
            if stored.channel == topics.channel(topics.FRAMES):
                tick = _record_or_nothing(stored)
                frames.add(stored.log_time_ns, stored.publish_time_ns if tick is None else tick.t_ns, tick)
        if topics.METADATA in file.directory.metadata:
            frames.attach(output)
        output.close()
    except BaseException:
        output.discard()
        raise
    return copied, len(frames)


def _record_or_nothing(stored: Stored) -> FrameRecord | None:
    """With the frame's own time; a message's publish time cannot be before 1970."""
    try:
        return frame_record_from(stored.data)
    except Damaged:
        return None
