"""Measures the time of each stage of a frame."""

from __future__ import annotations

from time import perf_counter_ns


class Stopwatch:
    """Starts on construction. Each call of ``lap`` attributes the time since the previous call to a stage."""

    def __init__(self) -> None:
        self._start = self._last = perf_counter_ns()
        self._laps: dict[str, float] = {}

    def lap(self, stage: str) -> None:
        """End a stage."""
        now = perf_counter_ns()
        self._laps[stage] = (now - self._last) / 1e6
        self._last = now

    def skip(self) -> None:
        """Attribute the time since the previous lap to no stage; it still counts in ``total``."""
        self._last = perf_counter_ns()

    def timing_ms(self) -> dict[str, float]:
        """Milliseconds by stage, and ``total`` since the start."""
        return {**self._laps, "total": (perf_counter_ns() - self._start) / 1e6}
