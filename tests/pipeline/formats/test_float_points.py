"""Sweeps as bare float32 numbers."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.formats.float_points import parse_points
from pipeline.types.source import SourceError

GOOD = [[10.0, -2.0, 0.5, 7.0, 3.0], [20.0, 0.0, -1.0, 255.0, 31.0]]


def data(*rows: list[float]) -> bytes:
    return np.array(rows, dtype="<f4").tobytes()


@pytest.mark.parametrize(
    ("extra", "notes"),
    [
        ([], []),
        ([[0.0, 0.0, 0.0, 5.0, 1.0]], []),
        ([[np.nan, 0.0, 0.0, 5.0, 1.0]], ["a: 1 unreadable points skipped"]),
        ([[2000.0, 0.0, 0.0, 5.0, 1.0]], ["a: 1 unreadable points skipped"]),
        ([[1.0, 0.0, 0.0, 256.0, 1.0], [1.0, 0.0, 0.0, -1.0, 1.0]], ["a: 2 unreadable points skipped"]),
    ],
    ids=["whole", "no return", "not a number", "beyond a kilometre", "impossible intensities"],
)
def test_what_is_no_point_is_left_out(extra: list[list[float]], notes: list[str]) -> None:
    said: list[str] = []
    assert parse_points(data(*GOOD, *extra), "a", 5, 255.0, said).tolist() == GOOD
    assert said == notes


def test_a_cut_point_is_said_and_nothing_is_refused() -> None:
    said: list[str] = []
    assert len(parse_points(data(*GOOD)[:-3], "a", 5, 255.0, said)) == 1
    assert said == ["a: truncated in the middle of a point"]
    with pytest.raises(SourceError, match="a: no LiDAR points"):
        parse_points(b"\0" * 40, "a", 5, 255.0, said)
