"""The worker: playback, seeking, parameters on a paused frame, and what goes wrong."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

import app.engine as engine_module
from app.engine import Engine
from app.line import WARM_UP_FRAMES, DetectionCache, Line
from app.snapshot import Snapshot
from pipeline.params import Params, with_changes
from pipeline.progress import Progress
from pipeline.results import to_json
from pipeline.run import Detectors
from pipeline.sources.base import Source
from pipeline.step import State, step
from pipeline.types import Result
from pipeline.vision.runtime import DetectorMissing
from tests.app.recording import CountingDetector, Recording, opener

WAIT_S = 60.0
Start = Callable[..., tuple[Engine, Recording, CountingDetector]]


@pytest.fixture
def start() -> Iterator[Start]:
    """An engine on a recording, showing its first frame, paused."""
    with ExitStack() as stack:

        def begin(recording: Recording | None = None, **options) -> tuple[Engine, Recording, CountingDetector]:
            recording, detector = recording or Recording(), CountingDetector()
            engine = Engine(opener(recording), lambda _: detector, Params(), uri=recording.uri, **options)
            engine.start()
            stack.callback(engine.stop)
            stack.callback(recording.gate.set)
            engine.wait_for(lambda s: s.tick is not None, WAIT_S)
            return engine, recording, detector

        yield begin


def body(result: Result) -> str:
    """A result's bytes, times of this machine apart."""
    plain = to_json(result)
    del plain["timing_ms"]
    return json.dumps(plain)


def at(index: int) -> Callable[[Snapshot], bool]:
    """The frame is shown, after a whole warm-up."""
    return lambda s: s.tick is not None and s.index == index and s.tick.warmed


def played(recording: Recording, first: int, last: int, params: Params) -> Result:
    """What the plain line says at ``last``, run from a fresh state at ``first``."""
    detector, state = CountingDetector(), State()
    for index in range(first, last + 1):
        frame = recording.frame(index)
        assert frame.picture is not None
        boxes = detector.detect(frame.picture.bgr)
        state, result = step(state, type(frame)(**{**vars(frame), "raw_boxes": boxes}), params)
    return result


class Slowly:
    """Opens "test:long" word by word, each when the test lets it; anything else at once."""

    def __init__(self) -> None:
        self.goes_on = threading.Semaphore(0)
        self.given_up = threading.Event()

    def __call__(self, uri: str, /, *, progress: Progress) -> Recording:
        if uri == "test:long":
            try:
                for done in range(0, 101, 25):
                    progress(done, 100)
                    assert self.goes_on.acquire(timeout=WAIT_S)
            except BaseException:
                self.given_up.set()
                raise
        return Recording(uri)


@pytest.fixture
def slowly(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Engine, Slowly]]:
    monkeypatch.setattr(engine_module, "_TELL_EVERY_S", 0.0)
    opens = Slowly()
    engine = Engine(opens, lambda _: CountingDetector(), Params(), uri="test:car")
    engine.start()
    engine.wait_for(lambda s: s.uri == "test:car", WAIT_S)
    yield engine, opens
    opens.goes_on.release(10)
    engine.stop()


def test_what_takes_long_to_open_says_how_far_it_is(slowly: tuple[Engine, Slowly]):
    engine, opens = slowly
    engine.control.change(uri="test:long")
    for percent in (0, 25, 50):
        shown = engine.wait_for(lambda s, percent=percent: s.busy == f"Opening test:long … {percent} %", WAIT_S)
        assert shown.uri == "test:car", "what is open stays until then"
        opens.goes_on.release()
    opens.goes_on.release(2)
    assert engine.wait_for(lambda s: s.uri == "test:long", WAIT_S).busy is None


def test_what_takes_long_to_open_is_given_up_for_something_else(slowly: tuple[Engine, Slowly]):
    engine, opens = slowly
    engine.control.change(uri="test:long")
    engine.wait_for(lambda s: s.busy == "Opening test:long … 0 %", WAIT_S)
    engine.control.change(uri="test:other")
    opens.goes_on.release()
    assert opens.given_up.wait(WAIT_S)
    shown = engine.wait_for(lambda s: s.uri == "test:other" and s.tick is not None, WAIT_S)
    assert (shown.busy, [n for n in shown.notices if n.level == "error"]) == (None, [])


