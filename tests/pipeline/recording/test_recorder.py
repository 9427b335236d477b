"""Recording never blocks the pipeline, never loses a frame silently, and leaves complete files."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader

from pipeline.common.errors import BadInput
from pipeline.params import Params, with_changes
from pipeline.recording import recorder as recorder_module
from pipeline.recording.recorder import Recorder
from pipeline.recording.recording_state import RecordingState
from pipeline.recording.rewrite import recover
from pipeline.recording.segments import FileRotation, Segments
from pipeline.recording.session.source import Mark, SessionSource
from pipeline.recording.session.velodyne_scan import RawLidar
from pipeline.types.camera_shot import Shot
from tests.app.waiting import wait_until
from tests.conftest import ROOT
from tests.pipeline.recording.frames import ABOUT, PERIOD_NS, full, image, same, sweep

WAIT_S = 180.0


def test_what_is_put_can_be_opened_afterwards(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.mcap", ABOUT)
    changed = with_changes(Params(), {"cluster.z_weight": 0.35})
    for index in range(5):
        assert recorder.put(full(index), params=Params() if index < 3 else changed)
    recorder.mark("here")
    state = recorder.stop()
    assert (state.frames, state.dropped, state.error) == (5, 0, None)
    assert state.seconds == pytest.approx(0.4)
    assert state.bytes == (tmp_path / "a.mcap").stat().st_size
    session = SessionSource("a", str(tmp_path / "a.mcap"))
    assert [same(session.frame(index), full(index)) for index in range(5)] == [True] * 5
    assert session.params(4) == changed
    assert [mark.text for mark in session.marks()] == ["here"]
    assert recorder.stop() == state


def test_received_times_are_kept_beside_the_sensors_own(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.mcap", ABOUT)
    received_ns = [10**18, 10**18 + 5, 10**18 + 5]  # the host's clock may stand still
    for index in range(3):
        recorder.put(full(index), received_ns=received_ns[index])
    recorder.stop()
    session = SessionSource("a", str(tmp_path / "a.mcap"))
    assert [session.log_time_ns(index) - 10**18 for index in range(3)] == [0, 5, 6]
    assert [session.t_ns(index) for index in range(3)] == [PERIOD_NS * (1 + index) for index in range(3)]


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
        dropped = 0
        while recorder.state.dropped_because != "the disk was too slow":  # it is told from the share of the time
            dropped += not recorder.put(full(0))
        may_write.set()
        state = recorder.stop()
    assert state.frames == taken.count(True)
    assert state.dropped == taken.count(False) + dropped
    assert "frames were dropped" in caplog.text
    session = SessionSource("a", str(tmp_path / "a.mcap"))
    names = [session.frame(index).name for index in range(len(session))]
    assert names == [f"{index:06d}" for index, was_taken in enumerate(taken) if was_taken]
    notes = b"".join(stored.data for stored in session.file.messages(("/notes",)))
    assert f"{state.dropped} frames were dropped here: the disk was too slow".encode() in notes
    assert len(session.marks()) == 1


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
    assert wait_until(lambda: not recorder._waiting["frames"]), "it is being written"
    for index in range(1, 6):
        recorder.put(full(index))
    recorder.mark("a mark")
    stopping = threading.Thread(target=recorder.stop, args=(0.0,))
    stopping.start()
    assert wait_until(lambda: recorder._ends_by_s <= time.monotonic())
    may_go_on.set()
    stopping.join(20.0)
    state = recorder.state
    assert (state.frames, state.dropped, state.error) == (1, 5, None)
    session = SessionSource("a", str(tmp_path / "a.mcap"))
    notes = [stored.data for stored in session.file.messages(("/notes",))]
    assert sum(b"5 frames were dropped here: there was no time left to write them" in each for each in notes) == 1
    assert len(session.marks()) == 1


def test_a_busy_machine_is_not_taken_for_a_slow_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What takes the time is what comes before a write: encoding and compressing."""
    may_go_on, write_image = threading.Event(), Segments.write_image

    def wait_and_write(self: Segments, *arguments: Any) -> None:
        assert may_go_on.wait(20.0)
        write_image(self, *arguments)

    monkeypatch.setattr(Segments, "write_image", wait_and_write)
    monkeypatch.setattr(recorder_module, "_QUEUED_BYTES", 10_000_000)
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


