"""The runs of one recording: the current one, the baseline for comparison, and the saved ones."""

from __future__ import annotations

import threading
from collections.abc import Callable

from app.drive.full_run import DriveRun
from pipeline.common.errors import BadInput
from pipeline.params import Params

MOST_UNKEPT, MOST_KEPT = 4, 12
"""Runs in memory that nobody has saved, and saved ones."""
LONGEST_NAME = 80


class NoSuchRun(BadInput):
    """A run that does not exist, or was deleted."""


class RunRefused(BadInput):
    """An operation that a run does not allow; the text says why."""


class RunRegistry:
    """The runs of one recording. Unsaved runs are discarded when newer ones are made. Any thread."""

    def __init__(self, new_run: Callable[[int, Params, str], DriveRun], next_number: int = 1) -> None:
        self._new_run = new_run
        self._next = next_number
        self._lock = threading.RLock()
        self._runs: list[DriveRun] = []
        self._current: DriveRun | None = None
        self._base: DriveRun | None = None

    @property
    def current(self) -> DriveRun | None:
        """The run with the current parameters."""
        return self._current

    @property
    def base(self) -> DriveRun | None:
        """The base run for comparisons; initially the first one."""
        return self._base

    @property
    def next_number(self) -> int:
        """Number of the next run: each number is used only once, also across recordings."""
        return self._next

    def all(self) -> list[DriveRun]:
        """Every run, oldest first."""
        with self._lock:
            return list(self._runs)

    def get(self, number: int) -> DriveRun:
        """The run with this number; NoSuchRun if there is none."""
        with self._lock:
            found = next((run for run in self._runs if run.number == number), None)
        if found is None:
            raise NoSuchRun(f"run {number} not found")
        return found

    def of(self, params: Params) -> DriveRun | None:
        """The run with these parameters; None if there is none."""
        with self._lock:
            return next((run for run in reversed(self._runs) if run.params == params), None)

    def want(self, params: Params, preset: str) -> bool:
        """Make the run with these parameters the current one; true if it was not already."""
        with self._lock:
            if self._current is not None and self._current.params == params:
                return False
            run = self.of(params)
            if run is None:
                run = self._new_run(self._next, params, preset)
                self._next += 1
                self._runs.append(run)
            if self._current is not None:
                self._current.thin()
            self._current = run
            self._base = self._base or run
            self._let_go()
            return True

    def unfinished(self) -> DriveRun | None:
        """The run to continue next: the current one, then the base, then saved ones."""
        with self._lock:
            wanted = [self._current, self._base, *(run for run in self._runs if run.kept)]
        return next((run for run in wanted if run is not None and not run.is_complete and not run.note), None)

    def keep(self, number: int, name: str) -> DriveRun:
        """Save a run under a name, or rename it. RunRefused if too many are saved."""
        with self._lock:
            run = self.get(number)
            if not run.kept and sum(each.kept for each in self._runs) >= MOST_KEPT:
                raise RunRefused(f"{MOST_KEPT} runs are saved already; delete one first")
            run.kept, run.name = True, " ".join(name.split())[:LONGEST_NAME]
            return run

    def compare_with(self, number: int) -> None:
        """Make a run the base for comparisons."""
        with self._lock:
            self._base = self.get(number)
            self._let_go()

    def delete(self, number: int) -> None:
        """Delete a run; RunRefused for the current run and the base."""
        with self._lock:
            run = self.get(number)
            if run is self._current or run is self._base:
                raise RunRefused("the current run and the one it is compared with cannot be deleted")
            self._runs.remove(run)

    def _let_go(self) -> None:
        loose = [run for run in self._runs if not run.kept and run is not self._current and run is not self._base]
        started = [run for run in loose if run.done]
        spare = {id(run) for run in loose if not run.done}
        spare |= {id(run) for run in started[: max(0, len(started) - MOST_UNKEPT)]}
        self._runs = [run for run in self._runs if id(run) not in spare]
