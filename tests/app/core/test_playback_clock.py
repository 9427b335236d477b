"""Which frame is due when."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.core.playback_clock import LONGEST_GAP_S, PlaybackClock, timeline_s

TIMELINES = {
    "even steps": ([0, 1, 2], [0.0, 1e-9 * 1, 2e-9]),
    "real stamps are kept": ([0, 100_000_000, 350_000_000], [0.0, 0.1, 0.35]),
    "a gap of minutes takes one period": ([0, 100_000_000, 300_100_000_000], [0.0, 0.1, 0.2]),
    "a step back takes one period": ([500_000_000, 100_000_000, 200_000_000], [0.0, 0.1, 0.2]),
    "one frame": ([7], [0.0]),
}


@pytest.mark.parametrize("name", TIMELINES)
def test_timeline(name: str):
    stamps, expected = TIMELINES[name]
    np.testing.assert_allclose(timeline_s(stamps, rate_hz=10.0), expected)


@given(st.lists(st.integers(0, 10**15), min_size=1, max_size=40))
def test_a_timeline_never_goes_back_and_never_makes_one_wait_long(stamps: list[int]):
    steps = np.diff(timeline_s(stamps, rate_hz=10.0))
    assert np.all(steps > 0)
    assert np.all(steps <= LONGEST_GAP_S + 1e-9)


@pytest.mark.parametrize(
    ("speed", "elapsed_s", "due"),
    [(1.0, 0.0, 0), (1.0, 0.05, 0), (1.0, 0.1, 1), (2.0, 0.1, 2), (0.5, 0.1, 0), (1.0, 0.35, 3), (1.0, 99.0, 9)],
)
def test_due(speed: float, elapsed_s: float, due: int):
    clock = PlaybackClock(np.arange(10) / 10, anchor_wall_s=50.0, anchor_media_s=0.0, speed=speed)
    assert clock.due(50.0 + elapsed_s) == due


def test_waits_until_the_next_frame_and_not_at_all_when_late():
    clock = PlaybackClock(np.arange(10) / 10, anchor_wall_s=0.0, anchor_media_s=0.0, speed=2.0)
    assert clock.wait_s(0, 0.0) == pytest.approx(0.05)
    assert clock.wait_s(0, 3.0) == 0.0
    assert clock.wait_s(9, 0.45) == pytest.approx(0.05), "the last frame is shown for its period"
