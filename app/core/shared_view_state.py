"""View state shared between pages and the views that the server draws: each page's selection, its labels, the cuboid
that it edits and the frame of its own playhead, and what was picked in those views, with the page that it was picked
for."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

from pipeline.common.geometry import Cuboid
from pipeline.types import Frame, Result


@dataclass(frozen=True)
class HeldCuboid:
    """A labelled cuboid that can be dragged in the 3D view."""

    page: object
    """The page that owns it."""
    track: int
    """Its track id."""
    frame: int
    """The frame in which the page shows it."""
    cuboid: Cuboid
    """In the ego frame, as on the page."""

    def is_of(self, other: HeldCuboid | None) -> bool:
        """Whether both are the same label in the same frame on the same page, at any position."""
        return other is not None and (self.page, self.track, self.frame) == (other.page, other.track, other.frame)


LabelRole = Literal["cipv", "path", "fused", "warning"]
"""The lead, a proposal, a label by a person, a rejected or returned label: selects its colour in the palette."""


@dataclass(frozen=True)
class LabelInView:
    """A label as drawn by a page."""

    track: int
    """Its track id."""
    cuboid: Cuboid
    """In the ego frame."""
    text: str
    """Id, class and state."""
    role: LabelRole
    """Selects its colour."""
    facing: bool
    """Whether its front is known."""


@dataclass(frozen=True)
class LabelsInView:
    """The labels drawn by a labeling page."""

    labels: tuple[LabelInView, ...]
    """The labels of the shown frame."""
    alone: bool
    """Whether the pipeline's objects are hidden."""


@dataclass(frozen=True, eq=False)
class FrameInView:
    """A frame with its result, as a view draws it."""

    frame: Frame
    """Points, image and calibration; ego frame as in all stages."""
    result: Result
    """What the pipeline found in it."""


@dataclass(frozen=True)
class PageView:
    """What one page shows in its own 3D view."""

    selected: int | None = None
    """An object's id; None for no selection."""
    held: HeldCuboid | None = None
    """The cuboid with drag handles; None without one."""
    labels: LabelsInView | None = None
    """None if the page does not label."""
    frame: FrameInView | None = None
    """The frame of a page with its own playhead; None: the page shows the shared frame."""


NOTHING = PageView()
OnDrag = Callable[[HeldCuboid, bool], None]
"""Called with the dragged cuboid in its current position, and whether the drag has ended."""


class SharedViewState:
    """The view state of each page, and how many pages have a hidden 3D view. A page is identified by any object; its 3D
    view identifies it by the name that the page chose. Any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._names: dict[object, str] = {}
        self._views: dict[object, PageView] = {}
        self._hiding: set[object] = set()
        self._listener: Callable[[], None] = lambda: None
        self._pages: Callable[[object, int | None], None] = lambda page, number: None
        self._on_drag: OnDrag = lambda held, ended: None

    def on_change(self, listener: Callable[[], None]) -> None:
        """Call ``listener`` after every change; only one is supported."""
        self._listener = listener

    def on_pick(self, pages: Callable[[object, int | None], None]) -> None:
        """Call ``pages`` with the page and the object picked in its 3D view; only one callback is supported."""
        self._pages = pages

    def on_drag(self, listener: OnDrag) -> None:
        """Call ``listener`` when the held cuboid is dragged; only one is supported."""
        self._on_drag = listener

    def name(self, page: object, name: str) -> None:
        """Set the name by which the 3D view identifies this page."""
        with self._lock:
            self._names[page] = name
        self._listener()

    def view_of(self, page: object) -> PageView:
        """The view state of a page."""
        with self._lock:
            return self._views.get(page, NOTHING)

    def view_of_name(self, name: str) -> PageView:
        """The view state of the page with this name; empty if there is none."""
        with self._lock:
            return self._views.get(self._page(name), NOTHING)

    @property
    def hiding(self) -> int:
        """Number of pages that have a 3D view but do not show it."""
        with self._lock:
            return len(self._hiding)

    def select(self, page: object, number: int | None) -> None:
        """Highlight an object in this page's 3D view; None: no object."""
        self._change(page, selected=number)

    def hold(self, held: HeldCuboid) -> None:
        """Set the cuboid that a page edits with the mouse, so that all views of that page show it."""
        self._change(held.page, held=held)

    def let_go(self, page: object) -> None:
        """The page no longer holds a cuboid."""
        self._change(page, held=None)

    def label(self, page: object, labels: LabelsInView | None) -> None:
        """Set the labels that this page draws."""
        self._change(page, labels=labels)

    def show(self, page: object, shown: FrameInView | None) -> None:
        """Set the frame of a page with its own playhead; None: it follows the shared one."""
        self._change(page, frame=shown)

    def hide(self, page: object, hides: bool) -> None:
        """Set whether this page hides its 3D view."""
        with self._lock:
            (self._hiding.add if hides else self._hiding.discard)(page)
        self._listener()

    def leave(self, page: object) -> None:
        """Remove a page that has closed."""
        with self._lock:
            self._names.pop(page, None)
            self._views.pop(page, None)
            self._hiding.discard(page)
        self._listener()

    def pick(self, name: str, number: int | None) -> None:
        """An object was clicked in the 3D view of the page with this name; None: a click beside all objects."""
        with self._lock:
            page = self._page(name)
        if page is not None:
            self.select(page, number)
            self._pages(page, number)

    def drag(self, held: HeldCuboid, ended: bool) -> None:
        """This label was dragged to a new position, whatever cuboid is held by now. Any thread."""
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