def test_opens_paused_on_the_first_frame_and_finds_the_car(start: Start):
    engine, recording, _ = start()
    shown = engine.snapshot
    assert (shown.index, shown.playing, shown.count) == (0, False, len(recording))
    assert shown.tick is not None
    assert shown.tick.result.cipv is not None
    assert shown.tick.result.cipv.distance_m == pytest.approx(30.0, abs=0.2)


@pytest.mark.parametrize("index", [1, WARM_UP_FRAMES, WARM_UP_FRAMES + 1, 25])
def test_a_seek_gives_the_bytes_of_playing_there_from_its_warm_up(start: Start, index: int):
    engine, recording, _ = start()
    engine.control.seek(index)
    tick = engine.wait_for(at(index), WAIT_S).tick
    assert tick is not None
    expected = played(recording, max(0, index - WARM_UP_FRAMES), index, Params())
    assert body(tick.result) == body(expected)


def test_a_frame_wanted_at_once_is_shown_after_two_reads_and_again_after_a_whole_warm_up(start: Start):
    engine, recording, detector = start()
    shown: list[tuple[bool, int, str]] = []
    recording.reads.clear()
    calls = detector.calls
    engine.listen(lambda s: shown.append((s.tick.warmed, detector.calls - calls, body(s.tick.result))))
    engine.control.seek(20)
    engine.wait_for(at(20), WAIT_S)
    assert recording.reads == [19, 20, *range(10, 19)]
    at_once, warmed = [one for one in dict.fromkeys(shown) if one[1]]
    assert at_once == (False, 2, body(played(recording, 19, 20, Params())))
    assert warmed == (True, 11, body(played(recording, 10, 20, Params())))
    engine.control.seek(22)
    seen = engine.wait_for(lambda s: s.index == 22, WAIT_S)
    assert seen.tick is not None
    assert not seen.tick.warmed, "21 has not been read"
    engine.wait_for(at(22), WAIT_S)
    engine.control.seek(21)
    seen = engine.wait_for(lambda s: s.index == 21, WAIT_S)
    assert seen.tick is not None
    assert seen.tick.warmed, "all that it needs is at hand"


def test_a_warm_up_that_fails_is_not_tried_again(start: Start):
    engine, recording, _ = start(Recording(broken=frozenset({12})))
    engine.control.seek(20)
    engine.wait_for(lambda s: any(n.level == "error" for n in s.notices), WAIT_S)
    reads = recording.reads.count(12)
    engine.control.change(loop=False)
    engine.wait_for(lambda s: not s.loop, WAIT_S)
    assert recording.reads.count(12) == reads == 1
    assert engine.snapshot.index == 20


def test_a_seek_depends_on_nothing_before_it(start: Start):
    engine, _, _ = start()
    bodies = []
    for detour in (3, 29, 0):
        engine.control.seek(detour)
        engine.wait_for(at(detour), WAIT_S)
        engine.control.seek(20)
        tick = engine.wait_for(at(20), WAIT_S).tick
        assert tick is not None
        bodies.append(body(tick.result))
    assert len(set(bodies)) == 1


def test_steps_go_through_every_frame_and_back(start: Start):
    engine, recording, _ = start()
    recording.reads.clear()
    engine.control.step(3)
    tick = engine.wait_for(at(3), WAIT_S).tick
    assert recording.reads == [1, 2, 3]
    assert tick is not None
    assert body(tick.result) == body(played(recording, 0, 3, Params()))
    engine.control.step(-1)
    engine.wait_for(at(2), WAIT_S)
    engine.control.step(-99)
    engine.wait_for(at(0), WAIT_S)


def test_a_step_beyond_the_end_stays_on_the_last_frame(start: Start):
    engine, recording, _ = start()
    last = len(recording) - 1
    engine.control.seek(10**6)
    engine.wait_for(at(last), WAIT_S)
    engine.control.seek(last - 2)
    engine.wait_for(at(last - 2), WAIT_S)
    engine.control.step(5)
    engine.wait_for(at(last), WAIT_S)


