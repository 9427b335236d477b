"""A drive as a car records it: inputs, results, a mark."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import islice
from pathlib import Path

from pipeline.detection import Detectors
from pipeline.params import Params
from pipeline.recording.recorder import Recorder
from pipeline.recording.save import about
from pipeline.run import through
from pipeline.sources import open_source
from pipeline.types import Frame, Result

SCENARIO, FIRST, LAST, MARKED = "sim:cut_in", 40, 109, 90
"""The frames that are recorded, and the marked one."""


@cache
def driven() -> tuple[tuple[Frame, Result], ...]:
    """The frames, without images, and their results."""
    source = open_source(SCENARIO)
    outlines = islice(source.outlines(), FIRST, LAST + 1)
    frames = (replace(frame, sweep=source.sweep(frame.index)) for frame in outlines)
    return tuple(through(frames, Params(), Detectors(), "lidar"))


def record(file: Path) -> tuple[Path, tuple[tuple[Frame, Result], ...]]:
    """A session of the drive, and the recorded results."""
    recorder = Recorder(file, about(open_source(SCENARIO)), queued=1000)
    for frame, result in driven():
        recorder.put(frame, result, Params())
        if frame.index == MARKED:
            recorder.mark("look here")
    assert recorder.stop().frames == LAST + 1 - FIRST
    return file, driven()
