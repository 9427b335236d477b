"""Who may compute: interactive requests and slider drags take priority, and nothing waits for ever."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from app.drive import compute_scheduler as turn_module
from app.drive.compute_scheduler import ComputeScheduler
from app.engine.engine import Engine
from pipeline.inference.cancellation import Stopped, of_this_thread
from pipeline.params import Params, SyncParams
from pipeline.types import Frame
from tests.app.engine.recording_helpers import Options
from tests.app.engine.test_live_engine import Sensors

WAIT_S = 180.0
FOR_EVER_S = 1e6
A_WHILE_S = 0.05
"""Time within which a thread that is not blocked has continued. On a slower machine, the test can only miss a fault."""


class Piece:
    """A background worker on one piece of work, with a network that runs until it is told to end. begun: the piece has
    begun. options: of the network's run. ended: how the piece ended, ``done`` or ``stopped``."""

    def __init__(self, turn: ComputeScheduler, *, to_the_end: bool = False) -> None:
        self.begun, self.answer, self.options, self.ended = threading.Event(), threading.Event(), Options(), ""
        self._turn, self._to_the_end = turn, to_the_end
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    @property
    def waits(self) -> bool:
        return not self.begun.wait(A_WHILE_S)

    def finish(self) -> str:
        """Let the network return."""
        self.answer.set()
        self._thread.join(WAIT_S)
        return self.ended

    def _work(self) -> None:
        try:
            with self._turn.background(to_the_end=self._to_the_end):
                with of_this_thread().ends(self.options):
                    self.begun.set()
                    assert self.answer.wait(WAIT_S)
                if self.options.terminate:
                    raise Stopped
            self.ended = "done"
        except Stopped:
            self.ended = "stopped"


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """No timeout expires unless a test wants it to."""
    for name in ("HAND_RESTS_S", "_LONGEST_FRONT_S", "_LONGEST_WAIT_S"):
        monkeypatch.setattr(turn_module, name, FOR_EVER_S)


@pytest.fixture
def turn() -> Iterator[ComputeScheduler]:
    turn = ComputeScheduler()
    yield turn
    turn.end()


