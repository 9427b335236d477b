"""The frames of one page with its own playhead, computed on a thread beside the shared stream."""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace

from app.engine.page_frames import PageFrame, PageFrames
from app.engine.snapshot import Snapshot
from app.streaming.encode import Encoder

logger = logging.getLogger("cipv.stream")


class OwnPlayhead:
    """The playhead of one page. ``show`` and ``seen`` are called on the event loop; ``told`` gets each frame and its
    message on the thread that made it. index: the current frame."""

    def __init__(
        self,
        index: int,
        frames: PageFrames,
        threads: Executor,
        newest: Callable[[], tuple[Snapshot | None, int]],
        told: Callable[[PageFrame, bytes, int], None],
    ) -> None:
        self.index = index
        self._frames, self._threads, self._newest, self._told = frames, threads, newest, told
        self._encoder = Encoder()
        self._frame: PageFrame | None = None
        self._is_left = False
        self._wanted = 0

    def show(self, index: int) -> None:
        """Go to a frame; aborts making another one. Once left, it makes none."""
        self.index = index
        if self._is_left:
            return
        self._wanted += 1
        self._threads.submit(self._make, self._wanted)

    def seen(self, snapshot: Snapshot) -> None:
        """There is something new: parameters, or results of the whole drive."""
        shown = self._frame
        if shown is None or self._is_left:
            return
        is_other = snapshot.uri != shown.uri or snapshot.params != shown.processed.params
        if is_other or self._frames.can_be_exact(shown):
            self.show(self.index)

    def leave(self) -> None:
        """The page follows the shared playhead again, or has closed."""
        self._is_left = True

    def snapshot(self, shared: Snapshot) -> Snapshot:
        """The snapshot for this page, derived from the shared one."""
        own = self._frame
        if own is None or own.uri != shared.uri:
            return replace(shared, playing=False)
        index = own.processed.frame.index
        return replace(shared, processed=own.processed, index=index, time_s=own.time_s, playing=False)

    def _make(self, wanted: int) -> None:
        """Runs on its thread: makes the frame at once, and then as in the whole drive, unless another one is requested
        meanwhile."""

        def superseded() -> bool:
            return self._is_left or wanted != self._wanted

        try:
            for at_once in (True, False):
                shared, width_px = self._newest()
                if shared is None or superseded():
                    return
                made = self._frames.make(self.index, shared.params, superseded, at_once=at_once)
                if made is None or superseded():
                    return
                self._frame = made
                message = self._encoder.message(self.snapshot(shared), width_px)
                if message is not None:
                    self._told(made, message, shared.sequence)
                if made.processed.whole:
                    return
        except Exception:  # if a recording fails in any way, the page keeps the frame it has
            logger.exception("the frame of a page of its own")
