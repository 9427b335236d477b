"""View state shared between pages and the views that the server draws: each page's selection, its labels and the cuboid
that it edits, and what was picked in those views, with the page that it was picked for."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

from pipeline.common.geometry import Cuboid


@dataclass(frozen=True)
class HeldCuboid:
    """A labelled cuboid that may be dragged in the 3D view."""

    page: object
    """Whose it is."""
    track: int
    """Its label."""
    frame: int
    """That the page shows it in."""
    cuboid: Cuboid
    """In the ego frame, as the page has it."""

    def is_of(self, other: HeldCuboid | None) -> bool:
        """The same label in the same frame at the same page, wherever it is."""
        return other is not None and (self.page, self.track, self.frame) == (other.page, other.track, other.frame)


LabelRole = Literal["cipv", "path", "fused", "warning"]
"""The lead, a proposal, what a person said, what was rejected or sent back: its colour in the palette."""


@dataclass(frozen=True)
class LabelInView:
    """A label as a page draws it."""

    track: int
    """Its label."""
    cuboid: Cuboid
    """In the ego frame."""
    text: str
    """Number, class and state."""
    role: LabelRole
    """Decides its colour."""
    facing: bool
    """Whether its front is known."""


@dataclass(frozen=True)
class LabelsInView:
    """What a labeling page draws."""

    labels: tuple[LabelInView, ...]
    """Of the shown frame."""
    alone: bool
    """Without the pipeline's objects."""


@dataclass(frozen=True)
class PageView:
    """What one page wants to see in its own 3D view."""

    selected: int | None = None
    """An object's id; None for no selection."""
    held: HeldCuboid | None = None
    """The cuboid that has handles; None without one."""
    labels: LabelsInView | None = None
    """None where the page does not label."""


NOTHING = PageView()
OnDrag = Callable[[HeldCuboid, bool], None]
"""What is held, as it is now, and whether the hand has let go."""


class SharedViewState:
    """What each page looks at; and how many pages hold a 3D view that they do not show. A page is any object that
    stands for it; the 3D view knows it by the name that it gave itself. Any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._names: dict[object, str] = {}
        self._views: dict[object, PageView] = {}
        self._hiding: set[object] = set()
        self._listener: Callable[[], None] = lambda: None
        self._pages: Callable[[object, int | None], None] = lambda page, number: None
        self._on_drag: OnDrag = lambda held, ended: None

    def on_change(self, listener: Callable[[], None]) -> None:
        """Call ``listener`` after every change; there is one."""
        self._listener = listener

    def on_pick(self, pages: Callable[[object, int | None], None]) -> None:
        """Call ``pages`` with the page, and what was picked in its 3D view; there is one."""
        self._pages = pages

    def on_drag(self, listener: OnDrag) -> None:
        """Call ``listener`` when what is held is dragged; there is one."""
        self._on_drag = listener

    def name(self, page: object, name: str) -> None:
        """How the 3D view of this page calls it."""
        with self._lock:
            self._names[page] = name
        self._listener()

    def view_of(self, page: object) -> PageView:
        """What a page wants to see."""
        with self._lock:
            return self._views.get(page, NOTHING)

    def view_of_name(self, name: str) -> PageView:
        """What the page of this name wants to see; nothing where there is none."""
        with self._lock:
            return self._views.get(self._page(name), NOTHING)

    @property
    def hiding(self) -> int:
        """Pages that hold a 3D view and do not show it."""
        with self._lock:
            return len(self._hiding)

    def select(self, page: object, number: int | None) -> None:
        """Mark an object in this page's 3D view; None: no object."""
        self._change(page, selected=number)

    def hold(self, held: HeldCuboid) -> None:
        """A cuboid that a page holds with the mouse, so that all views of that page show it."""
        self._change(held.page, held=held)

    def let_go(self, page: object) -> None:
        """This page holds nothing any more."""
        self._change(page, held=None)

    def label(self, page: object, labels: LabelsInView | None) -> None:
        """What this page draws of its labels."""
        self._change(page, labels=labels)

    def hide(self, page: object, hides: bool) -> None:
        """Whether this page hides its 3D view."""
        with self._lock:
            (self._hiding.add if hides else self._hiding.discard)(page)
        self._listener()

    def leave(self, page: object) -> None:
        """The page is gone."""
        with self._lock:
            self._names.pop(page, None)
            self._views.pop(page, None)
            self._hiding.discard(page)
        self._listener()

    def pick(self, name: str, number: int | None) -> None:
        """Somebody has clicked on this object in the 3D view of the page of this name, or beside all."""
        with self._lock:
            page = self._page(name)
        if page is not None:
            self.select(page, number)
            self._pages(page, number)

    def drag(self, held: HeldCuboid, ended: bool) -> None:
        """A hand has this label and has brought it there, whatever else is held by now. Any thread."""
        with self._lock:
            view = self._views.get(held.page, NOTHING)
            if held.is_of(view.held):
                self._views[held.page] = replace(view, held=held)
        self._on_drag(held, ended)

    def _page(self, name: str) -> object | None:
        return next((page for page, known in self._names.items() if known == name), None)

    def _change(self, page: object, **what: object) -> None:
        with self._lock:
            before = self._views.get(page, NOTHING)
            after = self._views[page] = replace(before, **what)  # type: ignore[arg-type]
        if after != before:
            self._listener()
