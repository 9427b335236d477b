"""Events about danger: the shortest time to collision of each approach, warnings and braking."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from app.drive.events.event import Event, EventFinder, RunRows, Severity, ids
from app.drive.frame_rows import Row

APPROACH_TTC_S = 8.0
"""A longer time to collision does not count as an approach."""
APPROACH_GAP_FRAMES = 5
"""Number of frames without a TTC that do not end an approach."""
HARD_BRAKE = 0.3
"""Brake pedal position from which ACC's braking is reported."""


def ttc_minima(run: RunRows) -> Iterator[Event]:
    """The shortest time to collision of each approach: consecutive frames of one CIPV with a short TTC, allowing short
    gaps."""
    approach: list[int] = []
    for index, row in enumerate(run.rows):
        close = row.ttc_s is not None and row.ttc_s < APPROACH_TTC_S
        if approach:
            last = run.rows[approach[-1]]
            another = row.cipv_id not in (None, last.cipv_id)
            if another or index - approach[-1] > APPROACH_GAP_FRAMES or run.starts_anew(index):
                yield _ttc_minimum(run, approach)
                approach = []
        if close:
            approach.append(index)
    if approach:
        yield _ttc_minimum(run, approach)


def _ttc_minimum(run: RunRows, approach: Sequence[int]) -> Event:
    index = min(approach, key=lambda at: (run.rows[at].ttc_s or 0.0, at))
    row, aeb = run.rows[index], run.params.aeb
    ttc_s, lead = row.ttc_s or 0.0, row.cipv_id or 0
    severity: Severity = "alarm" if ttc_s < aeb.partial_ttc_s else "warning" if ttc_s < aeb.warn_ttc_s else "info"
    return Event("ttc_minimum", index, f"TTC {ttc_s:.1f} s to #{lead} at {row.distance_m:.1f} m", (lead,), severity)


def braking(run: RunRows) -> Iterator[Event]:
    """Where a warning or an emergency braking starts or increases, and where ACC starts to brake hard."""
    stages = {"warn": 1, "partial_brake": 2, "full_brake": 3}
    texts = {1: "collision warning", 2: "partial braking", 3: "full braking"}
    last_stage, last_hard = 0, False
    for index, row in enumerate(run.rows):
        stage = stages.get(row.acc_state or "", 0)
        hard = (row.brake or 0.0) >= HARD_BRAKE
        about = ids(row.cipv_id)
        if stage > last_stage:
            kind = "warning" if stage == 1 else "brake"
            yield Event(kind, index, f"{texts[stage]}{_where(row)}", about, "warning" if stage == 1 else "alarm")
        elif hard and not last_hard and not stage:
            yield Event(
                "brake", index, f"ACC brakes at {-(row.accel_mps2 or 0.0):.1f} m/s²{_where(row)}", about, "notice"
            )
        last_stage, last_hard = stage, hard


def _where(row: Row) -> str:
    if row.cipv_id is None or row.distance_m is None:
        return ""
    return f", #{row.cipv_id} at {row.distance_m:.1f} m"


TTC_FINDER = EventFinder(("ttc_minimum",), ttc_minima)
BRAKING_FINDER = EventFinder(("warning", "brake"), braking)
