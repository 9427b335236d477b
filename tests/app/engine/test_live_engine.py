"""Live sensors in the engine: shown as they come, held while paused, and now again when playing goes on."""

from __future__ import annotations

import gc
import threading
import weakref
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.engine.engine import Engine
from app.engine.live_pipeline import LivePipeline
from app.engine.session_recording import SessionRecorder
from app.engine.snapshot import Snapshot
from pipeline.common.progress import Progress
from pipeline.detection import Detectors
from pipeline.params import Params, SyncParams, with_changes
from pipeline.recording.session.source import SessionSource
from pipeline.types import U8, CameraCalibration, Frame, GnssFix, RawBoxes, RawLanes, StreamHealth
from pipeline.types.camera_shot import Shot
from pipeline.types.source import AnySource, SourceError, Tap
from tests.app.engine.recording_helpers import CountingDetector, Recording
from tests.app.waiting import wait_until

WAIT_S = 180.0


class Sensors:
    """Live sensors whose ticks come from the test: frames of a recording, only the newest."""

    rate_hz = 10.0

    def __init__(self, uri: str = "live:test") -> None:
        self.uri, self.title, self.notes = uri, "a car", ("no own speed",)
        self.camera: CameraCalibration | None = None
        self.dropped = 0
        self.is_open: bool | None = None
        self.asked_with: SyncParams | None = None
        self.state = "ok"
        self._recording = Recording()
        self._came = threading.Condition()
        self._newest: Frame | None = None
        self.given = 0
        self.tapped: Tap | None = None

    def give(self, index: int) -> None:
        with self._came:
            self.dropped += self._newest is not None
            self._newest, self.given = self._recording.frame(index), index
            self._came.notify_all()

    def start(self) -> None:
        self.is_open = True

    def close(self) -> None:
        self.is_open = False

    def next(self, timeout_s: float, params: SyncParams | None = None) -> Frame | None:
        self.asked_with = params
        with self._came:
            self._came.wait_for(lambda: self._newest is not None, timeout_s)
            newest, self._newest = self._newest, None
            return replace(newest, streams=self.health()) if newest is not None else None

    def upcoming(self, params: SyncParams | None = None) -> Frame | None:
        return None

    def now_ns(self) -> int:
        return 10**18 + self._recording.t_ns(self.given)

    def tap(self, tap: Tap | None) -> None:
        self.tapped = tap

    def health(self) -> tuple[StreamHealth, ...]:
        return (StreamHealth("lidar", self.state, 10.0, 60.0, 1.0, 0),)  # type: ignore[arg-type]


class NoLanes:
    """Finds no lanes, and counts its calls."""

    name, notes, calls = "none", (), 0

    def detect(self, bgr: U8) -> RawLanes:
        self.calls += 1
        return RawLanes(self.name, np.zeros((0, 2), np.float32), np.zeros(0, np.float32), np.zeros(0, np.int32))


Start = Callable[..., tuple[Engine, Sensors, CountingDetector]]


@pytest.fixture
def start() -> Iterator[Start]:
    engines: list[Engine] = []

    def begin(desk: SessionRecorder | None = None) -> tuple[Engine, Sensors, CountingDetector]:
        sensors, detector = Sensors(), CountingDetector()

        def open_source(uri: str, *, progress: Progress) -> AnySource:
            if uri == sensors.uri:
                return sensors
            if uri == "test:car":
                return Recording()
            raise SourceError(f"{uri}: no such thing")

        engine = Engine(open_source, lambda _: detector, Params(), uri=sensors.uri, playing=True, recorder=desk)
        engines.append(engine)
        engine.start()
        engine.wait_for(lambda s: s.live, WAIT_S)
        return engine, sensors, detector

    yield begin
    for engine in engines:
        engine.stop()


def shows(index: int) -> Callable[[Snapshot], bool]:
    return lambda s: s.processed is not None and s.index == index


def shown_after(engine: Engine, sensors: Sensors, index: int) -> Snapshot:
    sensors.give(index)
    return engine.wait_for(shows(index), WAIT_S)


