"""What people want of the engine. There is no queue: a newer wish replaces an older one that was not served yet."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from app.undo import History, Setting
from pipeline.params import Params, with_changes


@dataclass(frozen=True)
class Wish:
    """The standing wishes (playing, speed, loop, params) and the ones served once (uri, target, steps).

    settled: the parameters are meant to stay; false while a slider is being dragged."""

    params: Params
    preset: str = "default"
    params_revision: int = 0
    settled: bool = True
    playing: bool = False
    speed: float = 1.0
    loop: bool = True
    uri: str | None = None
    target: int | None = None
    steps: int = 0
    stop: bool = False


class Control:
    """The hand-over between any number of callers and the one worker."""

    def __init__(self, first: Wish) -> None:
        self._wish = first
        self._history = History(Setting(first.params, first.preset))
        self._condition = threading.Condition(threading.RLock())
        self._changed = first.uri is not None

    def change(self, **values: Any) -> Wish:
        """Replace fields of the wish and wake the worker."""
        with self._condition:
            return self._replace(replace(self._wish, **values))

    def seek(self, index: int) -> None:
        """Go to a frame. It replaces an older seek and any steps not yet made."""
        self.change(target=index, steps=0)

    def step(self, count: int) -> None:
        """Pause, and move by ``count`` frames. Steps add up: three presses are three frames."""
        with self._condition:
            self._replace(replace(self._wish, playing=False, steps=self._wish.steps + count))

    def set_params(
        self, params: Params, preset: str | None = None, *, final: bool = True, merges: frozenset[str] = frozenset()
    ) -> int:
        """Use these parameters from now on. Returns their revision.

        final: a step that can be undone; otherwise they are only tried, as while a slider is dragged. merges: names
        whose changes one after the other are one step."""
        with self._condition:
            setting = Setting(params, preset or self._wish.preset)
            if final:
                self._history = self._history.settle(setting, merges)
            return self._use(setting, final)

    def change_params(self, changes: Mapping[str, Any], *, final: bool = True, merge: bool = False) -> int:
        """Change some parameters, by their dotted names, as they stand at this moment: of two callers at once neither
        undoes the other. ParamsError for a bad one. Returns the revision."""
        with self._condition:
            merges = frozenset(changes) if merge else frozenset()
            return self.set_params(with_changes(self._wish.params, changes), final=final, merges=merges)

    def undo(self) -> bool:
        """Back to what was settled on before; what is only tried at this moment goes first. False: nothing to undo."""
        with self._condition:
            tried = self._wish.params != self._history.now.params
            return self._move(self._history if tried else self._history.back())

    def redo(self) -> bool:
        """What was undone last, again. False: nothing to redo."""
        with self._condition:
            return self._move(self._history.forth())

    @property
    def can_undo(self) -> bool:
        return bool(self._history.past)

    @property
    def can_redo(self) -> bool:
        return bool(self._history.future)

    def peek(self) -> Wish:
        """The wish as it stands, served or not."""
        with self._condition:
            return self._wish

    def superseded(self) -> bool:
        """True when the worker should drop what it is doing for a newer seek, source or the end."""
        with self._condition:
            return self._wish.stop or self._wish.uri is not None or self._wish.target is not None

    @property
    def waiting(self) -> bool:
        """Whether anything has changed that the worker has not taken yet."""
        return self._changed

    def take(self, timeout_s: float | None) -> Wish:
        """Wait until something changes or the time is over; the wishes served once are handed out and cleared."""
        with self._condition:
            self._condition.wait_for(lambda: self._changed, timeout_s)
            taken, self._changed = self._wish, False
            self._wish = replace(taken, uri=None, target=None, steps=0)
            return taken

    def _move(self, history: History | None) -> bool:
        if history is None:
            return False
        self._history = history
        self._use(history.now, settled=True)
        return True

    def _use(self, setting: Setting, settled: bool) -> int:
        revision = self._wish.params_revision + 1
        params, preset = setting
        self._replace(replace(self._wish, params=params, preset=preset, params_revision=revision, settled=settled))
        return revision

    def _replace(self, wish: Wish) -> Wish:
        self._wish, self._changed = wish, True
        self._condition.notify_all()
        return wish