@contextmanager
def hand_rests(turn: ComputeScheduler, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """After this block, the user's input counts as stopped."""
    monkeypatch.setattr(turn_module, "HAND_RESTS_S", 0.0)
    with turn.foreground():
        turn.asked()
        yield


def test_nobody_in_front_keeps_nobody_waiting(turn: ComputeScheduler) -> None:
    piece = Piece(turn)
    assert piece.begun.wait(WAIT_S)
    assert piece.finish() == "done"


def test_the_background_waits_while_somebody_works_in_front(turn: ComputeScheduler) -> None:
    with turn.foreground():
        piece = Piece(turn)
        assert piece.waits
    assert piece.begun.wait(WAIT_S)
    assert piece.finish() == "done"


def test_the_background_waits_while_a_hand_moves(turn: ComputeScheduler, monkeypatch: pytest.MonkeyPatch) -> None:
    turn.asked()
    piece = Piece(turn)
    assert piece.waits, "it was not served yet"
    with turn.foreground():
        pass
    assert piece.waits, "who asked a moment ago asks again"
    with hand_rests(turn, monkeypatch):
        assert piece.waits
    assert piece.begun.wait(WAIT_S)
    assert piece.finish() == "done"


def test_what_is_asked_for_once_keeps_nobody_waiting_once_it_is_served(turn: ComputeScheduler) -> None:
    turn.asked(rests=True)
    assert turn.rest_s == 0
    piece = Piece(turn)
    assert piece.begun.wait(WAIT_S)
    assert piece.finish() == "done"


@pytest.mark.parametrize("rests", [False, True])
def test_a_network_that_runs_in_the_background_is_stopped_for_who_asks(turn: ComputeScheduler, rests: bool) -> None:
    piece = Piece(turn)
    assert piece.begun.wait(WAIT_S)
    assert not piece.options.terminate
    turn.asked(rests=rests)
    assert piece.options.terminate
    assert piece.finish() == "stopped"


def test_a_clip_that_a_person_waits_for_goes_after_who_asks_and_is_not_stopped(turn: ComputeScheduler) -> None:
    with turn.foreground():
        piece = Piece(turn, to_the_end=True)
        assert piece.waits
    assert piece.begun.wait(WAIT_S)
    turn.asked()
    assert not piece.options.terminate
    assert piece.finish() == "done"


def test_a_frame_that_is_shown_while_playing_stops_no_network(turn: ComputeScheduler) -> None:
    turn.playing(True)
    piece = Piece(turn)
    assert piece.begun.wait(WAIT_S)
    with turn.foreground():
        pass
    assert not piece.options.terminate
    assert piece.finish() == "done"


def test_who_asks_stops_nothing_of_their_own_that_was_begun_after(turn: ComputeScheduler) -> None:
    turn.asked()
    with turn.stoppable(), of_this_thread().ends(Options()):
        pass
    with turn.stoppable():
        turn.asked()
        with pytest.raises(Stopped), of_this_thread().ends(Options()):
            pass


def test_work_in_front_that_never_ends_does_not_stop_the_background(
    turn: ComputeScheduler, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(turn_module, "_LONGEST_FRONT_S", 0.01)
    with turn.foreground():
        piece = Piece(turn)
        assert piece.begun.wait(WAIT_S)
        assert piece.finish() == "done"


def test_a_hand_that_never_rests_does_not_stop_the_background(
    turn: ComputeScheduler, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Work that has waited too long, even if only because it was stopped repeatedly, is no longer stopped."""
    monkeypatch.setattr(turn_module, "_LONGEST_FRONT_S", 0.01)
    turn.asked()
    piece = Piece(turn)
    assert piece.begun.wait(WAIT_S)
    turn.asked()
    assert not piece.options.terminate
    assert piece.finish() == "done"


def test_time_spent_on_what_was_stopped_counts_as_waiting(turn: ComputeScheduler) -> None:
    piece = Piece(turn)
    assert piece.begun.wait(WAIT_S)
    since = turn._overdue_at_s
    turn.asked(rests=True)
    assert piece.finish() == "stopped"
    again = Piece(turn)
    assert again.begun.wait(WAIT_S)
    assert turn._overdue_at_s == since
    assert again.finish() == "done"
    assert turn._overdue_at_s is None


def test_while_a_drive_plays_the_background_pays_for_its_work_and_goes_on_after_a_shown_frame(
    turn: ComputeScheduler, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = [time.monotonic()]
    monkeypatch.setattr(turn_module.time, "monotonic", lambda: now_s[0])
    turn.playing(True)
    with turn.background():
        now_s[0] += 1.0  # a second of work: some 3 s of playing
    piece = Piece(turn)
    assert piece.waits
    with turn.foreground():
        now_s[0] += 1.0
    assert piece.waits, "it has not been paid for"
    now_s[0] += 3.0
    assert piece.waits, "the next frame may be due"
    with turn.foreground():
        pass
    assert piece.begun.wait(WAIT_S)
    assert piece.finish() == "done"


def test_a_drive_that_plays_without_showing_frames_stops_nobody(
    turn: ComputeScheduler, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As when frames are read too slowly."""
    monkeypatch.setattr(turn_module, "_LONGEST_WAIT_S", 0.01)
    turn.playing(True)
    turn._credit_s = -0.01
    piece = Piece(turn)
    assert piece.begun.wait(WAIT_S)
    assert piece.finish() == "done"


def test_who_ends_lets_everybody_go(turn: ComputeScheduler) -> None:
    with turn.foreground():
        piece = Piece(turn)
        turn.end()
        assert piece.begun.wait(WAIT_S)
    assert piece.finish() == "done"


class WhileWaiting(Sensors):
    """Sensors that let a background worker run while they are waited for."""

    engine: Engine
    let_through: threading.Event

    def next(self, timeout_s: float, params: SyncParams | None = None) -> Frame | None:
        piece = Piece(self.engine.drives.turn)
        if piece.begun.wait(1.0):
            self.let_through.set()
        piece.finish()
        return super().next(timeout_s, params)


def test_the_background_works_while_live_sensors_are_waited_for() -> None:
    sensors = WhileWaiting()
    engine = Engine(lambda _, progress: sensors, None, Params(), uri=sensors.uri)
    sensors.engine, sensors.let_through = engine, threading.Event()
    engine.start()
    try:
        assert sensors.let_through.wait(WAIT_S)
    finally:
        engine.stop()