def test_a_parameter_on_a_paused_frame_runs_neither_network_nor_reading(start: Start):
    engine, recording, detector = start()
    engine.control.seek(15)
    before = engine.wait_for(at(15), WAIT_S)
    calls, reads = detector.calls, len(recording.reads)
    revision = engine.control.set_params(with_changes(Params(), {"detection.min_score": 0.9}))
    after = engine.wait_for(lambda s: s.params_revision == revision, WAIT_S)
    assert (detector.calls, len(recording.reads)) == (calls, reads)
    assert before.tick is not None
    assert after.tick is not None
    assert after.tick.before is before.tick.before
    assert after.tick.frame is before.tick.frame
    assert after.sequence == before.sequence + 1
    assert body(after.tick.result) != body(before.tick.result), "the box scored 0.8 is below the new threshold"
    revision = engine.control.set_params(Params())
    again = engine.wait_for(lambda s: s.params_revision == revision, WAIT_S)
    assert again.tick is not None
    assert body(again.tick.result) == body(before.tick.result)


def test_a_frame_that_was_seen_costs_no_network_again(start: Start):
    engine, _, detector = start()
    for index in (12, 0, 12):
        engine.control.seek(index)
        engine.wait_for(at(index), WAIT_S)
    assert detector.calls == len({0, *range(2, 13)})


def test_reopening_costs_no_network_either(start: Start):
    engine, recording, detector = start()
    engine.control.seek(5)
    engine.wait_for(at(5), WAIT_S)
    calls = detector.calls
    engine.control.change(uri=recording.uri)
    engine.wait_for(at(0), WAIT_S)
    assert detector.calls == calls


def test_a_recording_replaced_under_its_name_is_looked_at_anew(tmp_path: Path):
    file = tmp_path / "my.yaml"
    file.write_text("before")
    cache, detector, source = DetectionCache(), CountingDetector(), Recording(f"sim:{file}")
    for calls in (1, 1):
        Line(source, Detectors(detector), cache, "both").seek(0, Params())
        assert detector.calls == calls
    file.write_text("and after")
    Line(source, Detectors(detector), cache, "both").seek(0, Params())
    assert detector.calls == 2


def test_an_overtaken_seek_is_dropped_on_the_way(start: Start):
    engine, recording, _ = start()
    shown: list[int] = []
    engine.listen(lambda s: shown.append(s.index))
    recording.reads.clear()
    recording.reading.clear()
    recording.gate.clear()
    engine.control.seek(20)
    assert recording.reading.wait(WAIT_S)
    engine.control.seek(22)
    engine.control.seek(24)
    recording.gate.set()
    engine.wait_for(at(24), WAIT_S)
    assert recording.reads[:2] == [19, 23], "one frame of the first seek was read, then the last seek began"
    assert not {20, 22} & set(shown)


def test_playing_shows_the_frames_in_order_and_stops_at_the_end(start: Start):
    engine, recording, _ = start()
    shown: list[int] = []
    engine.listen(lambda s: shown.append(s.index))
    engine.control.change(playing=True, loop=False, speed=10.0)
    end = engine.wait_for(lambda s: not s.playing and s.index == len(recording) - 1, WAIT_S)
    assert shown == sorted(shown)
    assert len(set(shown)) + end.skipped >= len(recording) - 1


def test_playing_in_a_loop_begins_again(start: Start):
    engine, _, _ = start(Recording(count=4))
    engine.control.change(playing=True, loop=True, speed=10.0)
    engine.wait_for(at(3), WAIT_S)
    assert engine.wait_for(at(0), WAIT_S).playing


def test_a_parameter_is_answered_while_the_next_frame_is_still_being_read(start: Start):
    engine, recording, _ = start()
    recording.gate.clear()
    recording.reading.clear()
    engine.control.change(playing=True)
    assert recording.reading.wait(WAIT_S), "it reads the next frame"
    engine.control.change_params({"cluster.tolerance_m": 0.4})
    shown = engine.wait_for(lambda s: s.params.cluster.tolerance_m == 0.4 and s.tick is not None, WAIT_S)
    assert shown.index == 0
    assert shown.tick is not None
    assert shown.tick.params is shown.params, "run again with it"
    recording.gate.set()
    engine.wait_for(lambda s: s.index > 0, WAIT_S)


