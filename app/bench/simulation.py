"""Compares the closed-loop simulator with real time: with LiDAR and true boxes, and with camera and network."""

from __future__ import annotations

from itertools import cycle
from time import perf_counter, process_time
from typing import Any

import numpy as np

from app.bench.timing import figures
from pipeline.experiments.perception import embedded
from pipeline.simulation import scenario
from pipeline.simulation.closed_loop import Eyes, NetworkEyes, Setup, TruthEyes, drive

_SCENARIO = "straight"


def stages(budget_s: float) -> dict[str, dict[str, Any]]:
    """Time per tick of ``simulate_lidar`` and ``simulate_camera``: sensors, pipeline and vehicle. The peer is real
    time, by wall clock and by CPU time, which other load on the machine hardly changes. budget_s: wall time for both,
    seconds."""
    return {
        "simulate_lidar": _stage(TruthEyes(), budget_s / 2),
        "simulate_camera": _stage(NetworkEyes(embedded()), budget_s / 2),
    }


def _stage(eyes: Eyes, budget_s: float) -> dict[str, Any]:
    scene = scenario.load(_SCENARIO)
    ticks = (tick for each in cycle([scene]) for tick in drive(each, Setup(eyes=eyes)))
    next(ticks)  # first run: builds roads, meshes and kernels
    wall_s: list[float] = []
    cpu_s: list[float] = []
    end = perf_counter() + budget_s
    while not wall_s or perf_counter() < end:
        start, start_cpu = perf_counter(), process_time()
        next(ticks)
        wall_s.append(perf_counter() - start)
        cpu_s.append(process_time() - start_cpu)
    tick_ms, median_ms = 1e3 / scene.rate_hz, float(np.median(wall_s)) * 1e3
    cpu_ms = float(np.mean(cpu_s)) * 1e3  # the CPU clock may be coarser than one tick
    return {
        **figures(wall_s),
        "cpu_ms": round(cpu_ms, 4),
        "peers": {
            "real time": {"median_ms": tick_ms, "ratio": round(tick_ms / median_ms, 2)},
            "real time, by processor time": {"median_ms": tick_ms, "ratio": round(tick_ms / cpu_ms, 2)},
        },
    }
