"""The fast reader of number tables against numpy's own, and against rows that are none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.formats.text_rows import parse_rows


@pytest.mark.parametrize(
    ("text", "rows", "bad"),
    [
        (b"", [], 0),
        (b"\n\n  \n", [], 0),
        (b"1 2\n3 4\n", [[1, 2], [3, 4]], 0),
        (b"1 2\n3 4", [[1, 2], [3, 4]], 0),
        (b"1 2\r\n3\t4\r\n", [[1, 2], [3, 4]], 0),
        (b"X Y\n-1.50 +.25\n", [[-1.5, 0.25]], 1),
        (b"1e3 2.5E-2\n", [[1000.0, 0.025]], 0),
        (b"1 2 3\n4 5\n6", [[4, 5]], 2),
        (b"nan 1\ninf 2\n1 2\n", [[1, 2]], 2),
        (b"1e999 2\n", [], 1),
        (b"1..2 3\n1- 2\n. 1\n- 1\ne5 1\n1e 2\n", [], 6),
        (b"12345678901234567890 1\n", [], 1),
        (b"\xff\x00\x01 2\n1 2\n", [[1, 2]], 1),
    ],
)
def test_rows(text: bytes, rows: list[list[float]], bad: int) -> None:
    parsed, others = parse_rows(text, 2)
    assert parsed.tolist() == rows
    assert others == bad


@given(st.lists(st.tuples(*[st.decimals(-99999, 99999, places=3)] * 3), min_size=1, max_size=30))
def test_decimals_are_read_to_the_last_bit(values: list[tuple[object, ...]]) -> None:
    text = "\n".join(" ".join(str(value) for value in row) for row in values)
    parsed, bad = parse_rows(text.encode(), 3)
    assert bad == 0
    assert parsed.tolist() == [[float(str(value)) for value in row] for row in values]


@given(st.binary(max_size=300), st.integers(1, 6))
def test_anything_can_be_given(data: bytes, columns: int) -> None:
    parsed, bad = parse_rows(data, columns)
    assert parsed.shape[1] == columns
    assert np.all(np.isfinite(parsed))
    assert len(parsed) + bad <= data.count(b"\n") + 1
