"""What happened on a drive, found in its rows and objects: pure functions, one kind of event each.

An event says in a sentence what changed at which frame. Numbers of objects are those of the run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from app.drive.frame_rows import Objects, Row
from app.drive.marks import Mark as Marked
from pipeline.params import Params
from pipeline.types import F64, I64
from pipeline.types.source import Mark

Kind = Literal[
    "first_acquisition",
    "cipv_switch",
    "cipv_lost",
    "cut_in",
    "cut_out",
    "ttc_minimum",
    "warning",
    "brake",
    "vl_disagreement",
    "sensor_gap",
    "mark",
]
Severity = Literal["info", "notice", "warning", "alarm"]

LONGEST_LOOK_BACK = 30
"""Frames before a change in which an object's place in or out of the path is looked for."""
BESIDE_FRAMES = 3
"""An object must have been seen beside the path in this many frames to have cut in from there."""
APPROACH_TTC_S = 8.0
"""A time to collision above this is no approach."""
APPROACH_GAP_FRAMES = 5
"""Frames without a TTC that do not end an approach."""
DISAGREEMENT_SIGMAS = 3.0
DISAGREEMENT_FRAMES = 2
HARD_BRAKE = 0.3
"""Share of the brake pedal from which ACC's braking is told."""
TIME_GAP_PERIODS = 2.5
"""A step between stamps longer than this many usual ones is a gap in the recording."""


@dataclass(frozen=True)
class Event:
    """ids: the objects it is about, the one that matters first. mark: a person's mark, by its number; null for one that
    is part of the recording, and cannot be taken away."""

    kind: Kind
    index: int
    text: str
    ids: tuple[int, ...] = ()
    severity: Severity = "info"
    mark: int | None = None

    def to_json(self, t_s: float) -> dict[str, Any]:
        return {
            "kind": self.kind,
            "index": self.index,
            "t_s": t_s,
            "text": self.text,
            "ids": list(self.ids),
            "severity": self.severity,
            "mark": self.mark,
        }


class Drive(NamedTuple):
    """Frames 0 … N−1 of one run, and its parameters."""

    rows: Sequence[Row]
    objects: Sequence[Objects]
    params: Params

    def starts_anew(self, index: int) -> bool:
        """Whether every tracker started anew at a frame, as after a gap in the recording."""
        step_s = (self.rows[index].t_ns - self.rows[index - 1].t_ns) / 1e9 if index else 0.0
        return not 0.0 < step_s <= self.params.time.reset_gap_s


def find_events(rows: Sequence[Row], objects: Sequence[Objects], params: Params) -> list[Event]:
    """Every event of one run, by frame."""
    drive = Drive(rows, objects[: len(rows)], params)
    found = [event for finder in _FINDERS for event in finder(drive)]
    return sorted(found, key=lambda event: (event.index, event.kind, event.ids))


def recorded_marks(rows: Sequence[Row], marks: Sequence[Mark]) -> list[Event]:
    """Marks made while it was recorded, at the frames they were made at; those of frames not run yet are left out."""
    index_of = {row.t_ns: index for index, row in enumerate(rows)}
    return [Event("mark", index_of[mark.t_ns], mark.text) for mark in marks if mark.t_ns in index_of]


def marks_by_time(marks: Sequence[Marked], t_ns: I64, within_ns: int) -> list[Event]:
    """Marks made of live sensors, at the frames stamped nearest and no farther than so much. Those of other times, and
    those that are part of a session, are left out. t_ns: (N,) the frames' stamps."""
    found = []
    for mark in marks:
        if mark.t_ns is None or mark.in_session or not len(t_ns):
            continue
        index = int(np.argmin(np.abs(t_ns - mark.t_ns)))
        if abs(int(t_ns[index]) - mark.t_ns) <= within_ns:
            found.append(Event("mark", index, mark.text or "marked"))
    return found


# ---------------------------------------------------------------- who leads


