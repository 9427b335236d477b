"""Single frames for pages with their own playhead, such as labeling pages, independent of other pages."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass

from app.engine.processed_frame import ProcessedFrame
from app.engine.seekable_pipeline import SeekablePipeline
from pipeline.params import Params


@dataclass(frozen=True, eq=False)
class PageFrame:
    """A frame as shown on one page."""

    uri: str
    """URI of the recording."""
    time_s: float
    """Its position on the playback timeline."""
    processed: ProcessedFrame
    """Exact if the whole drive has been run up to it."""


class PageFrames:
    """Any thread; frames are made one at a time, with priority over background work. foreground: see
    ``compute_scheduler``."""

    def __init__(self, foreground: Callable[[], AbstractContextManager[object]]) -> None:
        self._foreground = foreground
        self._lock = threading.Lock()
        self._pipeline: SeekablePipeline | None = None

    def open(self, pipeline: SeekablePipeline | None) -> None:
        """Use this pipeline for frames; None while no recording is open. A frame in progress is still made with the old
        one."""
        self._pipeline = pipeline

    def can_be_exact(self, frame: PageFrame) -> bool:
        """Whether the whole-drive run has now reached it: made again, the frame would be exact."""
        pipeline, shown = self._pipeline, frame.processed
        if pipeline is None or shown.exact or not shown.whole:
            return False
        return pipeline.knows(shown.frame.index, shown.params)

    def make(self, index: int, params: Params, superseded: Callable[[], bool], *, at_once: bool) -> PageFrame | None:
        """The frame, as the shared playhead would show it. None without a recording, or if ``superseded`` became true
        meanwhile. at_once: see ``SeekablePipeline.seek``."""
        with self._lock:
            pipeline = self._pipeline
            if pipeline is None or superseded():
                return None
            index = min(max(index, 0), len(pipeline.source) - 1)
            with self._foreground():
                processed = pipeline.seek(index, params, superseded, at_once=at_once)
            if processed is None:
                return None
            return PageFrame(pipeline.source.uri, float(pipeline.timeline_s[index]), processed)
