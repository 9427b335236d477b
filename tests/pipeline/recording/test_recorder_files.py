"""The files of a recording are complete, whatever ends it: a next file, a full disk, or a kill."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader

from pipeline.common.errors import BadInput
from pipeline.params import Params
from pipeline.recording.recorder import Recorder
from pipeline.recording.rewrite import recover
from pipeline.recording.segments import FileRotation, Segments
from pipeline.recording.session.source import SessionSource
from pipeline.types.camera_shot import Shot
from tests.conftest import ROOT
from tests.pipeline.recording.frames import ABOUT, full, same, sweep


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


def test_a_file_that_exists_is_never_written_over(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_text("precious")
    with pytest.raises(BadInput, match="already"):
        Recorder(tmp_path / "a.mcap", ABOUT)
    with pytest.raises(OSError, match="No such file"):
        Recorder(tmp_path / "no" / "a.mcap", ABOUT)
    assert (tmp_path / "a.mcap").read_text() == "precious"


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


def test_a_recording_that_has_failed_takes_no_marks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Segments, "write", fail)
    recorder = Recorder(tmp_path / "a.mcap", ABOUT)
    recorder.put(full(0))
    assert recorder.stop().error is not None
    assert not recorder.mark("lost")


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
