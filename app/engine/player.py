"""The interface between the engine's worker and what is open: a recording or live sensors."""

from __future__ import annotations

from typing import Protocol

from app.core.control import Wish
from app.engine.processed_frame import ProcessedFrame
from app.engine.snapshot import Snapshot
from pipeline.common.progress import Progress
from pipeline.detection import Detectors
from pipeline.params import Params
from pipeline.types.source import AnySource


class OpenSource(Protocol):
    """Same signature as ``pipeline.sources.open_any``."""

    def __call__(self, uri: str, /, *, progress: Progress) -> AnySource: ...


class Player(Protocol):
    """Runs the pipeline on a recording or on live sensors. Used by the worker thread only.

    live: whether these are live sensors. count, duration_s: frames and length of a recording, 0 for sensors. skipped:
    frames since opening that arrived but were not shown.
    """

    @property
    def source(self) -> AnySource: ...
    @property
    def live(self) -> bool: ...
    @property
    def count(self) -> int: ...
    @property
    def duration_s(self) -> float: ...
    @property
    def skipped(self) -> int: ...

    def open(self, wish: Wish) -> None:
        """Start, after the previous source was closed, with the parameters of a request."""
        ...

    def wait_s(self, index: int) -> float | None:
        """Seconds until it needs the worker, while this frame is shown; None if only a request or its own callback
        needs it."""
        ...

    def wait(self, params: Params) -> None:
        """Wait briefly for the next input of the pipeline. Other threads may work meanwhile."""
        ...

    def serve(self, wish: Wish, shown: Snapshot) -> ProcessedFrame | None:
        """Process a request; None if the shown frame stays."""
        ...

    def go_on(self, standing: Wish, index: int) -> None:
        """Prepare the frames that follow the given one."""
        ...

    def time_s(self, processed: ProcessedFrame) -> float:
        """Position of a tick on the timeline."""
        ...

    def health(self, shown: Snapshot) -> Snapshot:
        """The snapshot with the sensors' health, if an update is due."""
        ...

    def goes_on_after_failing(self) -> bool:
        """Whether it continues playback after an error."""
        ...

    def successor(self, detectors: Detectors) -> Player | None:
        """A player that takes over with these detectors if this one hangs; None if a newly created one can."""
        ...

    def close(self) -> None:
        """Release everything. Safe to call twice."""
        ...
