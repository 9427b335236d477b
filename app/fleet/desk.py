"""The tables of a fleet for pages: any thread may ask, and what later batches add is found."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any
from weakref import finalize

from app.fleet.query_process import MOST_S, FleetReply, QueryKind, QueryProcess
from app.fleet.query_result import QueryResult, QueryTable
from app.fleet.runs import about_run, latest_run, runs_of, summary
from app.fleet.store import Store
from pipeline.common.files.user_files import Overloaded

_READERS = 8
_AT_ONCE = 12
"""Queries that may wait for their turn, of the forty threads that answer all requests; a page asks three."""


class FleetDesk:
    """The folder of a batch, open for queries. One query at a time: each uses all cores.

    Raises:
        BadInput: there are no tables there.
    """

    def __init__(self, address: str) -> None:
        self.store = Store(address)
        latest_run(self.store)
        self.most_s = MOST_S
        """Time limit of a query."""
        self._lock = threading.Lock()
        self._waiting = threading.BoundedSemaphore(_AT_ONCE)
        self._about: dict[str, str] = {}
        self._process = QueryProcess(address)
        finalize(self, self._process.close)

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

    def find(
        self, run: str | None, where: str, of: QueryTable, limit: int, order: str = "", *, descending: bool = False
    ) -> tuple[str, QueryResult]:
        """A run's name, and the rows that meet a condition; None: the last batch's. Raises what ``FleetTables.find``
        and ``QueryProcess.ask`` raise."""
        asked = {"where": where, "of": of, "limit": limit, "order": order, "descending": descending}
        reply = self._ask(run, "find", asked)
        found = reply.value
        return reply.run, QueryResult(tuple(found["columns"]), tuple(map(tuple, found["rows"])), found["total"])

    def histogram(
        self, run: str | None, where: str, of: QueryTable, column: str, bins: int
    ) -> tuple[list[float], list[int]]:
        """(bins + 1) edges, and between them the counts of a column's values. Raises what ``find`` raises."""
        edges, counts = self._ask(run, "histogram", {"where": where, "of": of, "column": column, "bins": bins}).value
        return edges, counts

    def counts(self, run: str | None, where: str, of: QueryTable, column: str) -> list[tuple[str | None, int]]:
        """(value, rows with it) of a column, the most frequent first. Raises what ``find`` raises."""
        value = self._ask(run, "counts", {"where": where, "of": of, "column": column}).value
        return [(name, count) for name, count in value]

    def close(self) -> None:
        """End a query in progress, and the process that runs them."""
        self._process.close()

    def _ask(self, run: str | None, kind: QueryKind, arguments: dict[str, Any]) -> FleetReply:
        if not self._waiting.acquire(blocking=False):
            raise Overloaded("too many searches at once; try again")
        try:
            with self._lock:
                return self._process.ask(run, kind, arguments, self.most_s)
        finally:
            self._waiting.release()
