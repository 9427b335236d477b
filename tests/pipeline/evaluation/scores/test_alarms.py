"""When warning and braking were due, and when they came."""

from __future__ import annotations

import pytest

from pipeline.evaluation.scores.alarms import Alarm, AlarmKind, alarms
from pipeline.params import AebParams
from tests.pipeline.evaluation.scores.drives import TICK_NS, believed, truth

CLOSING = truth(*({1: (40.0 - n, 0.0)} for n in range(30)))
"""At 10 m/s: TTC is 2.2 s at 22 m, so warning is due from 21 m on (frame 19), braking (4 m/s² needed, with build-up and
margin: 16.5 m) from 16 m on (frame 24)."""


def of_kind(states: list[str | None], kind: AlarmKind) -> list[Alarm]:
    pairs = [(believed(n, [], None, state), CLOSING.frames[n * TICK_NS]) for n, state in enumerate(states)]
    return [alarm for alarm in alarms(pairs, AebParams()) if alarm.kind == kind]


def acting(state: str, first: int, last: int) -> list[str | None]:
    return [state if first <= n <= last else "cruise" for n in range(30)]


@pytest.mark.parametrize(
    ("states", "delays"),
    [
        pytest.param(acting("warn", 19, 29), [0.0], id="on time"),
        pytest.param(acting("warn", 22, 29), [0.3], id="late"),
        pytest.param(acting("warn", 15, 29), [-0.4], id="early"),
        pytest.param(acting("full_brake", 22, 29), [0.3], id="braking warns too"),
        pytest.param(acting("cruise", 0, 29), [None], id="never"),
        pytest.param(acting("warn", 3, 5), [None, None], id="at another time: one missing, one without danger"),
    ],
)
def test_warning(states: list[str | None], delays: list[float | None]) -> None:
    found = of_kind(states, "warning")
    assert [alarm.delay_s for alarm in found] == [None if d is None else pytest.approx(d) for d in delays]


def test_a_warning_without_danger_is_told_from_one_that_is_missing() -> None:
    false, missing = of_kind(acting("warn", 3, 5), "warning")
    assert (false.due_ns, false.acted_ns) == (None, 3 * TICK_NS)
    assert (missing.due_ns, missing.acted_ns) == (19 * TICK_NS, None)


def test_a_warning_is_no_braking() -> None:
    (braking,) = of_kind(acting("warn", 19, 29), "braking")
    assert braking.due_ns == 24 * TICK_NS
    assert braking.acted_ns is None


def test_the_true_ttc_when_it_came_is_told() -> None:
    (warning,) = of_kind(acting("warn", 20, 29), "warning")
    assert warning.true_ttc_s == pytest.approx(2.0)


def test_without_ego_speed_there_is_no_brake_to_judge() -> None:
    assert of_kind([None] * 30, "warning") == []


def test_a_lead_that_pulls_away_is_no_danger() -> None:
    away = truth(*({1: (5.0 + n, 0.0)} for n in range(10)))
    pairs = [(believed(n, [], None, "cruise"), away.frames[n * TICK_NS]) for n in range(10)]
    assert alarms(pairs, AebParams()) == []
