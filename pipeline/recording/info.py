"""Describes the contents of a recording: topics, rates, gaps, duration."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pipeline.recording import topics
from pipeline.recording.mcap.chain import Chain, verify
from pipeline.recording.mcap.reader import McapFile
from pipeline.recording.neighbours import missing_neighbours
from pipeline.recording.session.provenance import About
from pipeline.recording.session.source import SessionSource
from pipeline.types.source import Source, SourceError

_GAP_STEPS = 1.5
"""A gap is a step of more than this many usual steps."""


@dataclass(frozen=True)
class Rhythm:
    """Timing of a sequence of messages."""

    count: int
    """Number of messages."""
    first_ns: int | None
    """None for none."""
    last_ns: int | None
    """Sum of all steps, except those back in time."""
    duration_s: float
    """All steps together, but those back in time."""
    rate_hz: float | None
    """Mean rate; None for fewer than two messages or if all have the same time."""
    usual_step_s: float | None
    """The median step, which is shorter than the mean if there are gaps."""
    gaps: int
    """Steps of more than 1.5 usual ones."""
    longest_gap_s: float | None
    """The longest step of all."""


@dataclass(frozen=True)
class TopicInfo:
    """One topic of a file."""

    topic: str
    """With its slashes."""
    schema: str
    """Name of its messages' type."""
    encoding: str
    """Encoding of its messages, such as ``json`` or ``protobuf``."""
    rhythm: Rhythm
    """By log time, i.e. when its messages were received."""


@dataclass(frozen=True)
class Info:
    """One MCAP file, recorded by this program or another one."""

    path: str
    """As it was given."""
    bytes: int
    """Of the file."""
    profile: str
    """From the file's header; empty for none."""
    duration_s: float
    """From the first message to the last."""
    about: About | None
    """None if the file is not a session."""
    frames: Rhythm | None
    """By header time; None without frames."""
    topics: tuple[TopicInfo, ...]
    """One for each channel of the file."""
    chunks: int
    """Total number of chunks."""
    damaged_chunks: int
    """Number of chunks whose content cannot be read."""
    marks: tuple[str, ...]
    """Made by a user during the recording."""
    problem: str | None
    """What is missing in the file; None for a complete one."""
    chain: Chain | None
    """Result of the integrity check; None if it was not performed."""
    missing_neighbours: tuple[str, ...]
    """Which files of the same recording are missing or were replaced, in words."""


def info(path: Path, *, is_quick: bool = False, key: str | None = None) -> Info:
    """Info about any MCAP file; BadInput if it is not one. is_quick: reads message indexes instead of messages, and
    leaves out ``chain``, which requires reading all bytes. key: the public key of the expected signature."""
    with McapFile(path) as file:
        times = file.log_times()
        listed = tuple(
            TopicInfo(channel.topic, channel.schema_name, channel.message_encoding, rhythm(stamps))
            for channel, stamps in sorted(times.items(), key=lambda item: item[0].topic)
        )
        ends = [(stamps[0], stamps[-1]) for stamps in times.values() if len(stamps)]
        duration_s = (max(last for _, last in ends) - min(first for first, _ in ends)) / 1e9 if ends else 0.0
        about, frames, marks = _about_session(path, file)
        return Info(
            path=str(path),
            bytes=file.size,
            profile=file.directory.profile,
            duration_s=float(duration_s),
            about=about,
            frames=frames,
            topics=listed,
            chunks=len(file.directory.chunks),
            damaged_chunks=len(file.damaged),
            marks=marks,
            problem=file.directory.problem,
            chain=None if is_quick else verify(path, key=key),
            missing_neighbours=missing_neighbours(path, file),
        )


def info_of_source(source: Source) -> Rhythm:
    """Timing of the frames of any other recording, by header time."""
    return rhythm(np.array([source.t_ns(index) for index in range(len(source))], dtype=np.int64))


def rhythm(stamps_ns: npt.NDArray[np.int64]) -> Rhythm:
    """Timing of (N,) times in ns, in order of arrival; steps back in time are not counted."""
    steps = np.diff(stamps_ns)
    steps = steps[steps > 0]
    usual_ns = float(np.median(steps)) if len(steps) else None
    return Rhythm(
        count=len(stamps_ns),
        first_ns=int(stamps_ns[0]) if len(stamps_ns) else None,
        last_ns=int(stamps_ns[-1]) if len(stamps_ns) else None,
        duration_s=float(steps.sum() / 1e9),
        rate_hz=round(len(steps) * 1e9 / float(steps.sum()), 3) if usual_ns else None,
        usual_step_s=usual_ns / 1e9 if usual_ns else None,
        gaps=int(np.count_nonzero(steps > _GAP_STEPS * usual_ns)) if usual_ns else 0,
        longest_gap_s=float(steps.max() / 1e9) if len(steps) else None,
    )


def _about_session(path: Path, file: McapFile) -> tuple[About | None, Rhythm | None, tuple[str, ...]]:
    metadata = file.metadata(topics.METADATA)
    if metadata is None:
        return None, None, ()
    try:
        about = About.from_metadata(metadata)
    except ValueError:
        return None, None, ()
    try:
        session = SessionSource(str(path), str(path))
    except SourceError:
        return about, None, ()
    try:
        return about, info_of_source(session), tuple(mark.text for mark in session.marks())
    finally:
        session.close()
