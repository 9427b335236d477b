"""What a recorder is given can be read again: frames, and what sensors send in between, each when it came."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.params import Params, with_changes
from pipeline.recording.recorder import Recorder
from pipeline.recording.session.source import SessionSource
from pipeline.recording.session.velodyne_scan import RawLidar
from pipeline.types.camera_shot import Shot
from tests.pipeline.recording.frames import ABOUT, PERIOD_NS, full, image, same, sweep


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
