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
    """What clients want at one moment: standing values, and requests that are served once."""

    params: Params
    """For the shown frame and for whole-drive runs."""
    preset: str = "default"
    """The preset that the parameters started from."""
    params_revision: int = 0
    """Grows with every change of parameters."""
    settled: bool = True
    """The parameters are meant to stay; false while a slider is being dragged."""
    playing: bool = False
    """False holds the shown frame."""
    speed: float = 1.0
    """Playback rate; 1 is real time."""
    loop: bool = True
    """Playback starts again at the end of the drive."""
    uri: str | None = None
    """Served once: the source to open."""
    target: int | None = None
    """Served once: the frame to seek to."""
    steps: int = 0
    """Served once: frames to move by."""
    stop: bool = False
    """The engine shall end."""


class Settling(Protocol):
    """Called with changes of parameters that are meant to stay."""

    def __call__(self, changes: Mapping[str, tuple[Any, Any]], person: str, *, merges: bool) -> object:
        """changes: by dotted name (and ``preset``), before and after. merges: one step with the change before it."""
        ...


class Asking(Protocol):
    """Called when a client starts to wait for something."""

    def __call__(self, *, rests: bool) -> object:
        """rests: the request is not of a kind that usually repeats at once, as drags do."""
        ...


PRESET = "preset"
"""The name under which changes of parameters hold the preset."""


class Control:
    """Hands requests from any number of threads to the one worker.

    ``on_settle`` is called on the thread that changed parameters, before the call returns, one change after another.
    ``on_ask`` is called on the thread that asks for another frame, source, parameters or the end, before the worker
    takes the request; it must be quick."""

    def __init__(self, first: Wish) -> None:
        self.on_settle: Settling = lambda changes, person, *, merges: None
        self.on_ask: Asking = lambda *, rests: None
        self._wish = first
        self._settled = (first.params, first.preset)
        self._settling = threading.RLock()
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
        self,
        params: Params,
        preset: str | None = None,
        *,
        final: bool = True,
        merges: bool = False,
        person: str = "",
    ) -> int:
        """Use these parameters from now on. Returns their revision.

        final: a step that can be undone; otherwise they are only tried, as while a slider is dragged. merges: one step
        with the change before it, when that was of the same parameters. person: whose step it is."""
        with self._settling:
            revision, changes = self._take(params, preset, final)
            if changes:
                self.on_settle(changes, person, merges=merges)
            return revision

    def change_params(
        self, changes: Mapping[str, Any], *, final: bool = True, merge: bool = False, person: str = ""
    ) -> int:
        """Change some parameters, by their dotted names, as they stand at this moment: of two callers at once neither
        undoes the other. ParamsError for a bad one. Returns the revision."""
        with self._settling:
            changed = with_changes(self.peek().params, changes)
            return self.set_params(changed, final=final, merges=merge, person=person)

    def restore(self, changes: Mapping[str, Any]) -> None:
        """Parameters as an undone or redone step has them, by dotted name (and ``preset``): no step of its own. What is
        only tried at this moment goes. ParamsError when they are no parameters any more."""
        with self._settling, self._condition:
            self._settled = self.check(changes)
            self._use(*self._settled, settled=True)

    def check(self, changes: Mapping[str, Any]) -> tuple[Params, str]:
        """Parameters and preset as ``restore`` would have them."""
        params, preset = self._settled
        values = {name: value for name, value in changes.items() if name != PRESET}
        return with_changes(params, values), changes.get(PRESET, preset)

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Nobody else settles parameters while the block runs."""
        with self._settling:
            yield

    def forget_tried(self) -> bool:
        """Back to what was settled on; false when nothing else is being tried."""
        with self._settling, self._condition:
            if self._wish.params == self._settled[0]:
                return False
            self._use(*self._settled, settled=True)
            return True

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

    def _take(self, params: Params, preset: str | None, final: bool) -> tuple[int, dict[str, tuple[Any, Any]]]:
        """The revision, and what is settled that was not before."""
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
