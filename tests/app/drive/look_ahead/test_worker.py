"""Looking ahead of a drive's run: the results are the same with the process, without it, and when it fails."""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace

import pytest

from app.core.detection_cache import DetectionCache
from app.drive.background_runs import BackgroundRuns
from app.drive.compute_scheduler import ComputeScheduler
from app.drive.frame_inputs import InputStore
from app.drive.full_run import DriveRun
from app.drive.look_ahead import client
from app.drive.look_ahead.worker import _MOST_READY, LookAhead, _is_worth_it, _Work
from app.drive.open_recording import OpenRecording
from pipeline.detection import Detectors
from pipeline.params import Params
from tests.app.drive.look_ahead.networks import COMMAND, FRAMES, both_views, opened, setup
from tests.app.engine.recording_helpers import Recording
from tests.app.waiting import wait_until

WAIT_S = 180.0


@pytest.fixture(scope="module")
def detectors(tmp_path_factory: pytest.TempPathFactory) -> Detectors:
    return both_views(tmp_path_factory.mktemp("networks"))


@pytest.fixture(scope="module")
def alone(detectors: Detectors) -> DriveRun:
    """The run without a process."""
    recording = opened(detectors)
    recording.runs.want(Params(), "default")
    run = recording.runs.current
    assert run is not None
    while not run.is_complete:
        recording.advance(run)
    return run


@pytest.fixture
def drives() -> Iterator[BackgroundRuns]:
    drives = BackgroundRuns(DetectionCache())
    yield drives
    drives.stop()


def computed(drives: BackgroundRuns, detectors: Detectors) -> DriveRun:
    """The run that the drives make."""
    drives.start()
    drives.open(setup(detectors), Params(), "default")
    with drives._condition:
        assert drives._condition.wait_for(lambda: not drives.state.running, WAIT_S)
    assert drives.recording is not None
    run = drives.recording.runs.current
    assert run is not None
    return run


def is_equal(one: DriveRun, other: DriveRun) -> bool:
    objects = ([(index, records.tobytes()) for index, records in run.objects()] for run in (one, other))
    return repr(one.rows()) == repr(other.rows()) and next(objects) == next(objects)


