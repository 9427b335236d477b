"""A part of a drive with the results that the page shows: those of the run through the whole drive."""

from __future__ import annotations

from collections.abc import Iterator

from app.clips.jobs import Report
from app.drive.compute_scheduler import Turn
from app.drive.open_recording import Recording
from pipeline.params import Params
from pipeline.step import step
from pipeline.types import Frame, Result


def clip_frames(
    recording: Recording, params: Params, first: int, last: int, report: Report, turn: Turn, *, pictures: bool = True
) -> Iterator[tuple[Frame, Result]]:
    """Frames ``first`` to ``last``, both included; without ``pictures`` their pixels are missing. What a person waits
    for at the page goes first."""
    total = last + 1 - first
    report(0, total)
    state = recording.state_from_start(first, params)
    for index in range(first, last + 1):
        with turn.background(to_the_end=True):
            frame = recording.frame(index) if pictures else recording.input(index)
            state, result = step(state, frame, params)
        yield frame, result
        report(index + 1 - first, total)


def one_frame(recording: Recording, params: Params, index: int) -> tuple[Frame, Result]:
    """A frame with its picture, and its result."""
    frame = recording.frame(index)
    return frame, step(recording.state_from_start(index, params), frame, params)[1]