def lead_changes(drive: Drive) -> Iterator[Event]:
    """Each frame whose CIPV is another than the frame's before, as the most that is known of it."""
    seen: set[int] = set()
    last: int | None = None
    for index, row in enumerate(drive.rows):
        now = row.cipv_id
        last = None if drive.starts_anew(index) else last
        if now != last:
            yield _lead_change(drive, index, last, now, seen)
        if now is not None:
            seen.add(now)
        last = now


def _lead_change(drive: Drive, index: int, last: int | None, now: int | None, seen: set[int]) -> Event:
    row = drive.rows[index]
    left = last is not None and _left_the_path(drive, index, last)
    if now is None:
        assert last is not None
        if left:
            return Event("cut_out", index, f"#{last} left the path; nothing ahead", (last,), "notice")
        return Event("cipv_lost", index, f"#{last} is not the CIPV any more; nothing ahead", (last,), "notice")
    at = f"{row.distance_m:.1f} m" if row.distance_m is not None else "unknown distance"
    nearer = _nearer_than_before(drive, index)
    if nearer and _was_beside(drive, index, now):
        before = f" before #{last}" if last is not None else ""
        return Event("cut_in", index, f"#{now} cut in{before} at {at}", _ids(now, last), "warning")
    if last is not None and left:
        return Event("cut_out", index, f"#{last} left the path; #{now} at {at} leads now", (last, now), "notice")
    if last is not None:
        return Event("cipv_switch", index, f"CIPV #{last} → #{now} at {at}", (now, last), "notice")
    if now in seen:
        return Event("cipv_switch", index, f"#{now} is the CIPV again at {at}", (now,), "info")
    seen_by = {"V": "the camera", "L": "the LiDAR", "VL": "both sensors"}.get(row.source or "", "nobody")
    return Event("first_acquisition", index, f"#{now} acquired at {at} by {seen_by}", (now,), "info")


def _left_the_path(drive: Drive, index: int, object_id: int) -> bool:
    """Whether an object is still there, and beside the path now."""
    record = _record(drive.objects[index], object_id)
    return record is not None and not record["in_path"] and not np.isnan(record["path_offset_m"])


def _was_beside(drive: Drive, index: int, object_id: int) -> bool:
    """Whether an object was seen beside the path shortly before."""
    beside = 0
    for before in range(index - 1, max(-1, index - 1 - LONGEST_LOOK_BACK), -1):
        record = _record(drive.objects[before], object_id)
        if record is not None and not record["in_path"] and not record["carried"]:
            beside += not np.isnan(record["path_offset_m"])
    return beside >= BESIDE_FRAMES


def _nearer_than_before(drive: Drive, index: int) -> bool:
    """Whether the CIPV is nearer than the last one was; so when there was none."""
    before, now = drive.rows[index - 1].distance_m if index else None, drive.rows[index].distance_m
    return before is None or (now is not None and now < before)


def _record(records: Objects, object_id: int) -> np.void | None:
    match = np.flatnonzero(records["id"] == object_id)
    return records[match[0]] if len(match) else None


# ---------------------------------------------------------------- danger


def ttc_minima(drive: Drive) -> Iterator[Event]:
    """The shortest time to collision of each approach: frames of one CIPV whose TTC is short, with short holes."""
    approach: list[int] = []
    for index, row in enumerate(drive.rows):
        close = row.ttc_s is not None and row.ttc_s < APPROACH_TTC_S
        if approach:
            last = drive.rows[approach[-1]]
            another = row.cipv_id not in (None, last.cipv_id)
            if another or index - approach[-1] > APPROACH_GAP_FRAMES or drive.starts_anew(index):
                yield _ttc_minimum(drive, approach)
                approach = []
        if close:
            approach.append(index)
    if approach:
        yield _ttc_minimum(drive, approach)


def _ttc_minimum(drive: Drive, approach: Sequence[int]) -> Event:
    index = min(approach, key=lambda at: (drive.rows[at].ttc_s or 0.0, at))
    row, aeb = drive.rows[index], drive.params.aeb
    ttc_s, lead = row.ttc_s or 0.0, row.cipv_id or 0
    severity: Severity = "alarm" if ttc_s < aeb.partial_ttc_s else "warning" if ttc_s < aeb.warn_ttc_s else "info"
    return Event("ttc_minimum", index, f"TTC {ttc_s:.1f} s to #{lead} at {row.distance_m:.1f} m", (lead,), severity)


