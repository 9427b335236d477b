"""Times contestants fairly: in one process and in turns, so that other load on the machine slows all of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from time import perf_counter
from typing import Any

import numpy as np

_MAX_REPEATS = 20
_MIN_ROUNDS = 3


def interleaved(contestants: Mapping[str, Callable[[], object]], budget_s: float) -> dict[str, list[float]]:
    """Seconds of every run of every contestant, by name. The first run of each is not counted (compilation, caches).
    Then they take turns in rounds until ``budget_s`` of wall time is over, for three rounds at least. In its turn, a
    fast contestant runs as often as fits into one run of the slowest, 20 times at most, so that a slow peer does not
    leave the fast one with only a few samples.
    """
    end = perf_counter() + budget_s
    first = {name: min(_time(run), _time(run)) for name, run in contestants.items()}
    slowest = max(first.values(), default=0.0)
    repeats = {name: max(1, min(_MAX_REPEATS, int(slowest / max(spent, 1e-9)))) for name, spent in first.items()}
    times: dict[str, list[float]] = {name: [] for name in contestants}
    rounds = 0
    while contestants and (rounds < _MIN_ROUNDS or perf_counter() < end):
        for name, run in contestants.items():
            times[name] += [_time(run) for _ in range(repeats[name])]
        rounds += 1
    return times


def figures(spent_s: Sequence[float]) -> dict[str, Any]:
    """``median_ms``, ``p99_ms`` and the number of samples."""
    median, p99 = (np.percentile(spent_s, [50, 99]) * 1e3).tolist()
    return {"median_ms": median, "p99_ms": p99, "samples": len(spent_s)}


def _time(run: Callable[[], object]) -> float:
    start = perf_counter()
    run()
    return perf_counter() - start