def test_what_comes_between_frames_is_recorded_when_it_came(tmp_path: Path) -> None:
    """Three images per frame, ego motion twice, one fix; the frame refers to the image that it shows, with a time 4 ms
    later."""
    recorder = Recorder(tmp_path / "a.mcap", ABOUT)
    began_ns, frames = 10**18, [full(index) for index in range(4)]
    for index, frame in enumerate(frames):
        shown, ego, fix = frame.image, frame.ego, frame.gnss
        assert shown is not None
        assert ego is not None
        assert fix is not None
        t_ns, at_ns = frame.t_ns - 60_000_000, began_ns + index * PERIOD_NS
        other = image(100 + index).encoded
        for step, shot in enumerate((Shot(encoded=other), Shot(encoded=shown.encoded), Shot(pixels=shown.bgr))):
            recorder.image(shot, t_ns + step * 33_000_000, at_ns + step)
        recorder.ego(replace(ego, t_ns=ego.t_ns - 1), at_ns + 5)
        recorder.ego(ego, at_ns + 6)
        recorder.fix(fix, at_ns + 7)
        moved = replace(shown, t_ns=t_ns + 37_000_000)
        recorder.put(replace(frame, image=moved), received_ns=at_ns + 10)
    state = recorder.stop()
    assert (state.frames, state.dropped, state.error) == (4, 0, None)
    session = SessionSource("a", str(tmp_path / "a.mcap"))
    for index, frame in enumerate(frames):
        assert frame.image is not None
        expected = replace(frame.image, t_ns=frame.t_ns - 23_000_000)
        assert same(session.frame(index), replace(frame, image=expected))
    stored = {topic: list(session.file.messages((topic,))) for topic in ("/camera/image", "/ego", "/gnss")}
    assert [len(messages) for messages in stored.values()] == [12, 8, 4]
    steps_ns = [each.publish_time_ns - frames[0].t_ns + 60_000_000 for each in stored["/camera/image"]]
    assert steps_ns == [index * PERIOD_NS + step * 33_000_000 for index in range(4) for step in range(3)]
    assert [each.log_time_ns - began_ns for each in stored["/ego"][:2]] == [5, 6]


def test_a_sweep_that_no_frame_shows_is_recorded_and_one_that_a_frame_shows_only_once(tmp_path: Path) -> None:
    """The pipeline is too slow for two of three sweeps; the last frame is recorded before its sweep arrives."""
    recorder = Recorder(tmp_path / "a.mcap", ABOUT)
    sweeps = [sweep(index) for index in range(10)]
    frames = {index: replace(full(index), sweep=sweeps[index]) for index in (0, 3, 6, 9)}
    for index, each in enumerate(sweeps):
        if index == 9:
            recorder.put(frames[index], received_ns=10**18 + each.t_ns)
        recorder.sweep(each, 10**18 + each.t_ns)
        if index in (0, 3, 6):
            recorder.put(frames[index], received_ns=10**18 + each.t_ns + 1)
    state = recorder.stop()
    assert (state.frames, state.dropped, state.error) == (4, 0, None)
    session = SessionSource("a", str(tmp_path / "a.mcap"))
    assert [same(session.frame(place), replace(frames[index], index=place)) for place, index in enumerate(frames)] == [
        True
    ] * 4
    stored = list(session.file.messages(("/lidar/points",)))
    assert [each.publish_time_ns for each in stored] == [each.t_ns for each in sweeps]
    assert [each.log_time_ns - 10**18 for each in stored] == [each.t_ns for each in sweeps]


