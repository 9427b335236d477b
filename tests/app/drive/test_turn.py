"""Who may work: what is in front goes first, and nobody waits for ever."""

from __future__ import annotations

import threading

import pytest

from app.drive import turn as turn_module
from app.drive.turn import Turn
from app.engine import Engine
from pipeline.params import Params, SyncParams
from pipeline.types import Frame
from tests.app.test_live_engine import Sensors

WAIT_S = 30.0


def in_background(turn: Turn) -> threading.Thread:
    """Somebody who asks for a turn after much work; alive as long as it waits."""
    thread = threading.Thread(target=turn.wait, args=(1.0,), daemon=True)
    thread.start()
    return thread


def test_work_in_front_that_never_ends_does_not_stop_the_background(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(turn_module, "_LONGEST_FRONT_S", 0.01)
    turn = Turn()
    with turn.foreground():
        waiting = in_background(turn)
        waiting.join(WAIT_S)
        assert not waiting.is_alive()


def test_the_background_waits_while_somebody_works_in_front(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(turn_module, "_LONGEST_FRONT_S", WAIT_S)
    turn = Turn()
    with turn.foreground():
        waiting = in_background(turn)
        waiting.join(0.05)
        assert waiting.is_alive()
    waiting.join(WAIT_S)
    assert not waiting.is_alive()


class WhileWaiting(Sensors):
    """Sensors that let somebody in the background work while they are waited for."""

    engine: Engine
    let_through: threading.Event

    def next(self, timeout_s: float, params: SyncParams | None = None) -> Frame | None:
        waiting = in_background(self.engine.drives.turn)
        waiting.join(1.0)
        if not waiting.is_alive():
            self.let_through.set()
        return super().next(timeout_s, params)


def test_the_background_works_while_live_sensors_are_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(turn_module, "_LONGEST_FRONT_S", WAIT_S)
    sensors = WhileWaiting()
    engine = Engine(lambda _, progress: sensors, None, Params(), uri=sensors.uri)
    sensors.engine, sensors.let_through = engine, threading.Event()
    engine.start()
    try:
        assert sensors.let_through.wait(4.0)
    finally:
        engine.stop()
