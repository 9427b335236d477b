"""Converts any recording, or a part of it, to a session."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.common.progress import Progress, silent
from pipeline.recording.drawn_labels import NOTHING_DRAWN, Drawn, stored_of
from pipeline.recording.relabel import relabel
from pipeline.recording.rewrite import clip
from pipeline.recording.session.provenance import About
from pipeline.recording.session.source import SessionSource
from pipeline.recording.session.writer import SessionWriter
from pipeline.types.source import AnySource, Recorded, Source

if TYPE_CHECKING:
    from pipeline.detection import Detectors


def save(
    source: Source,
    out: Path,
    first: int = 0,
    last: int | None = None,
    progress: Progress = silent,
    labels: bytes | None = None,
    drawn: Mapping[int, Sequence[Drawn]] = NOTHING_DRAWN,
) -> None:
    """Write the inputs and labels of frames ``first`` to ``last`` (both included; None: to the end) to a new file.

    A part of a session keeps all its content: results, marks, parameters, labels. The pipeline gives the same results
    for both. labels: a label file that replaces existing labels. drawn: labels in the form shown by viewers, by frame.

    BadInput if ``out`` exists; if this fails, no file is left behind.
    """
    last = len(source) - 1 if last is None else last
    if isinstance(source, SessionSource):
        is_whole = (first, last) == (0, len(source) - 1)
        if (
            labels is not None
            and is_whole
            and relabel(source.file, out, labels, source.t_ns(last), progress, stored_of(source, drawn))
        ):
            return
        clip(source, first, last, out, labels, progress, drawn)
        return
    writer = SessionWriter(out, about(source))
    try:
        for index in range(first, last + 1):
            writer.write(source.frame(index), truth=source.truth(index))
            for each in drawn.get(index, ()):
                writer.write_drawn(each.topic, each.data)
            progress(index + 1 - first, last + 1 - first)
        if labels is not None:
            writer.write_labels(labels)
        writer.close()
    except BaseException:
        writer.discard()
        raise


def about(source: AnySource, detectors: Detectors | None = None) -> About:
    """Origin of a session made from this source, which is the original recording for a copy; and for results, the
    networks used."""
    origin = source.origin if isinstance(source, Recorded) else source.uri
    asked: tuple[object, ...] = ()
    if detectors is not None:
        asked = (detectors.boxes, detectors.lanes, detectors.far.detector if detectors.far is not None else None)
    networks = {each.name: each.sha256 for each in asked if hasattr(each, "name") and hasattr(each, "sha256")}
    return About(origin, source.title, source.rate_hz, source.notes, networks)
