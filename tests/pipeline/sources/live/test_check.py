"""When a check of the sensors ends."""

from __future__ import annotations

from itertools import chain, repeat
from typing import Literal, cast

import pytest

from pipeline.sources.live.check import check
from pipeline.sources.live.source import LiveSensors
from pipeline.types import StreamHealth

State = Literal["ok", "stale", "silent", "absent"]


class Sensor:
    """A LiDAR that goes through these states and stays in the last one."""

    def __init__(self, *states: State) -> None:
        self._states = chain(states, repeat(states[-1]))
        self.inputs: dict[str, object] = {}
        self.is_open = False

    def start(self) -> None:
        self.is_open = True

    def next(self, timeout_s: float) -> None:
        assert self.is_open
        assert timeout_s > 0.0

    def health(self) -> tuple[StreamHealth, ...]:
        return (StreamHealth("lidar", next(self._states), None, None, None, 0),)

    def close(self) -> None:
        self.is_open = False


@pytest.mark.parametrize(
    ("states", "good"),
    [
        pytest.param(("ok",), True, id="it delivers"),
        pytest.param(("stale", "stale", "ok"), True, id="late for once"),
        pytest.param(("stale", "silent"), False, id="late, then silent"),
        pytest.param(("absent",), False, id="never there"),
    ],
)
def test_a_late_sensor_is_waited_for_and_a_silent_one_is_not(states: tuple[State, ...], good: bool) -> None:
    sensor = Sensor(*states)
    (report,) = check(cast("LiveSensors", sensor), 1e-3)
    assert report.is_good is good
    assert not sensor.is_open


class Ego(Sensor):
    """Ego motion from a receiver, at this rate."""

    def __init__(self, rate_hz: float | None) -> None:
        super().__init__("ok")
        self._rate_hz = rate_hz

    def health(self) -> tuple[StreamHealth, ...]:
        return (StreamHealth("ego", "ok", self._rate_hz, None, None, 0),)


@pytest.mark.parametrize(
    ("rate_hz", "said"),
    [
        (10.0, None),
        (4.98, None),
        (2.02, "ego speed is up to 0.5 s old, yaw rate lags by another 0.5 s: set the receiver to 5 Hz"),
        (1.0, "ego speed is up to 1.0 s old, yaw rate lags by another 0.5 s: set the receiver to 5 Hz"),
        (0.5, "ego speed is up to 2.0 s old, yaw rate is never available: set the receiver to 5 Hz"),
        (None, "too few fixes for a rate: listen longer with --seconds"),
    ],
)
def test_what_a_slow_receiver_costs_is_said(rate_hz: float | None, said: str | None) -> None:
    (report,) = check(cast("LiveSensors", Ego(rate_hz)), 1e-3)
    assert report.cost == said


def test_one_that_stays_late_is_late(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pipeline.sources.live.check._LATE_S", 0.01)
    (report,) = check(cast("LiveSensors", Sensor("stale")), 1e-3)
    assert report.health.state == "stale"
