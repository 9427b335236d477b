"""What people at the pages look at, for the views that the server draws: the selection, who hides the 3D view, and the
cuboid that one of them labels; and what they pick in those views, for the pages."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass

from pipeline.common.geometry import Cuboid


@dataclass(frozen=True)
class HeldCuboid:
    """A labelled cuboid that may be dragged in the 3D view. page: whose it is; track: its label; frame: that the page
    shows it in."""

    page: object
    track: int
    frame: int
    cuboid: Cuboid

    def is_of(self, other: HeldCuboid | None) -> bool:
        """The same label in the same frame at the same page, wherever it is."""
        return other is not None and (self.page, self.track, self.frame) == (other.page, other.track, other.frame)


OnDrag = Callable[[HeldCuboid, bool], None]
"""What is held, as it is now, and whether the hand has let go."""


class SharedViewState:
    """One selection for everybody, the newest; and how many pages hold a 3D view that they do not show. Any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._selected: int | None = None
        self._hiding: set[object] = set()
        self._held: HeldCuboid | None = None
        self._listener: Callable[[], None] = lambda: None
        self._pages: Callable[[int | None], None] = lambda number: None
        self._on_drag: OnDrag = lambda held, ended: None

    def on_change(self, listener: Callable[[], None]) -> None:
        """Call ``listener`` after every change; there is one."""
        self._listener = listener

    def on_pick(self, pages: Callable[[int | None], None]) -> None:
        """Call ``pages`` with what was picked in a view of the server; there is one."""
        self._pages = pages

    def pick(self, number: int | None) -> None:
        """Somebody has clicked on this object in the 3D view, or beside all: it is selected here and at the pages."""
        self.select(number)
        self._pages(number)

    @property
    def selected(self) -> int | None:
        """The selected object's id."""
        with self._lock:
            return self._selected

    @property
    def hiding(self) -> int:
        """Pages that hold a 3D view and do not show it."""
        with self._lock:
            return len(self._hiding)

    def select(self, number: int | None) -> None:
        with self._lock:
            self._selected = number
        self._listener()

    def hide(self, page: object, hides: bool) -> None:
        """Whether this page hides its 3D view."""
        with self._lock:
            (self._hiding.add if hides else self._hiding.discard)(page)
        self._listener()

    @property
    def held(self) -> HeldCuboid | None:
        """The newest cuboid that a page lets a hand take in the 3D view."""
        with self._lock:
            return self._held

    def hold(self, held: HeldCuboid) -> None:
        with self._lock:
            self._held = held
        self._listener()

    def let_go(self, page: object) -> None:
        """This page holds nothing any more."""
        with self._lock:
            was = self._held is not None and self._held.page is page
            self._held = None if was else self._held
        if was:
            self._listener()

    def on_drag(self, listener: OnDrag) -> None:
        """Call ``listener`` when what is held is dragged; there is one."""
        self._on_drag = listener

    def drag(self, held: HeldCuboid, ended: bool) -> None:
        """A hand has this label and has brought it there, whatever else is held by now. Any thread."""
        with self._lock:
            if held.is_of(self._held):
                self._held = held
        self._on_drag(held, ended)
