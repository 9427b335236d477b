"""The worker: playback, seeking, parameters on a paused frame, and what goes wrong."""

from __future__ import annotations

import pytest

from app.core.detection_cache import DetectionCache
from app.drive import compute_scheduler
from app.engine.seekable_pipeline import WARM_UP_FRAMES, SeekablePipeline
from app.engine.snapshot import Snapshot
from pipeline.detection import Detectors
from pipeline.params import Params, with_changes
from pipeline.step import State
from tests.app.engine.recording_helpers import CountingDetector, CountingLanes, Recording, SlowDetector
from tests.app.engine.running import WAIT_S, Start, at, body, played
from tests.app.waiting import wait_until


def test_opens_paused_on_the_first_frame_and_finds_the_car(start: Start):
    engine, recording, _ = start()
    shown = engine.snapshot
    assert (shown.index, shown.playing, shown.count) == (0, False, len(recording))
    assert shown.processed is not None
    assert shown.processed.result.cipv is not None
    assert shown.processed.result.cipv.distance_m == pytest.approx(30.0, abs=0.2)


@pytest.mark.parametrize("index", [1, WARM_UP_FRAMES, WARM_UP_FRAMES + 1, 25])
def test_a_seek_gives_the_bytes_of_playing_there_from_its_warm_up(start: Start, index: int):
    engine, recording, _ = start()
    engine.control.seek(index)
    tick = engine.wait_for(at(index), WAIT_S).processed
    assert tick is not None
    expected = played(recording, max(0, index - WARM_UP_FRAMES), index, Params())
    assert body(tick.result) == body(expected)


def test_a_frame_wanted_at_once_is_shown_after_two_reads_and_again_after_a_whole_warm_up(start: Start):
    engine, recording, detector = start()
    shown: list[tuple[bool, int, str]] = []
    recording.reads.clear()
    calls = detector.calls
    engine.listen(lambda s: shown.append((s.processed.whole, detector.calls - calls, body(s.processed.result))))
    engine.control.seek(20)
    engine.wait_for(at(20), WAIT_S)
    assert recording.reads == [19, 20, *range(10, 19)]
    # listeners hear of a state after those who wait for it
    assert wait_until(lambda: any(whole and looked for whole, looked, _ in shown))
    at_once, warmed = [one for one in dict.fromkeys(shown) if one[1]]
    assert at_once == (False, 1, body(played(recording, 19, 20, Params(), looked_from=20)))
    assert warmed == (True, 11, body(played(recording, 10, 20, Params())))
    engine.control.seek(22)
    seen = engine.wait_for(lambda s: s.index == 22, WAIT_S)
    assert seen.processed is not None
    assert not seen.processed.whole, "21 has not been read"
    engine.wait_for(at(22), WAIT_S)
    engine.control.seek(21)
    seen = engine.wait_for(lambda s: s.index == 21, WAIT_S)
    assert seen.processed is not None
    assert seen.processed.whole, "all that it needs is at hand"


def test_a_warm_up_that_fails_is_not_tried_again(start: Start):
    engine, recording, _ = start(Recording(broken=frozenset({12})))
    engine.control.seek(20)
    engine.wait_for(lambda s: any(n.level == "error" for n in s.notices), WAIT_S)
    reads = recording.reads.count(12)
    engine.control.change(loop=False)
    engine.wait_for(lambda s: not s.loop, WAIT_S)
    assert recording.reads.count(12) == reads == 1
    assert engine.snapshot.index == 20


def test_a_warm_up_gives_way_to_a_seek_also_while_a_network_runs_for_it(start: Start):
    detector = SlowDetector(slow_at=3)
    engine, _, _ = start(detector=detector)
    engine.control.seek(20)
    assert detector.slow.wait(WAIT_S), "it was asked at opening, for the frame at once, and for the warm-up"
    shown = engine.snapshot
    assert shown.index == 20
    assert shown.processed is not None
    assert not shown.processed.whole
    engine.control.seek(5)
    found = engine.wait_for(at(5), WAIT_S).processed
    assert found is not None
    assert body(found.result) == body(played(Recording(), 0, 5, Params()))
    assert detector.stopped == 1
    assert not any(notice.level == "error" for notice in engine.snapshot.notices)


def test_the_warm_up_waits_until_the_hand_rests(start: Start, monkeypatch: pytest.MonkeyPatch):
    engine, recording, _ = start()
    monkeypatch.setattr(compute_scheduler, "HAND_RESTS_S", 1e6)
    engine.control.seek(20)
    engine.wait_for(lambda s: s.index == 20, WAIT_S)
    recording.reads.clear()
    engine.control.change(loop=False)
    shown = engine.wait_for(lambda s: not s.loop, WAIT_S)
    assert shown.processed is not None
    assert not shown.processed.whole
    assert recording.reads == []
    monkeypatch.setattr(compute_scheduler, "HAND_RESTS_S", 0.0)
    engine.control.seek(20)
    engine.wait_for(at(20), WAIT_S)


