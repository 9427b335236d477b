"""Keeps the 3D view in step with the engine, on its own thread, newest frame only."""

from __future__ import annotations

import threading
from typing import Any

from app.core.latest_value import Newest
from app.core.shared_view_state import SharedViewState
from app.engine.engine import Engine
from app.engine.snapshot import Snapshot
from app.views.viser.view import ViserView
from pipeline.params import ParamsError


class SceneFeed:
    """Draws the engine's newest snapshot in viser while a browser shows the 3D view. Snapshots that arrive during
    drawing replace each other: the 3D view may be slower than the pipeline, but never lags behind it. Use it in a
    ``with`` block.

    drawn: frames drawn so far.
    """

    def __init__(self, engine: Engine, looks: SharedViewState | None = None) -> None:
        self._engine = engine
        self._looks = looks or SharedViewState()
        self._view = ViserView(
            engine.snapshot.params,
            self._moved,
            on_drag=self._looks.drag,
            on_pick=self._looks.pick,
            view_of=self._looks.view_of_name,
        )
        self._newest = Newest[Snapshot]()
        self.drawn = 0
        self._thread = threading.Thread(target=self._work, name="cipv-scene", daemon=True)

    @property
    def port(self) -> int:
        """viser's port on loopback."""
        return self._view.port

    def __enter__(self) -> SceneFeed:
        self._view.on_watched(lambda: self._newest.put(self._engine.snapshot))
        self._looks.on_change(lambda: self._newest.put(self._engine.snapshot))
        self._stop_listening = self._engine.listen(self._newest.put)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop_listening()
        self._newest.end()
        self._thread.join()
        self._view.close()

    def _moved(self, name: str, value: Any) -> None:
        """A slider in the 3D view was moved. Its bounds are those of the schema, so only a race can cause a refusal."""
        control = self._engine.control
        try:
            control.change_params({name: value}, merge=True)
        except ParamsError:
            self._view.set_params(control.peek().params)

    def _work(self) -> None:
        drawn: Snapshot | None = None
        while (newest := self._newest.take()) is not None:
            if self._view.watchers <= self._looks.hiding:
                continue
            self._view.look()
            if drawn is None or newest.params is not drawn.params:
                self._view.set_params(newest.params)
            if newest.processed is not None and (drawn is None or newest.processed is not drawn.processed):
                self._view.show(newest.processed.frame, newest.processed.result)
                self.drawn += 1
            drawn = newest
