"""A fixed piece of work that is measured between the stages of a benchmark.

Its processor time tells whether the machine computed at one speed meanwhile. The system's counters do not show it if a
hot processor slows down, if another guest of the host uses the other half of a core, or if a host hides steal time.
"""

from __future__ import annotations

from collections.abc import Mapping
from time import perf_counter, thread_time
from typing import Any

import numpy as np

from app.bench.timing import figures

_NUMBERS = 200_000
_RUNS = 9
"""Runs in a row whose median counts, so that a single interrupt does not."""
_WARM_UP_RUNS = 40
"""About a quarter of a second: a sleeping processor takes that long to reach its speed."""
NOTICEABLE = 0.15
"""Excess of the slowest over the fastest sample."""


class Calibration:
    """``sample`` between the stages, then ``row``."""

    def __init__(self) -> None:
        self._numbers = np.random.default_rng(0).random(_NUMBERS)
        self._wall_s: list[float] = []
        self._cpu_s: list[float] = []
        for _ in range(_WARM_UP_RUNS):
            self._run()
        self.sample()

    def sample(self) -> None:
        """Measure once; takes about 50 ms."""
        spent = np.array([self._run() for _ in range(_RUNS)])
        wall_s, cpu_s = np.median(spent, axis=0)
        self._wall_s.append(float(wall_s))
        self._cpu_s.append(float(cpu_s))

    def row(self) -> dict[str, Any]:
        """Figures as of a stage, with the median, smallest and largest processor time, ``cpu_ms``, ``cpu_min_ms`` and
        ``cpu_max_ms``."""
        least, median, most = (round(float(each) * 1e3, 4) for each in np.percentile(self._cpu_s, [0, 50, 100]))
        return {**figures(self._wall_s), "cpu_ms": median, "cpu_min_ms": least, "cpu_max_ms": most, "peers": {}}

    def _run(self) -> tuple[float, float]:
        """Wall and processor time, seconds."""
        wall_s, cpu_s = perf_counter(), thread_time()
        np.sort(self._numbers)
        return perf_counter() - wall_s, thread_time() - cpu_s


def speed_warning(row: Mapping[str, Any]) -> str | None:
    """A sentence if the machine's speed changed between the samples of a ``Calibration``; None otherwise."""
    least, most = row["cpu_min_ms"], row["cpu_max_ms"]
    if most <= (1.0 + NOTICEABLE) * least:
        return None
    return (
        f"the processor's speed changed: a fixed loop took {least:.2f} to {most:.2f} ms of processor time between the "
        "stages. Compare a stage with its peers, not with another run"
    )
