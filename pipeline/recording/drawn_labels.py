"""The labels that viewers show: messages per frame, next to a session's own label file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from pipeline.recording import topics
from pipeline.recording.mcap.reader import Stored
from pipeline.recording.session.source import SessionSource


class Drawn(NamedTuple):
    """One message of a frame."""

    topic: str
    """One of ``topics.OF_LABELS``."""
    data: bytes
    """In the topic's schema."""


NOTHING_DRAWN: Mapping[int, Sequence[Drawn]] = {}


def stored_of(source: SessionSource, drawn: Mapping[int, Sequence[Drawn]]) -> list[Stored]:
    """The messages at the times of their frames."""
    return [
        Stored(topics.channel(each.topic), source.log_time_ns(index), source.t_ns(index), each.data)
        for index, found in sorted(drawn.items())
        for each in found
    ]
