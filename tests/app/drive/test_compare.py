"""Two runs side by side."""

from __future__ import annotations

from typing import Any

import pytest

from app.drive.compare import Comparison, compare
from pipeline.evaluation.lead_verdict import Judged
from tests.app.drive.rows import drive, row


def metric(of: Comparison, name: str) -> tuple[float | None, float | None]:
    found = next(each for each in of.metrics if each.name == name)
    return found.base, found.run


@pytest.mark.parametrize(
    ("name", "base", "run", "differing"),
    [
        ("the same", drive(7, 7), drive(7, 7), ()),
        ("another number in the same place", drive(7, 7), drive(3, 3), ()),
        ("one has none", drive(7, 7, 7, 7), drive(7, None, None, 7), ((1, 2),)),
        ("a car farther on", [row(0, 7)], [row(0, 7, distance_m=30.6)], ((0, 0),)),
        ("within half a metre", [row(0, 7)], [row(0, 7, distance_m=30.4)], ()),
        ("beside it", [row(0, 7, path_offset_m=0.0)], [row(0, 7, path_offset_m=2.0)], ((0, 0),)),
        ("two places", drive(7, None, 7, 7), drive(None, None, 7, None), ((0, 0), (3, 3))),
        ("one is not done", drive(7, 7, 7), drive(None), ((0, 0),)),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_where_they_differ(name: str, base: list[Any], run: list[Any], differing: tuple[Any, ...]):
    found = compare(base, run)
    assert found.differing == differing
    assert found.frames_differing == sum(last - first + 1 for first, last in differing)
    assert set(found.sentences) == {first for first, _ in differing}


def test_a_difference_is_said_in_words():
    assert compare(drive(7), drive(None)).sentences == {0: "compared run: #7 at 30.0 m; shown run: none"}


def test_figures_without_truth():
    base = [row(0, 7, ttc_s=4.0, accel_mps2=-2.0), row(1, 8, source="V"), row(2, 8, carried=True), row(3)]
    found = compare(base, drive(7, 7, 7, 7))
    assert found.judged == 0
    assert metric(found, "frames with a CIPV") == (3, 4)
    assert metric(found, "CIPV changes") == (2, 0)
    assert metric(found, "CIPV carried") == (1, 0)
    assert metric(found, "CIPV seen by both") == (2, 4)
    assert metric(found, "shortest TTC") == (4.0, None)
    assert metric(found, "hardest braking") == (2.0, None)
    assert all(each.better is None for each in found.metrics)


def test_figures_against_truth():
    right = Judged("0", "correct", 30.0, 30.5, 0.0)
    missed = Judged("0", "missed", 30.0, None, None)
    found = compare([row(0, 7, judged=right), row(1), row(2)], [row(0, judged=missed), row(1), row(2)])
    assert found.judged == 1
    assert metric(found, "CIPV correct") == (1, 0)
    assert metric(found, "lead missed") == (0, 1)
    assert metric(found, "mean distance error") == (0.5, None)