def test_a_recording_that_cannot_be_opened_leaves_the_old_one(start: Start):
    engine, recording, _ = start()
    engine.control.change(uri="test:nowhere")
    shown = engine.wait_for(lambda s: any(n.level == "error" for n in s.notices), WAIT_S)
    assert "test:nowhere: no such recording" in [n.text for n in shown.notices]
    assert shown.uri == recording.uri
    engine.control.change(loop=False)
    later = engine.wait_for(lambda s: not s.loop, WAIT_S)
    assert later.notices == shown.notices, "it stays said"
    assert later.sequence == shown.sequence, "and nothing was run again"
    engine.control.seek(3)
    shown = engine.wait_for(at(3), WAIT_S)
    assert not any(n.level == "error" for n in shown.notices), "the next frame takes the complaint away"


def test_a_frame_that_cannot_be_read_is_said_and_the_worker_goes_on(start: Start):
    engine, _, _ = start(Recording(broken=frozenset({7})))
    engine.control.seek(7)
    shown = engine.wait_for(lambda s: any(n.level == "error" for n in s.notices), WAIT_S)
    assert "frame 7 is not there" in shown.notices[-1].text
    assert not shown.playing
    engine.control.seek(2)
    engine.wait_for(at(2), WAIT_S)
    assert engine.alive


def test_without_a_detector_lidar_goes_on_alone_and_the_page_is_told_the_remedy():
    def missing(_: Source) -> CountingDetector:
        raise DetectorMissing("No detector is installed: run `cipv models pull yolox_nano`.")

    engine = Engine(opener(Recording()), missing, Params(), uri="test:car")
    engine.start()
    try:
        shown = engine.wait_for(lambda s: s.tick is not None, WAIT_S)
        assert any("cipv models pull" in n.text and n.level == "warning" for n in shown.notices)
        assert shown.tick is not None
        assert {item.source for item in shown.tick.result.objects} == {"L"}
    finally:
        engine.stop()


def test_what_a_detector_has_to_say_is_said_on_the_page():
    network = CountingDetector(notes=("it knows simulated cars only",))
    engine = Engine(opener(Recording()), lambda _: network, Params(), uri="test:car")
    engine.start()
    try:
        shown = engine.wait_for(lambda s: s.tick is not None, WAIT_S)
        assert [n.text for n in shown.notices] == [*Recording().notes, "it knows simulated cars only"]
    finally:
        engine.stop()


def test_the_detector_is_asked_for_again_where_pictures_are_drawn():
    """A network for real pictures is not the one for the simulator, even when the pictures are equally large."""
    asked: list[str] = []

    def open_detector(source: Source) -> CountingDetector:
        asked.append(source.uri)
        return CountingDetector()

    recordings = [Recording(uri=uri) for uri in ("test:car", "test:other", "sim:car")]
    engine = Engine(opener(*recordings), open_detector, Params(), uri="test:car")
    engine.start()
    try:
        for uri in ("test:car", "test:other", "sim:car", "test:car"):
            engine.control.change(uri=uri)
            engine.wait_for(lambda s, uri=uri: s.uri == uri and s.tick is not None, WAIT_S)
        assert asked == ["test:car", "sim:car"]
    finally:
        engine.stop()


@pytest.mark.parametrize(("sensors", "sources"), [("lidar", {"L"}), ("camera", {"V"}), ("both", {"VL"})])
def test_sensors_can_be_taken_away(start: Start, sensors: str, sources: set[str]):
    engine, _, detector = start(sensors=sensors)
    tick = engine.snapshot.tick
    assert tick is not None
    assert {item.source for item in tick.result.objects} == sources
    assert tick.frame.picture is not None, "people still want to see the picture"
    assert (detector.calls == 0) == (sensors == "lidar")


def test_a_view_that_fails_takes_nothing_with_it(start: Start, caplog: pytest.LogCaptureFixture):
    engine, _, _ = start()
    told: list[int] = []

    def broken(_: Snapshot) -> None:
        raise ValueError("broken view")

    engine.listen(broken)
    engine.listen(lambda s: told.append(s.index))
    for index in (2, 3):
        engine.control.seek(index)
        engine.wait_for(at(index), WAIT_S)
    engine.stop()
    assert told[-1] == 3
    assert "broken view" in caplog.text


def test_a_line_abandons_a_seek_and_keeps_its_tick():
    line = Line(Recording(), Detectors(CountingDetector()), DetectionCache(), "both")
    first = line.seek(4, Params())
    assert line.seek(20, Params(), superseded=lambda: True) is None
    assert line.tick is first
