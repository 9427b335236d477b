"""Starts the 3D view when a page first opens it, since viser takes half a second to import."""

from __future__ import annotations

import threading
from contextlib import ExitStack

from app.core.shared_view_state import SharedViewState
from app.engine.engine import Engine
from pipeline.common.garbage_collection import freeze_loaded_objects


class LateScene:
    """A ``SceneFeed`` that starts when its port is first requested. Use it in a ``with`` block."""

    def __init__(self, engine: Engine, looks: SharedViewState) -> None:
        self._engine, self._looks = engine, looks
        self._lock = threading.Lock()
        self._port: int | None = None
        self._running = ExitStack()
        self._ended = False

    def port(self) -> int | None:
        """viser's port on loopback; None after the end. The first request waits until viser listens. Any thread."""
        with self._lock:
            if self._port is None and not self._ended:
                from app.views.scene_feed import SceneFeed

                self._port = self._running.enter_context(SceneFeed(self._engine, self._looks)).port
                freeze_loaded_objects("viser")
            return self._port

    def __enter__(self) -> LateScene:
        return self

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._ended, self._port = True, None
            self._running.close()
