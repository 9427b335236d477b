"""What people want of the engine. There is no queue: a newer wish replaces an older one that was not served yet."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from pipeline.params import Params, with_changes


@dataclass(frozen=True)
class Wish:
    """The standing wishes (playing, speed, loop, params) and the ones served once (uri, target, steps)."""

    params: Params
    preset: str = "default"
    params_revision: int = 0
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

    def set_params(self, params: Params, preset: str | None = None) -> int:
        """Use these parameters from now on. Returns their revision."""
        with self._condition:
            old = self._wish
            revision = old.params_revision + 1
            self._replace(replace(old, params=params, preset=preset or old.preset, params_revision=revision))
            return revision

    def change_params(self, changes: Mapping[str, Any]) -> int:
        """Change some parameters, by their dotted names, as they stand at this moment: of two callers at once neither
        undoes the other. ParamsError for a bad one. Returns the revision."""
        with self._condition:
            return self.set_params(with_changes(self._wish.params, changes))

    def peek(self) -> Wish:
        """The wish as it stands, served or not."""
        with self._condition:
            return self._wish

    def superseded(self) -> bool:
        """True when the worker should drop what it is doing for a newer seek, source or the end."""
        with self._condition:
            return self._wish.stop or self._wish.uri is not None or self._wish.target is not None

    def take(self, timeout_s: float | None) -> Wish:
        """Wait until something changes or the time is over; the wishes served once are handed out and cleared."""
        with self._condition:
            self._condition.wait_for(lambda: self._changed, timeout_s)
            taken, self._changed = self._wish, False
            self._wish = replace(taken, uri=None, target=None, steps=0)
            return taken

    def _replace(self, wish: Wish) -> Wish:
        self._wish, self._changed = wish, True
        self._condition.notify_all()
        return wish
