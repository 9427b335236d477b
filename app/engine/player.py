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
    """As ``pipeline.sources.open_any``."""

    def __call__(self, uri: str, /, *, progress: Progress) -> AnySource: ...


class Player(Protocol):
    """Runs the pipeline on a recording or on live sensors. Used by the worker thread alone.

    live: sensors. count, duration_s: frames and length of a recording, 0 of sensors. skipped: frames since the opening
    that came and were not shown.
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

    def open(self) -> None:
        """Begin, once what was open before is closed."""
        ...

    def wait_s(self, index: int) -> float | None:
        """Seconds until it needs the worker, with this frame shown; None while only a wish or its own call does."""
        ...

    def wait(self, params: Params) -> None:
        """Wait shortly for the next input of the pipeline. Other threads may work meanwhile."""
        ...

    def serve(self, wish: Wish, shown: Snapshot) -> ProcessedFrame | None:
        """What a wish makes of it; None when what is shown stays."""
        ...

    def go_on(self, standing: Wish, index: int) -> None:
        """Make ready for what comes after the frame that is shown from now on."""
        ...

    def time_s(self, processed: ProcessedFrame) -> float:
        """Where a tick is on the timeline."""
        ...

    def health(self, shown: Snapshot) -> Snapshot:
        """The snapshot with how its sensors do, when that is due."""
        ...

    def goes_on_after_failing(self) -> bool:
        """Something went wrong: whether it plays on all the same."""
        ...

    def successor(self, detectors: Detectors) -> Player | None:
        """Who goes on with these detectors where this one hangs; None where one made anew will do."""
        ...

    def close(self) -> None:
        """Give everything back. Safe to call twice."""
        ...
