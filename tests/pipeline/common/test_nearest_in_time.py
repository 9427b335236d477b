"""Finding things by their time."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.common.nearest_in_time import Timeline, nearest

TIMES = st.lists(st.integers(-1000, 1000), max_size=30)


@given(TIMES, st.integers(-1100, 1100), st.integers(0, 300))
def test_nearest_is_the_nearest(times: list[int], t_ns: int, within_ns: int) -> None:
    ordered = np.array(sorted(times), dtype=np.int64)
    found = nearest(ordered, t_ns, within_ns)
    away = [abs(int(time) - t_ns) for time in ordered]
    if not away or min(away) > within_ns:
        assert found is None
    else:
        assert found is not None
        assert away[found] == min(away)


@given(TIMES, st.integers(-1100, 1100), st.integers(0, 300))
def test_latest_is_never_later(times: list[int], t_ns: int, within_ns: int) -> None:
    timeline = Timeline(times, list(times))
    assert len(timeline) == len(times)
    before = [time for time in times if 0 <= t_ns - time <= within_ns]
    assert timeline.latest(t_ns, within_ns) == (max(before) if before else None)
