"""The tables of a fleet for pages: any thread may ask, and what later batches add is found."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from app.fleet.pack_index import Pack, packs_of
from app.fleet.runs import latest_run, runs_of
from app.fleet.store import Store

if TYPE_CHECKING:
    from app.fleet.find import FleetTables

MOST_S = 20.0
"""Time limit of a query from a page."""


class FleetDesk:
    """The folder of a batch, open for queries. One query at a time: each uses all cores.

    Raises:
        BadInput: there are no tables there.
    """

    def __init__(self, address: str) -> None:
        self.store = Store(address)
        latest_run(self.store)
        self._lock = threading.Lock()
        self._open: tuple[str, list[Pack], FleetTables] | None = None

    def runs(self) -> list[str]:
        """Names of all runs, the last batch's first."""
        latest = latest_run(self.store)
        return [latest, *(name for name in runs_of(self.store) if name != latest)]

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
