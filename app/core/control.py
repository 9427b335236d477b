"""Requests of clients to the engine. There is no queue: a newer request replaces an older one that is still pending."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, Protocol

from pipeline.params import Params, changes_of, with_changes


@dataclass(frozen=True)
class Wish:
    """The requested state at one moment: persistent values, and one-shot requests that are served once."""

    params: Params
    """Parameters for the shown frame and for whole-drive runs."""
    preset: str = "default"
    """The preset that the parameters started from."""
    params_revision: int = 0
    """Incremented with every change of parameters."""
    settled: bool = True
    """Whether the parameters are final; false while a slider is being dragged."""
    playing: bool = False
    """False pauses on the shown frame."""
    speed: float = 1.0
    """Playback rate; 1 is real time."""
    loop: bool = True
    """Playback starts again at the end of the drive."""
    uri: str | None = None
    """One-shot: the source to open."""
    target: int | None = None
    """One-shot: the frame to seek to."""
    steps: int = 0
    """One-shot: number of frames to move by."""
    stop: bool = False
    """Whether the engine should stop."""


class Settling(Protocol):
    """Called with final changes of parameters."""

    def __call__(self, changes: Mapping[str, tuple[Any, Any]], person: str, *, merges: bool) -> object:
        """changes: by dotted name (and ``preset``), before and after. merges: undone together with the previous
        change."""
        ...


class Asking(Protocol):
    """Called when a client starts to wait for a request."""

    def __call__(self, *, rests: bool) -> object:
        """rests: the request is of a kind that usually does not repeat immediately, unlike drags."""
        ...


PRESET = "preset"
"""Name of the preset in changes of parameters."""


class Control:
    """Passes requests from any number of threads to the single worker.

    ``on_settle`` is called on the thread that changed parameters, before the call returns, one change at a time.
    ``on_ask`` is called on the thread that requests another frame, source, parameters or the end, before the worker
    takes the request; it must be quick.
    """

    def __init__(self, first: Wish) -> None:
        self.on_settle: Settling = lambda changes, person, *, merges: None
        self.on_ask: Asking = lambda *, rests: None
        self._wish = first
        self._settled = (first.params, first.preset)
        self._settling = threading.RLock()
        self._condition = threading.Condition(threading.RLock())
        self._changed = first.uri is not None

    def change(self, **values: Any) -> Wish:
        """Replace fields of the requested state and wake the worker."""
        with self._condition:
            return self._replace(replace(self._wish, **values))

    def seek(self, index: int) -> None:
        """Go to a frame. This replaces an earlier seek and any pending steps."""
        self.change(target=index, steps=0)

    def step(self, count: int) -> None:
        """Pause, and move by ``count`` frames. Steps add up: three presses are three frames."""
        with self._condition:
            self._replace(replace(self._wish, playing=False, steps=self._wish.steps + count))

    def set_params(
        self,
        params: Params,
        preset: str | None = None,
        *,
        final: bool = True,
        merges: bool = False,
        person: str = "",
    ) -> int:
        """Use these parameters from now on. Returns their revision.

        final: a change that can be undone; otherwise the parameters are only tried, as while a slider is dragged.
        merges: undone together with the previous change if that was of the same parameters. person: who made the
        change.
        """
        with self._settling:
            revision, changes = self._take(params, preset, final)
            if changes:
                self.on_settle(changes, person, merges=merges)
            return revision

    def change_params(
        self, changes: Mapping[str, Any], *, final: bool = True, merge: bool = False, person: str = ""
    ) -> int:
        """Change some parameters, by their dotted names, starting from the current values: of two concurrent callers,
        neither overwrites the other. ParamsError for an invalid one. Returns the revision."""
        with self._settling:
            changed = with_changes(self.peek().params, changes)
            return self.set_params(changed, final=final, merges=merge, person=person)

    def restore(self, changes: Mapping[str, Any]) -> None:
        """Set parameters as part of undo or redo, by dotted name (and ``preset``), without recording a new step.
        Parameters that are only being tried are discarded. ParamsError if they are no longer valid."""
        with self._settling, self._condition:
            self._settled = self.check(changes)
            self._use(*self._settled, settled=True)

    def check(self, changes: Mapping[str, Any]) -> tuple[Params, str]:
        """Parameters and preset that ``restore`` would set."""
        params, preset = self._settled
        values = {name: value for name, value in changes.items() if name != PRESET}
        return with_changes(params, values), changes.get(PRESET, preset)

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Prevents others from finalising parameters during the block."""
        with self._settling:
            yield

    def forget_tried(self) -> bool:
        """Revert to the last final parameters; false if no others are being tried."""
        with self._settling, self._condition:
            if self._wish.params == self._settled[0]:
                return False
            self._use(*self._settled, settled=True)
            return True

    def peek(self) -> Wish:
        """The current requested state, served or not."""
        with self._condition:
            return self._wish

    def superseded(self) -> bool:
        """Whether the worker should abort its current work for a newer seek, source or the end."""
        with self._condition:
            return self._wish.stop or self._wish.uri is not None or self._wish.target is not None

    @property
    def waiting(self) -> bool:
        """Whether there are changes that the worker has not taken yet."""
        return self._changed

    def take(self, timeout_s: float | None) -> Wish:
        """Wait for a change or the timeout; one-shot requests are returned and cleared."""
        with self._condition:
            self._condition.wait_for(lambda: self._changed, timeout_s)
            taken, self._changed = self._wish, False
            self._wish = replace(taken, uri=None, target=None, steps=0)
            return taken

    def _take(self, params: Params, preset: str | None, final: bool) -> tuple[int, dict[str, tuple[Any, Any]]]:
        """The revision, and the values that became final."""
        with self._condition:
            preset = preset or self._wish.preset
            revision = self._use(params, preset, final)
            if not final:
                return revision, {}
            (old, old_preset), self._settled = self._settled, (params, preset)
            changes = changes_of(old, params)
            if preset != old_preset:
                changes[PRESET] = (old_preset, preset)
            return revision, changes

    def _use(self, params: Params, preset: str, settled: bool) -> int:
        revision = self._wish.params_revision + 1
        self._replace(replace(self._wish, params=params, preset=preset, params_revision=revision, settled=settled))
        return revision

    def _replace(self, wish: Wish) -> Wish:
        before, self._wish, self._changed = self._wish, wish, True
        is_moved = (wish.target, wish.steps) != (before.target, before.steps)
        is_changed = (wish.uri, wish.params_revision, wish.stop) != (before.uri, before.params_revision, before.stop)
        if is_moved or is_changed:
            self.on_ask(rests=not is_moved and wish.settled)
        self._condition.notify_all()
        return wish
