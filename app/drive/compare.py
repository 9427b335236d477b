"""Compares two runs of one drive: in which frames they differ, and how their scores differ.

Object numbers cannot be compared across runs; two leads are the same if they are in the same place.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from app.drive.frame_rows import Row
from pipeline.common.clips import begins_clip
from pipeline.evaluation.lead_verdict import score
from pipeline.params import TimeParams
from pipeline.types import are_several

SAME_PLACE_M = 0.5
"""Distances or path offsets that differ by less than this count as equal."""


@dataclass(frozen=True)
class Metric:
    """One metric of both runs."""

    name: str
    """Display name."""
    unit: str
    """Empty for counts."""
    base: float | None
    """Value for the base run; None if it is undefined."""
    run: float | None
    """Value for the run itself; None if it is undefined."""
    better: Literal["higher", "lower"] | None = None
    """Which direction is better; None if neither is."""


@dataclass(frozen=True)
class Comparison:
    """Two runs of one drive side by side."""

    frames: int
    """Number of frames that both runs have processed."""
    differing: tuple[tuple[int, int], ...]
    """First and last frame of each range in which they differ."""
    sentences: dict[int, str]
    """The difference at the first frame of each range, by that frame."""
    metrics: tuple[Metric, ...]
    """Metrics that need truth are included only if there is truth."""
    judged: int
    """Number of frames with truth."""

    @property
    def frames_differing(self) -> int:
        return sum(last - first + 1 for first, last in self.differing)


def compare(base: Sequence[Row], run: Sequence[Row]) -> Comparison:
    """Compare the frames that both runs have."""
    frames = min(len(base), len(run))
    base, run = base[:frames], run[:frames]
    differs = [index for index in range(frames) if not same_lead(base[index], run[index])]
    ranges = tuple(_ranges(differs))
    sentences = {first: f"compared run: {_lead(base[first])}; shown run: {_lead(run[first])}" for first, _ in ranges}
    judged = sum(row.judged is not None for row in base)
    metrics = (*(_against_truth(base, run) if judged else ()), *_by_themselves(base, run))
    return Comparison(frames, ranges, sentences, metrics, judged)


def same_lead(a: Row, b: Row) -> bool:
    """Whether two runs have the same lead in one frame, or both have none."""
    if a.cipv_id is None or b.cipv_id is None:
        return a.cipv_id is b.cipv_id
    return _near(a.distance_m, b.distance_m) and _near(a.path_offset_m, b.path_offset_m)


def _near(a: float | None, b: float | None) -> bool:
    if a is None or b is None:
        return a is b
    return abs(a - b) <= SAME_PLACE_M


def _ranges(indices: Sequence[int]) -> list[tuple[int, int]]:
    ranges: list[tuple[int, int]] = []
    for index in indices:
        if ranges and index == ranges[-1][1] + 1:
            ranges[-1] = (ranges[-1][0], index)
        else:
            ranges.append((index, index))
    return ranges


def _lead(row: Row) -> str:
    if row.cipv_id is None:
        return "none"
    return f"#{row.cipv_id}" + (f" at {row.distance_m:.1f} m" if row.distance_m is not None else "")


def _against_truth(base: Sequence[Row], run: Sequence[Row]) -> tuple[Metric, ...]:
    """The metrics of ``pipeline.evaluation.lead_verdict`` over the frames with truth."""
    a, b = (score(row.judged for row in rows if row.judged is not None) for rows in (base, run))
    return (
        Metric("CIPV correct", "frames", a.correct, b.correct, "higher"),
        Metric("lead missed", "frames", a.missed, b.missed, "lower"),
        Metric("CIPV without a lead", "frames", a.false, b.false, "lower"),
        Metric("CIPV not at the lead's position", "frames", a.wrong, b.wrong, "lower"),
        Metric("mean distance error", "m", a.mean_error_m, b.mean_error_m, "lower"),
        Metric("largest distance error", "m", a.max_error_m, b.max_error_m, "lower"),
    )


def _by_themselves(base: Sequence[Row], run: Sequence[Row]) -> tuple[Metric, ...]:
    """Metrics that need no truth; higher values are not necessarily better."""
    return (
        Metric("frames with a CIPV", "frames", _count(base, _leads), _count(run, _leads)),
        Metric("CIPV changes", "", _changes(base), _changes(run)),
        Metric("CIPV carried", "frames", _count(base, _is_carried), _count(run, _is_carried)),
        Metric("CIPV seen by both", "frames", _count(base, _is_seen_by_both), _count(run, _is_seen_by_both)),
        Metric("shortest TTC", "s", _least(r.ttc_s for r in base), _least(r.ttc_s for r in run)),
        Metric("hardest braking", "m/s²", _hardest(base), _hardest(run)),
    )


def _leads(row: Row) -> bool:
    return row.cipv_id is not None


def _is_carried(row: Row) -> bool:
    return bool(row.carried)


def _is_seen_by_both(row: Row) -> bool:
    return are_several(row.source or "")


def _count(rows: Sequence[Row], holds: Callable[[Row], bool]) -> int:
    return sum(map(holds, rows))


def _changes(rows: Sequence[Row]) -> int:
    longest_gap_s = TimeParams().reset_gap_s
    joined = ((a, b) for a, b in pairwise(rows) if not begins_clip(a.t_ns, b.t_ns, longest_gap_s))
    return sum(a.cipv_id != b.cipv_id for a, b in joined)


def _least(values: Iterable[float | None]) -> float | None:
    return min((value for value in values if value is not None), default=None)


def _hardest(rows: Sequence[Row]) -> float | None:
    accel = _least(row.accel_mps2 for row in rows)
    return None if accel is None else max(0.0, -accel)
