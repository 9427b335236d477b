"""A disk or a machine that is too slow never blocks the pipeline, and nothing is lost silently."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.recording import recorder as recorder_module
from pipeline.recording import write_queue
from pipeline.recording.recorder import Recorder
from pipeline.recording.recording_state import RecordingState
from pipeline.recording.segments import Segments
from pipeline.recording.session.source import Mark, SessionSource
from pipeline.types.camera_shot import Shot
from tests.app.waiting import wait_until
from tests.pipeline.recording.frames import ABOUT, full, image

WAIT_S = 180.0


@contextmanager
def slow_disk(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """Writing waits for the event."""
    may_write = threading.Event()
    write = Segments.write

    def wait_and_write(self: Segments, *arguments: Any, **named: Any) -> None:
        with self.disk.waiting():
            assert may_write.wait(20.0)
        write(self, *arguments, **named)

    monkeypatch.setattr(Segments, "write", wait_and_write)
    yield may_write
    may_write.set()


def test_a_slow_disk_holds_nobody_up_and_what_is_dropped_is_counted_and_noted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    with slow_disk(monkeypatch) as may_write:
        recorder = Recorder(tmp_path / "a.mcap", ABOUT, queued=4)
        taken = [recorder.put(full(index)) for index in range(12)]  # returns though nothing can be written
        assert taken[:4] == [True] * 4
        assert taken.count(False) >= 7
        assert recorder.state.dropped == taken.count(False)
        recorder.mark("marks are never dropped")
        while recorder.state.dropped_because != "the disk was too slow":  # it is told from the share of the time
            taken.append(recorder.put(full(len(taken))))  # the writer may have begun only now, and left room for one
        may_write.set()
        state = recorder.stop()
    assert state.frames == taken.count(True)
    assert state.dropped == taken.count(False)
    assert "frames were dropped" in caplog.text
    session = SessionSource("a", str(tmp_path / "a.mcap"))
    names = [session.frame(index).name for index in range(len(session))]
    assert names == [f"{index:06d}" for index, was_taken in enumerate(taken) if was_taken]
    notes = b"".join(stored.data for stored in session.file.messages(("/notes",)))
    assert f"{state.dropped} frames were dropped here: the disk was too slow".encode() in notes
    assert len(session.marks()) == 1


def test_what_a_slow_disk_leaves_no_room_for_is_counted_by_kind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shot = Shot(encoded=image(0).encoded)
    assert shot.encoded is not None
    monkeypatch.setattr(write_queue, "QUEUED_BYTES", 3 * len(shot.encoded))
    with slow_disk(monkeypatch) as may_write:
        recorder = Recorder(tmp_path / "a.mcap", ABOUT, queued=2)
        while recorder.put(full(0)):  # until there is no room for frames
            pass
        for index in range(5):
            recorder.image(shot, index, index)
        assert recorder.state.dropped == 3
        may_write.set()
        state = recorder.stop()
    session = SessionSource("a", str(tmp_path / "a.mcap"))
    notes = b"".join(stored.data for stored in session.file.messages(("/notes",)))
    assert b"1 frames, 2 images were dropped here" in notes
    assert len(list(session.file.messages(("/camera/image",)))) == state.frames + 3


def test_a_busy_machine_is_not_taken_for_a_slow_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What takes the time is what comes before a write: encoding and compressing."""
    may_go_on, write_image = threading.Event(), Segments.write_image

    def wait_and_write(self: Segments, *arguments: Any) -> None:
        assert may_go_on.wait(20.0)
        write_image(self, *arguments)

    monkeypatch.setattr(Segments, "write_image", wait_and_write)
    monkeypatch.setattr(write_queue, "QUEUED_BYTES", 10_000_000)
    recorder = Recorder(tmp_path / "a.mcap", ABOUT)
    recorder.put(full(0))
    shot = Shot(pixels=np.zeros((72, 128, 3), np.uint8))
    while recorder.state.dropped < 3:
        recorder.image(shot, 0, 0)
    may_go_on.set()
    state = recorder.stop()
    assert state.dropped_because == "the machine was too busy"
    session = SessionSource("a", str(tmp_path / "a.mcap"))
    notes = b"".join(stored.data for stored in session.file.messages(("/notes",)))
    assert b"images were dropped here: the machine was too busy" in notes