def test_a_seek_depends_on_nothing_before_it(start: Start):
    engine, _, _ = start()
    bodies = []
    for detour in (3, 29, 0):
        engine.control.seek(detour)
        engine.wait_for(at(detour), WAIT_S)
        engine.control.seek(20)
        tick = engine.wait_for(at(20), WAIT_S).processed
        assert tick is not None
        bodies.append(body(tick.result))
    assert len(set(bodies)) == 1


def test_steps_go_through_every_frame_and_back(start: Start):
    engine, recording, _ = start()
    recording.reads.clear()
    engine.control.step(3)
    tick = engine.wait_for(at(3), WAIT_S).processed
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
    assert before.processed is not None
    assert after.processed is not None
    assert after.processed.before is before.processed.before
    assert after.processed.frame is before.processed.frame
    assert after.sequence == before.sequence + 1
    assert body(after.processed.result) != body(before.processed.result), (
        "the box scored 0.8 is below the new threshold"
    )
    revision = engine.control.set_params(Params())
    again = engine.wait_for(lambda s: s.params_revision == revision, WAIT_S)
    assert again.processed is not None
    assert body(again.processed.result) == body(before.processed.result)


def test_a_frame_that_was_seen_costs_no_network_again(start: Start):
    engine, _, detector = start()
    for index in (12, 0, 12):
        engine.control.seek(index)
        engine.wait_for(at(index), WAIT_S)
    assert detector.calls == len({0, *range(2, 13)})


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
    shown = engine.wait_for(lambda s: s.params.cluster.tolerance_m == 0.4 and s.processed is not None, WAIT_S)
    assert shown.index == 0
    assert shown.processed is not None
    assert shown.processed.params is shown.params, "run again with it"
    recording.gate.set()
    engine.wait_for(lambda s: s.index > 0, WAIT_S)


def test_a_frame_that_cannot_be_read_is_said_and_the_worker_goes_on(start: Start):
    engine, _, _ = start(Recording(broken=frozenset({7})))
    engine.control.seek(7)
    shown = engine.wait_for(lambda s: any(n.level == "error" for n in s.notices), WAIT_S)
    assert "frame 7 is not there" in shown.notices[-1].text
    assert not shown.playing
    engine.control.seek(2)
    engine.wait_for(at(2), WAIT_S)
    assert engine.alive


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


def test_a_frame_wanted_at_once_does_not_wait_for_lanes_and_says_so():
    lanes, known = CountingLanes(), []
    detectors = Detectors(CountingDetector(), lanes, lanes_every=3)
    pipeline = SeekablePipeline(
        Recording(), detectors, DetectionCache(), "both", lambda index, params: State() if known else None
    )
    hurried = pipeline.seek(20, Params(), at_once=True)
    assert hurried is not None
    assert (lanes.calls, hurried.whole, hurried.exact) == (0, False, False)
    assert hurried.frame.raw_lanes is None
    known.append(20)
    assert not pipeline.can_be_exact(), "run again it would be without lanes again"
    again = pipeline.rerun(Params())
    assert again is not None
    assert (lanes.calls, again.whole, again.exact) == (0, False, False)
    hurried = pipeline.seek(21, Params(), at_once=True)
    assert hurried is not None
    assert (lanes.calls, hurried.whole, hurried.exact) == (0, False, False), "21 is one for lanes"
    whole = pipeline.seek(21, Params())
    assert whole is not None
    assert (lanes.calls, whole.whole, whole.exact) == (1, True, True)
    assert whole.frame.raw_lanes is not None
    known.clear()
    for index, seen in ((22, 1), (21, 1)):
        pipeline.seek(index, Params(), at_once=True)
        assert lanes.calls == seen
    assert pipeline.shown is not None
    assert pipeline.shown.frame.raw_lanes is not None, "known lanes are used"


def test_the_first_frame_waits_for_lanes_so_that_what_plays_from_it_is_exact(start: Start):
    lanes = CountingLanes()
    engine, _, _ = start(open_lanes=lambda _: lanes)
    shown = engine.snapshot.processed
    assert shown is not None
    assert (lanes.calls, shown.whole, shown.exact) == (1, True, True)


def test_a_line_abandons_a_seek_and_keeps_its_tick():
    pipeline = SeekablePipeline(Recording(), Detectors(CountingDetector()), DetectionCache(), "both")
    first = pipeline.seek(4, Params())
    assert pipeline.seek(20, Params(), superseded=lambda: True) is None
    assert pipeline.shown is first
