"""The tables of a fleet for pages: any thread may ask, and what later batches add is found."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TYPE_CHECKING

from app.fleet.pack_index import Pack, packs_of
from app.fleet.runs import about_run, latest_run, runs_of, summary
from app.fleet.store import Store

if TYPE_CHECKING:
    from app.fleet.find import FleetTables

MOST_S = 20.0
"""Time limit of a query from a page."""
_READERS = 8


class FleetDesk:
    """The folder of a batch, open for queries. One query at a time: each uses all cores.

    Raises:
        BadInput: there are no tables there.
    """

    def __init__(self, address: str) -> None:
        self.store = Store(address)
        latest_run(self.store)
        self._lock = threading.Lock()
        self._about: dict[str, str] = {}
        self._open: tuple[str, list[Pack], FleetTables] | None = None

    def runs(self) -> list[str]:
        """Names of all runs, the last batch's first."""
        latest = latest_run(self.store)
        return [latest, *(name for name in runs_of(self.store) if name != latest)]

    def about(self) -> dict[str, str]:
        """What distinguishes each run, in a line, by name."""
        unread = [name for name in self.runs() if name not in self._about]
        with ThreadPoolExecutor(_READERS) as readers:  # a store takes a moment for each
            said = readers.map(lambda name: summary(about_run(self.store, name)), unread)
            self._about |= dict(zip(unread, said, strict=True))
        return {name: self._about[name] for name in self.runs()}

    @contextmanager
    def tables(self, run: str | None) -> Iterator[FleetTables]:
        """A run's tables, for the block; None: the last batch's. Raises what ``FleetTables`` raises."""
        from app.fleet.find import FleetTables  # DuckDB takes a moment to import

        with self._lock:
            name = run or latest_run(self.store)
            packs = packs_of(self.store, name)
            if self._open is None or self._open[:2] != (name, packs):
                self._open = name, packs, FleetTables(self.store, name, MOST_S)
            yield self._open[2]