def test_a_mark_stays_with_its_frame_however_many_wait(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with slow_disk(monkeypatch) as may_write:
        recorder = Recorder(tmp_path / "a.mcap", ABOUT)
        for index in range(6):
            recorder.put(full(index))
            assert recorder.mark(str(index))
        may_write.set()
        recorder.stop()
    session = SessionSource("a", str(tmp_path / "a.mcap"))
    assert session.marks() == tuple(Mark(session.t_ns(index), str(index)) for index in range(6))


def test_what_there_is_no_time_left_to_write_is_dropped_and_noted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As when a system ends the program while its queue is full; a mark that waits is written."""
    may_go_on, write = threading.Event(), Segments.write

    def wait_and_write(self: Segments, *arguments: Any, **named: Any) -> None:
        assert may_go_on.wait(20.0)
        write(self, *arguments, **named)

    monkeypatch.setattr(Segments, "write", wait_and_write)
    recorder = Recorder(tmp_path / "a.mcap", ABOUT)
    recorder.put(full(0))
    assert wait_until(lambda: not recorder._jobs.waiting["frames"]), "it is being written"
    for index in range(1, 6):
        recorder.put(full(index))
    recorder.mark("a mark")
    stopping = threading.Thread(target=recorder.stop, args=(0.0,))
    stopping.start()
    assert wait_until(lambda: recorder._jobs.ends_by_s <= time.monotonic())
    may_go_on.set()
    stopping.join(20.0)
    state = recorder.state
    assert (state.frames, state.dropped, state.error) == (1, 5, None)
    session = SessionSource("a", str(tmp_path / "a.mcap"))
    notes = [stored.data for stored in session.file.messages(("/notes",))]
    assert sum(b"5 frames were dropped here: there was no time left to write them" in each for each in notes) == 1
    assert len(session.marks()) == 1


def test_a_disk_that_hangs_is_not_waited_for_for_ever(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorder_module, "_PATIENCE_S", 0.05)
    with slow_disk(monkeypatch) as may_write:
        recorder = Recorder(tmp_path / "a.mcap", ABOUT, queued=2)
        while recorder.put(full(0)):  # until the queue is full
            pass
        stopped: list[RecordingState] = []
        stopping = threading.Thread(target=lambda: stopped.append(recorder.stop()), daemon=True)
        stopping.start()
        stopping.join(WAIT_S)
        assert not stopping.is_alive()
        assert stopped[0].error == "recording stopped: the disk does not respond; the 0 frames before are saved"
        assert recorder.stop() == stopped[0]
        may_write.set()
        assert recorder._thread.has_ended.wait(WAIT_S), "it ends once the disk answers"
    assert len(SessionSource("a", str(tmp_path / "a.mcap"))) == recorder.state.frames >= 2


def test_a_writer_that_is_slow_and_goes_on_is_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a busy machine: one frame per ``_PATIENCE_S``, which expires many times."""
    monkeypatch.setattr(recorder_module, "_PATIENCE_S", 0.0)
    allowed, write = threading.Semaphore(0), Segments.write

    def when_allowed(self: Segments, *arguments: Any, **named: Any) -> None:
        assert allowed.acquire(timeout=WAIT_S)
        write(self, *arguments, **named)

    monkeypatch.setattr(Segments, "write", when_allowed)
    recorder = Recorder(tmp_path / "a.mcap", ABOUT)
    for index in range(6):
        assert recorder.put(full(index))
    has_ended, rounds = recorder._thread.has_ended, []

    def one_more(patience_s: float) -> bool:
        rounds.append(patience_s)
        allowed.release()
        done = recorder._jobs.done
        return wait_until(lambda: has_ended.is_set() or recorder._jobs.done != done)

    monkeypatch.setattr(has_ended, "wait", one_more)
    state = recorder.stop()
    assert (state.error, state.frames) == (None, 6)
    assert len(rounds) >= 6
