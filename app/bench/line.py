"""The whole step without the network, the step beside a busy network, and the whole line with the network."""

from __future__ import annotations

import threading
from itertools import cycle
from time import perf_counter
from typing import Any

import numpy as np

from pipeline.params import Params
from pipeline.run import Detectors, detect
from pipeline.step import State, step, warm_up
from pipeline.types import Frame
from pipeline.vision.detector import Detector


def stages(
    frames: list[Frame], params: Params, detector: Detector | None, budget_s: float
) -> dict[str, dict[str, Any]]:
    """Figures for ``step``, and with a detector for ``step_beside_network`` and ``line`` (decoded picture to result).

    frames: consecutive, with pictures, without boxes. budget_s: wall time for all of it, seconds.
    """
    warm_up()
    seen = [detect(frame, Detectors(detector)) for frame in frames]
    share_s = budget_s / (3 if detector else 1)
    idle = _times(seen, params, share_s)
    figures = {"step": _row(idle)}
    if detector is not None:
        with _Busy(detector, seen):
            beside = _times(seen, params, share_s)
        to_idle = float(np.percentile(beside, 99) / np.median(idle))
        figures["step_beside_network"] = {**_row(beside), "p99_to_idle_median": round(to_idle, 2)}
        whole = _times(frames, params, share_s, detector)
        figures["line"] = {**_row(whole), "rate_hz": round(1.0 / float(np.mean(whole)), 1), "detector": detector.name}
    return figures


def _row(times_s: list[float]) -> dict[str, Any]:
    median, p99 = np.median(times_s) * 1e3, np.percentile(times_s, 99) * 1e3
    return {"median_ms": round(float(median), 4), "p99_ms": round(float(p99), 4), "peers": {}}


def _times(frames: list[Frame], params: Params, budget_s: float, detector: Detector | None = None) -> list[float]:
    """Seconds from a decoded picture and a sweep to the result, going round the frames until the time is over. Without
    a detector: of the step alone."""
    times: list[float] = []
    state, end = State(), perf_counter() + budget_s
    for frame in cycle(frames):
        start = perf_counter()
        if start > end:
            break
        state, _ = step(state, detect(frame, Detectors(detector)), params)
        times.append(perf_counter() - start)
    return times


class _Busy:
    """Keeps the network running in a thread of its own, as the live line does."""

    def __init__(self, detector: Detector, frames: list[Frame]) -> None:
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._work, args=(detector, frames), daemon=True)

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def _work(self, detector: Detector, frames: list[Frame]) -> None:
        for frame in cycle(frames):
            if self._ended.is_set():
                return
            detect(frame, Detectors(detector))
