"""Benchmarks the two parts of a step without networks (what runs beside them, and what is left when their outputs are
there), both next to a busy network, and the whole pipeline as the command line runs it: reading, decoding, the detector
in both views, the lane network, step."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from itertools import cycle
from time import perf_counter, thread_time
from typing import Any

import numpy as np

from app.bench.timing import figures
from pipeline import lidar_branch
from pipeline.common.ahead import ahead
from pipeline.detection import Detectors, detect
from pipeline.params import Params
from pipeline.run import advance
from pipeline.step import State, step
from pipeline.types import Frame
from pipeline.types.source import Source
from pipeline.warm_up import warm_up

_ROUNDS = 3
"""The step alone and the step next to the network take turns, so that any load on the machine slows both."""
_IDLE, _BESIDE = 0.3, 0.45
"""Shares of the time budget. Next to the network, where the step is slower, the same number of samples takes longer."""
_SETTLE_S = 0.2
"""Waiting time after the network starts: for about 0.1 s, its threads share the core of the step. In a player, the
network never stops."""


def stages(
    source: Source, count: int, params: Params, detectors: Detectors, budget_s: float
) -> dict[str, dict[str, Any]]:
    """Figures for ``lidar_branch`` (own motion and LiDAR objects, which the product computes beside the networks) and
    ``step`` (from their outputs to the result); with a vehicle detector, also for ``step_beside_network`` and ``line``
    (the whole pipeline, from the recording to the result).

    The network next to it processes one image after another, with as many threads as in the product. The first
    ``count`` frames are repeated. budget_s: total wall time, seconds.
    """
    warm_up()
    detector = detectors.boxes
    both_views = Detectors(detector, far=detectors.far, far_every=detectors.far_every)
    seen = [detect(source.frame(index), both_views) for index in range(count)]
    idle = _Steps(cycle(seen), params)
    if detector is None:
        idle.go_on(budget_s)
        return {"lidar_branch": idle.branch.row(), "step": idle.rest.row()}
    beside, whole = _Steps(cycle(seen), params), _Whole(_read(source, count), params, detectors)
    for _ in range(_ROUNDS):
        idle.go_on(budget_s * _IDLE / _ROUNDS)
        with _Busy(both_views, seen):
            _Steps(cycle(seen), params).go_on(_SETTLE_S)
            beside.go_on(budget_s * _BESIDE / _ROUNDS - _SETTLE_S)
    whole.go_on(budget_s * (1.0 - _IDLE - _BESIDE))
    alone, row, line = idle.rest.row(), beside.rest.row(), whole.laps.row()
    del line["cpu_ms"]  # networks compute in other threads
    named = {
        "detector": _name(detector),
        "far_view": _name(detectors.far),
        "lanes": _name(detectors.lanes),
        "lanes_every": detectors.lanes_every,
    }
    return {
        "lidar_branch": idle.branch.row(),
        "step": alone,
        "step_beside_network": {**row, "p99_to_idle_median": round(row["p99_ms"] / alone["median_ms"], 2)},
        "line": {**line, "rate_hz": round(1.0 / float(np.mean(whole.laps.times_s)), 1), **named},
    }


def _read(source: Source, count: int) -> Iterator[Frame]:
    """Reads each frame from the recording while the one before it is processed, as ``pipeline.run`` does."""
    return ahead(source.frame, cycle(range(count)))


def _name(network: object) -> str | None:
    """Name of a network; None if none runs."""
    return getattr(network, "name", None)


class _Laps:
    """Times of one part of every frame."""

    def __init__(self) -> None:
        self.times_s: list[float] = []
        self._cpu_s: list[float] = []
        self._start = (0.0, 0.0)

    def __enter__(self) -> None:
        self._start = (perf_counter(), thread_time())

    def __exit__(self, *_: object) -> None:
        start, start_cpu = self._start
        self.times_s.append(perf_counter() - start)
        self._cpu_s.append(thread_time() - start_cpu)

    def row(self) -> dict[str, Any]:
        """With ``cpu_ms``, the median processor time of this thread, which other load hardly changes."""
        return {**figures(self.times_s), "cpu_ms": round(float(np.median(self._cpu_s)) * 1e3, 4), "peers": {}}


class _Steps:
    """Runs through frames held in memory with their detections, and times both parts of each step. branch, rest: the
    times so far."""

    def __init__(self, frames: Iterator[Frame], params: Params) -> None:
        self.branch, self.rest = _Laps(), _Laps()
        self._turn, self._state, self._params = frames, State(), params

    def go_on(self, budget_s: float) -> None:
        """Continue after the previous call's last frame until the time is over, for at least one frame."""
        end = perf_counter() + budget_s
        while not self.rest.times_s or perf_counter() < end:
            frame = next(self._turn)
            with self.branch:
                lidar = lidar_branch.follow(self._state, frame, self._params)
            with self.rest:
                self._state, _ = step(self._state, frame, self._params, lidar)


class _Whole:
    """Runs through the frames of a recording, networks included, and times each from reading it to its result."""

    def __init__(self, frames: Iterator[Frame], params: Params, detectors: Detectors) -> None:
        self.laps = _Laps()
        self._turn, self._state = frames, State()
        self._params, self._detectors = params, detectors

    def go_on(self, budget_s: float) -> None:
        """As for ``_Steps``."""
        end = perf_counter() + budget_s
        while not self.laps.times_s or perf_counter() < end:
            with self.laps:
                self._state = advance(self._state, next(self._turn), self._params, self._detectors).state


class _Busy:
    """Keeps the network busy on its own thread, in both views, like a player that reads ahead."""

    def __init__(self, detectors: Detectors, frames: list[Frame]) -> None:
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._work, args=(detectors, frames), daemon=True)

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def _work(self, detectors: Detectors, frames: list[Frame]) -> None:
        for frame in cycle(frames):
            if self._ended.is_set():
                return
            detect(frame, detectors)
