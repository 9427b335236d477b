"""Computes the figures of a soak of live sensors, from what was shown and what was recorded."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from pipeline.recording.session.frame_record import frame_record_from
from pipeline.recording.session.source import SessionSource
from pipeline.recording.topics import FRAMES, IMAGE, POINTS
from pipeline.replay.faults import Fault
from tests.soak.live import car as live_car
from tests.soak.live.watch import Memory, Shown, Watcher

QUIET_S = 4.0
"""Length of the end of a soak, which has no faults."""


def report(
    seconds: float,
    faults: list[Fault],
    watcher: Watcher,
    memory: Memory,
    cpu_s: float,
    told: dict[str, Any],
    dropped: int,
    state: Any,
) -> dict[str, Any]:
    grown, resident = memory.grown()
    session = [SessionSource(str(file), str(file)) for file in state.files]
    recorded = sum(len(each) for each in session)
    images, sweeps = (
        sum(len(times) for each in session for of, times in each.file.log_times().items() if of.topic == topic)
        for topic in (IMAGE, POINTS)
    )
    taken = sum(_sweeps_taken(each) for each in session)
    for each in session:
        each.file.close()
    stages = {
        name: {
            "p50_ms": round(float(np.percentile([each.stages_ms[name] for each in watcher.shown], 50)), 2),
            "p99_ms": round(float(np.percentile([each.stages_ms[name] for each in watcher.shown], 99)), 2),
        }
        for name in watcher.shown[-1].stages_ms
    }
    recoveries = [
        {"sensor": fault.sensor, "kind": fault.kind, "seconds": _recovery_s(fault, watcher.shown)} for fault in faults
    ]
    return {
        "seconds": seconds,
        "frames": len(watcher.shown),
        "dropped_ticks": dropped,
        "stages": stages,
        "slowest_recovery_s": max(
            (np.inf if each["seconds"] is None else each["seconds"] for each in recoveries), default=0.0
        ),
        "recoveries": recoveries,
        "resident_MB": round(resident / 1e6, 1),
        "grown_MB": round(grown / 1e6, 2),
        "cores_used": round(cpu_s / seconds, 2),
        "recording": {
            "frames": state.frames,
            "images": images,
            "sweeps": sweeps,
            "sweeps_taken": taken,
            "dropped": state.dropped,
            "read_back": recorded,
            "error": state.error,
        },
        "shown_MB": round(watcher.encoded_bytes / 1e6, 1),
        "right_leads": _right_leads([each.lead_m for each in watcher.shown if each.at_s > seconds - QUIET_S + 2.0]),
        "errors": sorted(watcher.errors),
        "car": told,
    }


def _sweeps_taken(session: SessionSource) -> int:
    """Minimum number of received sweeps: a frame's number also counts skipped ticks before it."""
    ticks = [frame_record_from(stored.data) for stored in session.file.messages((FRAMES,))][
        1:
    ]  # the first sweep was incomplete
    first = int(ticks[0].sweep is not None)
    return first + sum(int(b.name) - int(a.name) for a, b in pairwise(ticks) if b.sweep is not None)


def _right_leads(leads_m: list[float | None]) -> float:
    """Share of the frames at the end without faults whose lead is within a metre of the car ahead."""
    low, high = live_car.LEAD_M
    right = [lead is not None and low - 1.0 < lead < high + 1.0 for lead in leads_m]
    return round(sum(right) / max(1, len(right)), 3)


def _recovery_s(fault: Fault, shown: list[Shown]) -> float | None:
    """Time from the fault's end to the first result with data of its sensor; None if there was none."""
    back = (each.at_s - fault.to_s for each in shown if each.at_s > fault.to_s and each.has[fault.sensor])
    return next((round(seconds, 3) for seconds in back), None)
