"""Selects the worst frames, which a person should look at first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pipeline.evaluation.lead_verdict import Verdict
from pipeline.evaluation.scores.drive import DriveScore, FrameScore

_WEIGHT: dict[Verdict, int] = {"none": 0, "correct": 0, "missed": 1, "wrong": 2, "false": 3}
"""A false CIPV is worse than a wrong one, and a wrong one is worse than a missed one."""


@dataclass(frozen=True)
class Bad:
    """One frame. Metres; None if not available."""

    uri: str
    """Of its recording."""
    index: int
    """In the recording."""
    name: str
    """The recording's own name of it."""
    verdict: Verdict
    """On the CIPV."""
    truth_m: float | None
    """Distance of the labelled lead."""
    distance_m: float | None
    """Distance of the CIPV."""
    error_m: float | None
    """Of the distance."""
    before: str = ""
    """The other run's verdict if two runs are compared; else empty."""


def worst(drives: Sequence[DriveScore], most: int) -> list[Bad]:
    """Sorted by verdict, then by the lead's absolute distance error; at most ``most``. Frames without any error are
    left out."""
    every = [bad for drive in drives for frame in drive.frames if (bad := _bad(drive.uri, frame)) is not None]
    every = [bad for bad in every if _weight(bad) > 0 or bad.error_m]
    return sorted(every, key=lambda bad: (-_weight(bad), -abs(bad.error_m or 0.0)))[:most]


def changed(base: Sequence[DriveScore], run: Sequence[DriveScore], most: int) -> list[Bad]:
    """Frames whose verdict differs between two runs: those that became worse first."""
    found: list[tuple[int, Bad]] = []
    for a, b in zip(base, run, strict=True):
        before = {frame.t_ns: frame for frame in a.frames}
        for frame in b.frames:
            old, new = before.get(frame.t_ns), _bad(b.uri, frame)
            if old is None or old.judged is None or new is None or old.judged.verdict == new.verdict:
                continue
            bad = replace(new, before=old.judged.verdict)
            found.append((_WEIGHT[old.judged.verdict] - _weight(bad), bad))
    return [bad for _, bad in sorted(found, key=lambda pair: pair[0])][:most]


def _weight(bad: Bad) -> int:
    return _WEIGHT[bad.verdict]


def _bad(uri: str, frame: FrameScore) -> Bad | None:
    judged = frame.judged
    if judged is None:
        return None
    return Bad(uri, frame.index, frame.name, judged.verdict, judged.truth_m, judged.distance_m, judged.error_m)
