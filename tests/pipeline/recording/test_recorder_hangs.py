"""Writing that hangs is said; it goes on in a new file, or when the disk responds, and nothing else is lost."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from pipeline.common.watchdog import Watchdog
from pipeline.recording import recorder_thread
from pipeline.recording.mcap import output
from pipeline.recording.recorder import Recorder
from pipeline.recording.segments import Segments
from pipeline.recording.session.source import SessionSource
from pipeline.types import Frame
from tests.app.waiting import wait_until
from tests.pipeline.recording.frames import ABOUT, full

WAIT_S = 180.0


@pytest.fixture
def gate(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """Chunks hold a few frames and are not flushed by time, so that some frames are in none when writing hangs."""
    monkeypatch.setattr(recorder_thread, "FLUSH_S", 1e6)
    monkeypatch.setattr(output, "CHUNK_BYTES", 50_000)
    gate = threading.Event()
    yield gate
    gate.set()


def hanging_at(
    names: set[str], gate: threading.Event, monkeypatch: pytest.MonkeyPatch, *, in_disk: bool = False
) -> threading.Semaphore:
    """Writing these frames waits for the gate; the semaphore counts those that wait."""
    write, waits = Segments.write, threading.Semaphore(0)

    def wait_and_write(self: Segments, frame: Frame, *arguments: Any, **named: Any) -> None:
        if frame.name in names:
            waits.release()
            if in_disk:
                with self.disk.waiting():
                    assert gate.wait(WAIT_S)
            else:
                assert gate.wait(WAIT_S)
        write(self, frame, *arguments, **named)

    monkeypatch.setattr(Segments, "write", wait_and_write)
    return waits


def names_in(files: tuple[Path, ...]) -> list[list[str]]:
    """Frames of each file."""
    sessions = [SessionSource("a", str(file)) for file in files]
    return [[session.frame(index).name for index in range(len(session))] for session in sessions]


def looks_until(watchdog: Watchdog, condition: Callable[[], bool]) -> None:
    """The watchdog looks as if an hour had passed."""
    assert wait_until(lambda: bool(watchdog.look(time.monotonic() + 3600.0)) or condition())


def test_another_thread_continues_in_a_new_file_and_only_what_hangs_is_lost(
    tmp_path: Path, gate: threading.Event, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits, told = hanging_at({"000040"}, gate, monkeypatch), threading.Event()
    watchdog = Watchdog()
    recorder = Recorder(tmp_path / "a.mcap", ABOUT, watchdog=watchdog, on_change=told.set)
    for index in range(40):
        assert recorder.put(full(index))
    recorder.mark("before it")
    recorder.put(full(40))
    assert waits.acquire(timeout=WAIT_S)
    hung = recorder._thread
    looks_until(watchdog, told.is_set)
    assert told.is_set()
    for index in range(41, 45):
        assert recorder.put(full(index))
    trouble = recorder.state.trouble
    assert trouble is not None
    assert trouble.startswith("the recorder hung for ")
    assert trouble.endswith("(recording frames) and continues in a new file")
    state = recorder.stop()
    assert (state.error, state.dropped, state.dropped_because) == (None, 1, "the recorder hung")
    gate.set()
    assert hung.has_ended.wait(WAIT_S)
    assert [file.name for file in state.files] == ["a.mcap", "a_001.mcap"]
    before, after = names_in(state.files)
    assert before + after == [f"{index:06d}" for index in range(45) if index != 40], "each once"
    assert state.frames == 44
    session = SessionSource("a", str(state.file))
    assert [mark.text for mark in session.marks()] == ["before it"]
    notes = b"".join(stored.data for stored in session.file.messages(("/notes",)))
    assert b"1 frames were dropped here: the recorder hung" in notes


def test_the_file_of_a_thread_that_never_returns_keeps_its_complete_chunks(
    tmp_path: Path, gate: threading.Event, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits, watchdog, told = hanging_at({"000040"}, gate, monkeypatch), Watchdog(), threading.Event()
    recorder = Recorder(tmp_path / "a.mcap", ABOUT, watchdog=watchdog, on_change=told.set)
    for index in range(41):
        assert recorder.put(full(index))
    assert waits.acquire(timeout=WAIT_S)
    looks_until(watchdog, told.is_set)
    state = recorder.stop()
    assert not gate.is_set()
    before, after = names_in(state.files)
    assert before + after == [f"{index:06d}" for index in range(40)]
    assert before, "full chunks"


def test_writing_that_hangs_again_and_again_ends_the_recording(
    tmp_path: Path, gate: threading.Event, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits = hanging_at({f"{index:06d}" for index in range(1, 9)}, gate, monkeypatch)
    watchdog, told = Watchdog(), threading.Event()
    recorder = Recorder(tmp_path / "a.mcap", ABOUT, watchdog=watchdog, on_change=told.set)
    for index in range(9):
        recorder.put(full(index))
    for _ in range(4):
        told.clear()
        assert waits.acquire(timeout=WAIT_S)
        looks_until(watchdog, told.is_set)
    state = recorder.stop()
    assert state.error == "recording stopped: writing it keeps hanging; the 0 frames before are saved"
    assert not recorder.put(full(9))


def test_a_disk_that_hangs_is_said_and_recording_goes_on_when_it_responds(
    tmp_path: Path, gate: threading.Event, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits, watchdog, told = hanging_at({"000001"}, gate, monkeypatch, in_disk=True), Watchdog(), threading.Event()
    recorder = Recorder(tmp_path / "a.mcap", ABOUT, watchdog=watchdog, on_change=told.set)
    for index in range(4):
        recorder.put(full(index))
    assert waits.acquire(timeout=WAIT_S)
    looks_until(watchdog, told.is_set)
    trouble = recorder.state.trouble
    assert trouble is not None
    assert trouble.startswith("the disk does not respond")
    gate.set()
    assert wait_until(lambda: recorder.state.trouble is None)
    state = recorder.stop()
    assert (state.error, state.dropped) == (None, 0)
    assert names_in(state.files) == [[f"{index:06d}" for index in range(4)]]


def test_a_thread_that_dies_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def die(self: Segments, *arguments: Any, **named: Any) -> None:
        raise SystemExit("by a library")

    told = threading.Event()
    recorder = Recorder(tmp_path / "a.mcap", ABOUT, on_change=told.set)
    recorder.put(full(0))
    assert wait_until(lambda: recorder.state.frames == 1)
    monkeypatch.setattr(Segments, "write", die)
    recorder.put(full(1))
    assert told.wait(WAIT_S)
    assert recorder.state.error == ("recording stopped: SystemExit: by a library; the 1 frames before are saved")
    assert names_in(recorder.stop().files) == [["000000"]]