def test_ticks_are_shown_as_they_come(start: Start) -> None:
    engine, sensors, _ = start()
    for index in range(4):
        shown = shown_after(engine, sensors, index)
    state = shown.state_json()
    assert (state["live"], state["playing"], state["count"], state["provisional"]) == (True, True, 0, False)
    assert state["time_s"] == pytest.approx(0.3)
    assert shown.processed is not None
    assert {item.source for item in shown.processed.result.objects} == {"VL"}
    assert shown.processed.detect_ms > 0.0
    assert sensors.asked_with == Params().sync
    assert [notice.text for notice in shown.notices] == ["no own speed"]


def test_paused_the_frame_is_held_while_the_line_goes_on_and_playing_jumps_to_now(start: Start) -> None:
    engine, sensors, detector = start()
    shown_after(engine, sensors, 0)
    engine.control.change(playing=False)
    engine.wait_for(lambda s: not s.playing, WAIT_S)
    for index in (1, 2, 3):
        calls = detector.calls
        sensors.give(index)
        assert wait_until(lambda calls=calls: detector.calls > calls)
    assert engine.snapshot.index == 0, "held"
    engine.control.change(playing=True)
    now = engine.wait_for(shows(3), WAIT_S)
    assert now.processed is not None
    assert max(item.hits for item in now.processed.result.objects) == 4, "the pipeline ran on every tick"


def test_a_parameter_runs_the_held_frame_again_without_a_network(start: Start) -> None:
    engine, sensors, detector = start()
    shown_after(engine, sensors, 0)
    shown_after(engine, sensors, 1)
    engine.control.change(playing=False)
    held = engine.wait_for(lambda s: not s.playing, WAIT_S)
    calls = detector.calls
    revision = engine.control.set_params(with_changes(Params(), {"detection.min_score": 0.9}))
    again = engine.wait_for(lambda s: s.params_revision == revision and s.sequence > held.sequence, WAIT_S)
    assert again.index == held.index
    assert detector.calls == calls
    assert again.processed is not None
    assert held.processed is not None
    assert again.processed.before is held.processed.before
    assert {item.seen_by for item in held.processed.result.objects} == {"VL"}
    assert {item.seen_by for item in again.processed.result.objects} == {"L"}


def test_sensors_offsets_reach_the_sensors_while_they_run(start: Start) -> None:
    engine, sensors, _ = start()
    engine.control.change_params({"sync.camera_offset_ms": -40.0})
    assert wait_until(lambda: sensors.asked_with is not None and sensors.asked_with.camera_offset_ms == -40.0)


def test_how_sensors_do_is_told_while_none_ticks(start: Start) -> None:
    engine, sensors, _ = start()
    sensors.state = "silent"
    shown = engine.wait_for(lambda s: any(each.state == "silent" for each in s.streams), WAIT_S)
    assert shown.state_json()["streams"]["lidar"]["state"] == "silent"
    said = "Waiting for sensors: lidar silent"
    engine.wait_for(lambda s: any(notice.text == said for notice in s.notices), WAIT_S)
    sensors.state = "ok"
    shown_after(engine, sensors, 0)
    engine.wait_for(lambda s: all(notice.text != said for notice in s.notices), WAIT_S)