@pytest.fixture(scope="module")
def looked(detectors: Detectors) -> OpenRecording:
    """A drive whose every frame the process has looked at."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(client, "_COMMAND", COMMAND)
        recording = opened(detectors)
        work = _Work(recording, 0, ComputeScheduler(), lambda: None)
        work.do()
        work.close()
    assert work.worth_waiting_s(FRAMES - 1) == 0.0
    return recording


@pytest.fixture(scope="module")
def seen(looked: OpenRecording) -> DetectionCache:
    """Its detections."""
    return looked._ask._cache


def test_a_run_on_what_was_looked_at_ahead_is_the_same(looked: OpenRecording, alone: DriveRun) -> None:
    assert all(looked.has_been_looked_at(index) for index in range(FRAMES))
    looked.runs.want(Params(), "default")
    run = looked.runs.current
    assert run is not None
    while not run.is_complete:
        looked.advance(run)
    assert is_equal(run, alone)


def test_frames_that_do_not_fit_are_handed_on(detectors: Detectors, seen: DetectionCache) -> None:
    recording = OpenRecording(setup(detectors), seen, 1)
    recording.inputs = InputStore(limit_bytes=0.0)
    progress, taken = threading.Semaphore(0), list[int]()
    work = _Work(recording, 0, ComputeScheduler(), progress.release)
    thread = threading.Thread(target=work.do)
    thread.start()
    while len(taken) < FRAMES:
        assert progress.acquire(timeout=WAIT_S)
        assert len(work._ready) <= _MOST_READY
        while (frame := work.take(len(taken))) is not None:
            assert frame.raw_boxes is not None
            taken.append(frame.index)
    thread.join(WAIT_S)
    work.close()
    assert taken == list(range(FRAMES))
    assert work.take(0) is None


def test_the_drives_use_it_and_end_it(drives: BackgroundRuns, detectors: Detectors, alone: DriveRun) -> None:
    assert is_equal(computed(drives, detectors), alone)
    drives.close()
    assert drives._ahead._work is None


@pytest.mark.parametrize("program", ["pass", "import sys; sys.stdin.read()"], ids=["dies", "never answers"])
def test_without_an_answer_the_run_goes_on_by_itself(
    drives: BackgroundRuns, detectors: Detectors, alone: DriveRun, monkeypatch: pytest.MonkeyPatch, program: str
) -> None:
    monkeypatch.setattr(client, "_COMMAND", (sys.executable, "-c", program))
    assert is_equal(computed(drives, detectors), alone)


def test_a_process_that_keeps_ending_is_not_started_for_ever(
    detectors: Detectors, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "_COMMAND", (sys.executable, "-c", "pass"))
    started: list[object] = []
    begin = client.NetworkProcess._start
    monkeypatch.setattr(client.NetworkProcess, "_start", lambda self: (started.append(self), begin(self)))
    drives, ended = BackgroundRuns(DetectionCache()), threading.Event()
    ahead, recording = LookAhead(ComputeScheduler(), ended.set), opened(detectors)
    for _ in range(6):
        ended.clear()
        before = len(started)
        ahead.begin(recording, 0, drives.watchdog)
        if ahead._work is not None:
            assert ended.wait(WAIT_S)
        assert len(started) - before in (0, 1)
    assert len(started) == 3
    ahead.end()


def test_a_process_that_hangs_is_ended_by_the_watchdog(
    drives: BackgroundRuns, detectors: Detectors, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "_COMMAND", (sys.executable, "-c", "import sys; sys.stdin.read()"))
    ended = threading.Event()
    ahead, recording = LookAhead(ComputeScheduler(), ended.set), opened(detectors)
    ahead.begin(recording, 0, drives.watchdog)
    work = ahead._work
    assert work is not None
    deadline = time.monotonic() + WAIT_S
    while not any(each.process is not None for each in list(drives.watchdog._hearts)):
        assert time.monotonic() < deadline
    found = drives.watchdog.look(time.monotonic() + 1e9)
    assert [each.doing for each in found] == ["opening in the background"]
    assert ended.wait(WAIT_S)
    assert work._process._process is not None
    assert work._process._process.returncode is not None
    assert ahead._work is None


def test_a_process_that_is_stopped_is_said_and_replaced(detectors: Detectors, monkeypatch: pytest.MonkeyPatch) -> None:
    """A network that takes its usual time at idle priority has half a minute; a process that was stopped has a
    second."""
    monkeypatch.setattr(client, "_COMMAND", (sys.executable, "-c", "import sys; sys.stdin.read()"))
    said, ended = list[str](), threading.Event()
    drives = BackgroundRuns(DetectionCache())
    ahead, recording = LookAhead(ComputeScheduler(), ended.set, said.append), opened(detectors)
    drives.watchdog.start()
    try:
        for number in (1, 2, 3):
            ended.clear()
            ahead.begin(recording, 0, drives.watchdog)
            work = ahead._work
            assert work is not None
            assert wait_until(lambda work=work: work._process._process is not None)
            assert work._process._process is not None
            work._process._process.send_signal(signal.SIGSTOP)
            assert ended.wait(WAIT_S)
            assert wait_until(lambda number=number: len(said) == number)
    finally:
        drives.watchdog.stop()
        ahead.end()
    assert all("the process for networks hung for" in text for text in said)
    assert [text.rpartition(")")[2] for text in said] == [
        " and was restarted",
        " and was restarted",
        "; the server runs the networks itself",
    ]


def test_few_frames_the_lidar_alone_and_what_is_kept_start_no_process(detectors: Detectors) -> None:
    recording = opened(detectors)
    assert _is_worth_it(recording, 0)
    assert not _is_worth_it(recording, 10)
    lidar = OpenRecording(replace(setup(detectors), sensors="lidar"), DetectionCache(), 1)
    assert not _is_worth_it(lidar, 0)


def test_detections_that_are_known_need_no_process(detectors: Detectors, seen: DetectionCache) -> None:
    work = _Work(OpenRecording(setup(detectors), seen, 2), 0, ComputeScheduler(), lambda: None)
    work.do()
    work.close()
    assert work._process._process is None


def test_what_cannot_be_read_is_left_to_the_run(drives: BackgroundRuns, detectors: Detectors) -> None:
    drives.start()
    drives.open(setup(detectors, Recording(count=FRAMES, broken=frozenset({7}))), Params(), "default")
    with drives._condition:
        assert drives._condition.wait_for(lambda: not drives.state.running, WAIT_S)
    assert (drives.state.phase, drives.state.done) == ("failed", 7)
    assert "frame 7 is not there" in drives.state.note


def test_no_thread_waits_for_a_drive_that_was_closed(detectors: Detectors, seen: DetectionCache) -> None:
    recording, full = OpenRecording(setup(detectors), seen, 3), threading.Event()
    recording.inputs = InputStore(limit_bytes=0.0)
    drives = BackgroundRuns(DetectionCache())
    ahead = LookAhead(ComputeScheduler(), full.set)
    ahead.begin(recording, 0, drives.watchdog)
    thread = next(each for each in threading.enumerate() if each.name == "cipv-look-ahead")
    assert full.wait(WAIT_S)
    ahead.end()
    thread.join(WAIT_S)
    assert not thread.is_alive()
    assert ahead.worth_waiting_s(recording, 0) == 0.0
