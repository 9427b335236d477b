"""Events about the sensors: disagreement between camera and LiDAR, missing data, jumps in time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from app.drive.events.event import Event, EventFinder, RunRows
from pipeline.types import F64

DISAGREEMENT_SIGMAS = 3.0
DISAGREEMENT_FRAMES = 2
TIME_GAP_PERIODS = 2.5
"""A step between timestamps longer than this many usual periods is a gap in the recording."""


def disagreements(run: RunRows) -> Iterator[Event]:
    """Where the distances of camera and LiDAR for one object in the path start to disagree."""
    lasting: dict[int, int] = {}
    for index, records in enumerate(run.objects):
        sigmas: F64 = np.nan_to_num(np.asarray(records["vl_gap_sigmas"], np.float64))
        apart = records[records["in_path"] & (sigmas > DISAGREEMENT_SIGMAS)]
        now = {int(record["id"]): record for record in apart}
        lasting = {number: lasting.get(number, 0) + 1 for number in now}
        for number, frames in lasting.items():
            if frames == DISAGREEMENT_FRAMES:
                gap_m = float(now[number]["vl_gap_m"])
                way = "farther" if gap_m > 0 else "nearer"
                off = float(now[number]["vl_gap_sigmas"])
                text = f"camera sees #{number} {abs(gap_m):.1f} m {way} than LiDAR ({off:.1f} σ)"
                yield Event("vl_disagreement", index, text, (number,), "notice")


def sensor_gaps(run: RunRows) -> Iterator[Event]:
    """Where a sensor of the recording stops delivering data, and where time jumps."""
    absent = [set(row.gaps.split(",")) - {""} for row in run.rows]
    never = set.intersection(*absent) if absent else set()
    for index, now in enumerate(absent):
        begun = (now - never) - (absent[index - 1] if index else set())
        for sensor in sorted(begun):
            lasts = next((at for at in range(index, len(absent)) if sensor not in absent[at]), len(absent)) - index
            text = f"no {sensor} data for {lasts} frame{'s' if lasts > 1 else ''}"
            yield Event("sensor_gap", index, text, (), "warning")
    yield from _time_gaps([row.t_ns for row in run.rows])


def _time_gaps(t_ns: Sequence[int]) -> Iterator[Event]:
    steps: F64 = np.diff(np.asarray(t_ns, dtype=np.int64)).astype(np.float64) / 1e9
    if not len(steps):
        return
    usual = float(np.median(steps))
    for at in np.flatnonzero((steps > TIME_GAP_PERIODS * usual) | (steps <= 0)):
        step = float(steps[at])
        text = f"gap of {step:.1f} s in the recording" if step > 0 else f"time jumps back by {-step:.1f} s"
        yield Event("sensor_gap", int(at) + 1, text, (), "notice")


DISAGREEMENT_FINDER = EventFinder(("vl_disagreement",), disagreements)
GAP_FINDER = EventFinder(("sensor_gap",), sensor_gaps)