def test_nobody_waits_for_sensors_while_a_tick_takes_long_or_after_its_line_was_replaced(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The notice stood for good where the engine had hung, and came and went on a busy machine."""
    clock_s = [0.0]
    monkeypatch.setattr("app.engine.live_pipeline.monotonic", lambda: clock_s[0])

    class Slow(CountingDetector):
        def detect(self, bgr: U8) -> RawBoxes:
            clock_s[0] += 5.0
            return super().detect(bgr)

    line = LivePipeline(Sensors(), Detectors(Slow()), "both")
    line.run(Recording().frame(0), Params())
    assert line.with_silence(()) == ()
    clock_s[0] += 2.0
    notices = line.with_silence(())
    assert [each.text for each in notices] == ["Waiting for sensors: no data yet"]
    assert line.successor(Detectors()).with_silence(notices) == ()


def test_what_the_line_left_out_is_counted(start: Start) -> None:
    engine, sensors, _ = start()
    shown_after(engine, sensors, 0)
    sensors.dropped += 3
    assert shown_after(engine, sensors, 5).skipped >= 3


def test_a_session_of_them_is_on_their_own_steady_timeline(start: Start, tmp_path: Path) -> None:
    engine, sensors, _ = start(SessionRecorder(tmp_path))
    engine.recorder.start(engine.source)
    for index in range(3):
        shown_after(engine, sensors, index)
    state = engine.recorder.stop()
    assert state is not None
    session = SessionSource("a", str(state.file))
    times_ns = [Recording().t_ns(index) for index in range(3)]
    assert [session.log_time_ns(index) - 10**18 for index in range(3)] == times_ns
    assert [session.t_ns(index) for index in range(3)] == times_ns


def test_what_comes_between_ticks_is_recorded_until_the_end(start: Start, tmp_path: Path) -> None:
    """``now_ns`` of these sensors is the time of their ticks plus 10¹⁸."""
    engine, sensors, _ = start(SessionRecorder(tmp_path))
    engine.recorder.start(engine.source)
    tap = sensors.tapped
    assert tap is not None
    shown = Recording().frame(0)
    assert shown.image is not None
    assert shown.sweep is not None
    for step in range(3):
        tap.image(Shot(pixels=shown.image.bgr), shown.t_ns + step, 10**18 + step)
        tap.sweep(replace(shown.sweep, points=shown.sweep.points + step), 10**18 + step)
        tap.fix(GnssFix(shown.t_ns + step, 48.0, 9.0, 300.0, None, 0.0, "single", 4.0), 10**18 + step)
    shown_after(engine, sensors, 1)
    state = engine.recorder.stop()
    assert sensors.tapped is None
    assert state is not None
    assert (state.frames, state.dropped) == (1, 0)
    session = SessionSource("a", str(state.file))
    counts = {
        topic: len(list(session.file.messages((topic,)))) for topic in ("/camera/image", "/lidar/points", "/gnss")
    }
    assert counts == {"/camera/image": 4, "/lidar/points": 4, "/gnss": 3}


def test_lanes_are_looked_for_as_often_as_the_line_runs_whatever_is_dropped() -> None:
    sensors, lanes = Sensors(), NoLanes()
    pipeline = LivePipeline(sensors, Detectors(None, lanes, lanes_every=3), "both")
    for index in range(1, 22, 3):
        sensors.give(index)
        came = pipeline.wait(Params(), WAIT_S)
        assert came is not None
        pipeline.run(came, Params())
    assert lanes.calls == 3


def test_opening_a_recording_gives_the_sensors_back_and_the_other_way_round(start: Start) -> None:
    engine, sensors, _ = start()
    shown_after(engine, sensors, 0)
    engine.control.change(uri="test:car")
    recording = engine.wait_for(lambda s: s.uri == "test:car" and s.processed is not None, WAIT_S)
    assert sensors.is_open is False
    assert (recording.live, recording.count) == (False, 30)
    engine.control.change(uri="live:test")
    engine.wait_for(lambda s: s.live, WAIT_S)
    assert sensors.is_open is True
    assert shown_after(engine, sensors, 3).playing


def test_with_sensors_open_nothing_is_kept_of_the_recording_before(start: Start) -> None:
    engine, sensors, _ = start()
    engine.control.change(uri="test:car", playing=True)
    engine.wait_for(lambda s: s.uri == "test:car" and s.index > 0, WAIT_S)
    line = weakref.ref(engine._player)  # type: ignore[type-var]
    assert line() is not None
    engine.control.change(uri="live:test")
    engine.wait_for(lambda s: s.live, WAIT_S)
    assert wait_until(lambda: gc.collect() >= 0 and line() is None)
    shown_after(engine, sensors, 3)


def test_seeking_and_stepping_mean_nothing_to_sensors(start: Start) -> None:
    engine, sensors, _ = start()
    shown_after(engine, sensors, 0)
    engine.control.seek(7)
    engine.control.step(2)
    engine.control.change(playing=True)
    assert shown_after(engine, sensors, 1).index == 1


def test_ending_the_engine_gives_the_sensors_back(start: Start) -> None:
    engine, sensors, _ = start()
    engine.stop()
    assert sensors.is_open is False
