"""What people at the pages look at, for the views that the server draws: the selection, and who hides the 3D view; and
what they pick in those views, for the pages."""

from __future__ import annotations

import threading
from collections.abc import Callable


class Looks:
    """One selection for everybody, the newest; and how many pages hold a 3D view that they do not show. Any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._selected: int | None = None
        self._hiding: set[object] = set()
        self._listener: Callable[[], None] = lambda: None
        self._pages: Callable[[int | None], None] = lambda number: None

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