def test_where_packets_are_recorded_they_hold_the_sweeps(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.mcap", ABOUT, raw_lidar=RawLidar(np.eye(4)))
    recorder.sweep(sweep(0), 10**18)
    recorder.put(replace(full(0), sweep=None))
    recorder.stop()
    session = SessionSource("a", str(tmp_path / "a.mcap"))
    assert list(session.file.messages(("/lidar/points",))) == []


def test_what_a_slow_disk_leaves_no_room_for_is_counted_by_kind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shot = Shot(encoded=image(0).encoded)
    assert shot.encoded is not None
    monkeypatch.setattr(recorder_module, "_QUEUED_BYTES", 3 * len(shot.encoded))
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


def test_a_new_file_holds_the_image_and_the_sweep_of_its_first_frame(tmp_path: Path) -> None:
    parts = Segments(tmp_path / "a.mcap", ABOUT, FileRotation(max_s=0.2))
    frames = [full(index) for index in range(8)]
    for frame in frames:
        assert frame.image is not None
        assert frame.sweep is not None
        parts.write_sweep(frame.sweep, frame.t_ns - 2)
        parts.write_image(Shot(encoded=frame.image.encoded), frame.t_ns - 7_000_001, frame.t_ns - 1)
        parts.write(frame, received_ns=frame.t_ns)
    parts.close()
    assert len(parts.files) == 3
    sessions = [SessionSource("a", str(path)) for path in parts.files]
    read = [session.frame(index) for session in sessions for index in range(len(session))]
    assert [same(replace(a, index=b.index), b) for a, b in zip(read, frames, strict=True)] == [True] * 8
    for topic in ("/camera/image", "/lidar/points"):
        counts = [len(list(session.file.messages((topic,)))) for session in sessions]
        assert counts == [4, 4, 2], "the one that came before a file began is in both"


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


def test_a_recording_that_has_failed_takes_no_marks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Segments, "write", fail)
    recorder = Recorder(tmp_path / "a.mcap", ABOUT)
    recorder.put(full(0))
    assert recorder.stop().error is not None
    assert not recorder.mark("lost")


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
        recorder._thread.join(WAIT_S)
    assert not recorder._thread.is_alive(), "it ends once the disk answers"
    assert len(SessionSource("a", str(tmp_path / "a.mcap"))) == recorder.state.frames >= 2


def test_a_file_that_exists_is_never_written_over(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_text("precious")
    with pytest.raises(BadInput, match="already"):
        Recorder(tmp_path / "a.mcap", ABOUT)
    with pytest.raises(OSError, match="No such file"):
        Recorder(tmp_path / "no" / "a.mcap", ABOUT)
    assert (tmp_path / "a.mcap").read_text() == "precious"


@pytest.mark.parametrize("rotation", [FileRotation(max_s=1.0), FileRotation(max_bytes=300_000.0)], ids=["time", "size"])
def test_each_file_of_a_long_recording_can_be_read_alone(rotation: FileRotation, tmp_path: Path) -> None:
    frames = [replace(full(index), sweep=sweep(index, points=6000)) for index in range(35)]
    parts = Segments(tmp_path / "drive.mcap", ABOUT, rotation)
    for frame in frames:
        parts.write(frame, params=Params())
    parts.close()
    assert [path.name for path in parts.files[:3]] == ["drive.mcap", "drive_001.mcap", "drive_002.mcap"]
    sessions = [SessionSource("a", str(path)) for path in parts.files]
    read = [session.frame(index) for session in sessions for index in range(len(session))]
    assert [same(replace(a, index=b.index), b) for a, b in zip(read, frames, strict=True)] == [True] * 35
    assert all(session.params(0) == Params() for session in sessions)
    assert parts.frames == 35
    assert parts.bytes_written == sum(path.stat().st_size for path in parts.files)
    if rotation.max_s is not None:
        assert [len(session) for session in sessions] == [11, 11, 11, 2]


def test_frames_are_counted_once_when_the_next_file_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "a_001.mcap").write_text("in the way")
    recorder = Recorder(tmp_path / "a.mcap", ABOUT, FileRotation(max_s=0.3))
    for index in range(6):
        recorder.put(full(index))
    state = recorder.stop()
    session = SessionSource("a", str(tmp_path / "a.mcap"))
    assert state.frames == len(session) == 4
    assert state.bytes == (tmp_path / "a.mcap").stat().st_size
    assert state.seconds == pytest.approx(0.3)
    assert "4 frames before are saved" in str(state.error)