def braking(drive: Drive) -> Iterator[Event]:
    """Where a warning or an emergency braking begins or grows, and where ACC begins to brake hard."""
    stages = {"warn": 1, "partial_brake": 2, "full_brake": 3}
    texts = {1: "collision warning", 2: "partial braking", 3: "full braking"}
    last_stage, last_hard = 0, False
    for index, row in enumerate(drive.rows):
        stage = stages.get(row.acc_state or "", 0)
        hard = (row.brake or 0.0) >= HARD_BRAKE
        ids = _ids(row.cipv_id)
        if stage > last_stage:
            kind: Kind = "warning" if stage == 1 else "brake"
            yield Event(kind, index, f"{texts[stage]}{_where(row)}", ids, "warning" if stage == 1 else "alarm")
        elif hard and not last_hard and not stage:
            yield Event(
                "brake", index, f"ACC brakes with {-(row.accel_mps2 or 0.0):.1f} m/s²{_where(row)}", ids, "notice"
            )
        last_stage, last_hard = stage, hard


def _where(row: Row) -> str:
    if row.cipv_id is None or row.distance_m is None:
        return ""
    return f", #{row.cipv_id} at {row.distance_m:.1f} m"


# ---------------------------------------------------------------- sensors


def disagreements(drive: Drive) -> Iterator[Event]:
    """Where camera and LiDAR begin to give one object in the path two distances."""
    lasting: dict[int, int] = {}
    for index, records in enumerate(drive.objects):
        sigmas: F64 = np.nan_to_num(np.asarray(records["vl_gap_sigmas"], np.float64))
        apart = records[records["in_path"] & (sigmas > DISAGREEMENT_SIGMAS)]
        now = {int(record["id"]): record for record in apart}
        lasting = {number: lasting.get(number, 0) + 1 for number in now}
        for number, frames in lasting.items():
            if frames == DISAGREEMENT_FRAMES:
                gap_m = float(now[number]["vl_gap_m"])
                way = "farther" if gap_m > 0 else "nearer"
                off = float(now[number]["vl_gap_sigmas"])
                text = f"camera has #{number} {abs(gap_m):.1f} m {way} than the LiDAR ({off:.1f} σ)"
                yield Event("vl_disagreement", index, text, (number,), "notice")


def sensor_gaps(drive: Drive) -> Iterator[Event]:
    """Where a sensor that the recording has begins to give nothing, and where time jumps."""
    absent = [set(row.gaps.split(",")) - {""} for row in drive.rows]
    never = set.intersection(*absent) if absent else set()
    for index, now in enumerate(absent):
        begun = (now - never) - (absent[index - 1] if index else set())
        for sensor in sorted(begun):
            lasts = next((at for at in range(index, len(absent)) if sensor not in absent[at]), len(absent)) - index
            text = f"no {sensor} data for {lasts} frame{'s' if lasts > 1 else ''}"
            yield Event("sensor_gap", index, text, (), "warning")
    yield from _time_gaps([row.t_ns for row in drive.rows])


def _time_gaps(t_ns: Sequence[int]) -> Iterator[Event]:
    steps: F64 = np.diff(np.asarray(t_ns, dtype=np.int64)).astype(np.float64) / 1e9
    if not len(steps):
        return
    usual = float(np.median(steps))
    for at in np.flatnonzero((steps > TIME_GAP_PERIODS * usual) | (steps <= 0)):
        step = float(steps[at])
        text = f"the recording jumps by {step:.1f} s" if step > 0 else f"time goes back by {-step:.1f} s"
        yield Event("sensor_gap", int(at) + 1, text, (), "info")


_FINDERS: tuple[Callable[[Drive], Iterable[Event]], ...] = (
    lead_changes,
    ttc_minima,
    braking,
    disagreements,
    sensor_gaps,
)


def _ids(*numbers: int | None) -> tuple[int, ...]:
    return tuple(number for number in numbers if number is not None)
