"""Figures of a stream come from what arrived; what cannot be known is null."""

from __future__ import annotations

import threading

import pytest

from pipeline.sources.live.health import StreamStats

MS = 1_000_000


def after(arrivals_ms: list[float], now_ms: float):
    stats = StreamStats("lidar")
    for at in arrivals_ms:
        stats.arrived(round(at * MS), round(at * MS) - 50 * MS)
    return stats.health(round(now_ms * MS))


def test_before_the_first_message_nothing_is_made_up() -> None:
    health = after([], 5000.0)
    assert (health.state, health.rate_hz, health.age_ms, health.jitter_ms) == ("absent", None, None, None)


def test_two_messages_are_no_rate() -> None:
    health = after([0.0, 100.0], 110.0)
    assert health.rate_hz is None
    assert health.age_ms == 60.0


def test_rate_and_jitter_of_a_steady_stream() -> None:
    health = after([100.0 * k for k in range(20)], 1910.0)
    assert health.rate_hz == pytest.approx(10.0)
    assert health.jitter_ms == pytest.approx(0.0, abs=1e-9)
    assert health.state == "ok"


def test_jitter_is_how_much_the_gaps_differ() -> None:
    health = after([0, 90, 200, 290, 400, 490, 600], 610.0)
    assert health.jitter_ms == pytest.approx(10.0)


@pytest.mark.parametrize(("silence_ms", "state"), [(50, "ok"), (290, "ok"), (310, "stale"), (1001, "silent")])
def test_silence_has_names(silence_ms: float, state: str) -> None:
    assert after([100.0 * k for k in range(10)], 900.0 + silence_ms).state == state


def test_a_slow_sensor_is_not_stale_between_its_messages() -> None:
    assert after([0.0, 300.0, 600.0], 600.0 + 700.0).state == "ok"


@pytest.mark.parametrize(("since_ms", "state"), [(999, "ok"), (1300, "ok"), (2999, "ok"), (3001, "silent")])
def test_one_that_speaks_once_a_second_is_not_silent_before_its_next_word(since_ms: float, state: str) -> None:
    assert after([1000.0 * k for k in range(5)], 4000.0 + since_ms).state == state


def test_after_the_window_the_rate_is_unknown_again() -> None:
    health = after([100.0 * k for k in range(10)], 900.0 + 5000.0)
    assert (health.state, health.rate_hz, health.jitter_ms) == ("silent", None, None)
    assert health.age_ms == 5050.0


def test_health_may_be_asked_for_while_messages_arrive() -> None:
    """A reader's thread counts while another thread queries, a thousand times concurrently."""
    stats, stop = StreamStats("camera"), threading.Event()

    def count() -> None:
        at = 0
        while not stop.is_set():
            stats.arrived(at := at + MS, at)

    reader = threading.Thread(target=count)
    reader.start()
    try:
        for _ in range(1000):
            stats.health(10_000 * MS)
    finally:
        stop.set()
        reader.join()