_RECORD_FOR_EVER = """
import resource, sys
from dataclasses import replace
from pathlib import Path
from pipeline.recording.recorder import Recorder
from tests.pipeline.recording.frames import ABOUT, full, sweep
limit = int(sys.argv[2])
if limit:
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
recorder = Recorder(Path(sys.argv[1]), ABOUT)
points = sweep(0, points=3000)
for index in range(1_000_000):
    while not recorder.put(replace(full(index), sweep=points)):
        if recorder.state.error:
            print(recorder.stop().error)
            sys.exit(0)
    if index % 10 == 0:
        print(index, recorder.state.bytes, flush=True)
"""


def recording_process(path: Path, limit: int) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", _RECORD_FOR_EVER, str(path), str(limit)]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)


def messages_until_the_cut(path: Path) -> int:
    """The messages that MCAP's own reader finds from the start."""
    count = 0
    with path.open("rb") as file, suppress(McapError):
        for _ in NonSeekingReader(file).iter_messages(log_time_order=False):
            count += 1
    return count


def test_killed_every_complete_chunk_is_there(tmp_path: Path) -> None:
    """Killed once; tests/soak does so repeatedly."""
    path, out = tmp_path / "a.mcap", tmp_path / "out.mcap"
    with recording_process(path, 0) as process:
        assert process.stdout is not None
        written = 0
        while written < 1_000_000:
            written = int(process.stdout.readline().split()[1])
        os.kill(process.pid, signal.SIGKILL)
    assert path.stat().st_size >= written, "what the recorder counts is with the system"
    saved = recover(path, out)
    assert saved.is_cut
    assert saved.lost_chunks == 0
    assert saved.messages == messages_until_the_cut(path)
    session = SessionSource("a", str(out))
    assert len(session) == saved.frames > 0
    for index in (0, len(session) // 2, len(session) - 1):
        assert same(session.frame(index), replace(full(index), sweep=sweep(0, points=3000)))
    assert len(SessionSource("a", str(path))) == saved.frames, "the cut file opens as it is, too"


def test_a_full_disk_stops_the_recording_says_so_and_keeps_what_is_there(tmp_path: Path) -> None:
    """A limit on the file size acts like a full disk, at any byte of a chunk."""
    path = tmp_path / "a.mcap"
    with recording_process(path, 1_000_000) as process:
        assert process.stdout is not None
        *_, error = process.stdout.read().splitlines()
    assert process.returncode == 0
    assert "recording stopped: File too large" in error
    session = SessionSource("a", str(path))
    assert f"{len(session)} frames before are saved" in error
    assert path.stat().st_size <= 1_000_000
    assert not session.file.directory.is_cut
    for index in range(len(session)):
        assert same(session.frame(index).sweep, sweep(0, points=3000))


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
    thread, rounds = recorder._thread, []

    def one_more(patience_s: float) -> None:
        rounds.append(patience_s)
        allowed.release()
        done = recorder._done
        while thread.is_alive() and recorder._done == done:
            threading.Thread.join(thread, 0.001)

    monkeypatch.setattr(thread, "join", one_more)
    state = recorder.stop()
    assert (state.error, state.frames) == (None, 6)
    assert len(rounds) >= 6
