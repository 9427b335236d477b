"""Whole drives in the background: the newest request first, saved runs, and failures."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import pytest

from app.core.detection_cache import DetectionCache
from app.core.playback_clock import timeline_s
from app.drive.background_runs import BackgroundRuns
from app.drive.frame_inputs import InputStore, without_pixels
from app.drive.full_run import DriveRun, digest
from app.drive.open_recording import OpenRecording, RunSetup
from app.drive.run_registry import MOST_KEPT, MOST_UNKEPT, NoSuchRun, RunRefused, RunRegistry
from pipeline.common.files.user_files import Overloaded
from pipeline.common.watchdog import Stuck, Watchdog
from pipeline.detection import Detectors
from pipeline.params import Params, with_changes
from pipeline.run import Sensors, run
from pipeline.step import State, step
from pipeline.types import U8, Frame, RawBoxes
from tests.app.engine.recording_helpers import CountingDetector, Recording, SlowDetector

WAIT_S = 180.0


def with_hits(hits: int) -> Params:
    return with_changes(Params(), {"cipv.confirm_hits": hits})


def setup(recording: Recording, detector: CountingDetector | None = None) -> RunSetup:
    times = timeline_s([recording.t_ns(i) for i in range(len(recording))], recording.rate_hz)
    return RunSetup(recording, times, Detectors(detector or CountingDetector()), "both")


def opened(recording: Recording, detector: CountingDetector | None = None) -> OpenRecording:
    return OpenRecording(setup(recording, detector), DetectionCache(), 1)


@pytest.fixture
def drives() -> Iterator[BackgroundRuns]:
    drives = BackgroundRuns(DetectionCache())
    yield drives
    drives.stop()


def wait_done(drives: BackgroundRuns) -> DriveRun:
    """The most recently requested run, once it is done; the drives signal this themselves."""
    assert drives.recording is not None
    with drives._condition:
        assert drives._condition.wait_for(lambda: not drives.state.running, WAIT_S)
    run_ = drives.recording.runs.current
    assert run_ is not None
    return run_


def completed(recording: OpenRecording, params: Params) -> DriveRun:
    """The run with these parameters, computed to its end in this thread."""
    recording.runs.want(params, "default")
    run_ = recording.runs.current
    assert run_ is not None
    while not run_.is_complete:
        recording.advance(run_)
    return run_


def test_a_run_keeps_what_the_plain_line_says():
    of = completed(opened(Recording()), Params())
    results = [result for _, result in run(Recording(), Params(), Detectors(CountingDetector()))]
    leads = [result.cipv for result in results]
    rows = of.rows()
    assert [row.cipv_id for row in rows] == [lead.id if lead else None for lead in leads]
    assert [row.distance_m for row in rows] == [lead.distance_m if lead else None for lead in leads]
    assert [row.ttc_s for row in rows] == [lead.ttc_s if lead else None for lead in leads]
    assert [len(records) for _, records in of.objects()] == [len(result.objects) for result in results]
    assert of.rows(25) == rows[25:]


@pytest.mark.parametrize(("sensors", "before"), [("both", False), ("camera", False), ("lidar", True)])
def test_where_no_detector_is_asked_nothing_is_waited_for(sensors: Sensors, before: bool):
    recording = OpenRecording(replace(setup(Recording()), sensors=sensors), DetectionCache(), 1)
    assert recording.has_been_looked_at(0) is before
    recording.frame(0)
    assert recording.has_been_looked_at(0)


def test_states_are_those_of_the_pass_at_every_frame_also_when_few_are_kept():
    recording = opened(Recording())
    recording.runs.want(Params(), "default")
    of = recording.runs.current
    assert of is not None
    of._every = 4
    states = [State()]
    while not of.is_complete:
        states.append(step(states[-1], recording.input(of.done), Params())[0])
        recording.advance(of)
    for index in range(31):
        found = recording.state_before(index, Params())
        assert repr(found) == repr(states[index])
    assert recording.state_before(31, Params()) is None
    assert recording.state_before(3, with_hits(9)) is None
    assert repr(recording.state_from_start(7, with_hits(9))) != "", "computed where no run has come"


def test_another_run_asks_neither_source_nor_network():
    source, detector = Recording(), CountingDetector()
    recording = opened(source, detector)
    for hits in (3, 4):
        completed(recording, with_hits(hits))
        assert (len(source.reads), detector.calls) == (30, 30)


def test_the_newest_wish_wins_and_the_base_is_finished_after_it(drives: BackgroundRuns):
    drives.start()
    with drives.turn.foreground():
        drives.open(setup(Recording()), with_hits(3), "default")
        for hits in (4, 5):
            drives.want(with_hits(hits), "default")
    newest = wait_done(drives)
    assert newest.params == with_hits(5)
    assert newest.is_complete
    recording = drives.recording
    assert recording is not None
    with drives._condition:
        assert drives._condition.wait_for(lambda: recording.runs.unfinished() is None, WAIT_S)
    hits = {each.params.cipv.confirm_hits: each.done for each in recording.runs.all()}
    assert hits == {3: 30, 5: 30}, "the one in between was overtaken before it began"
    assert recording.runs.base is recording.runs.get(1)


def test_whoever_is_told_of_a_recording_finds_its_run(drives: BackgroundRuns):
    """A page asks for the columns as soon as it hears of a change; there must be something to answer."""
    told = list[int | None]()
    drives.on_change = lambda: told.append(drives.state.run)
    drives.open(setup(Recording()), with_hits(3), "default")
    drives.open(setup(Recording()), with_hits(3), "default")
    drives.close()
    assert told == [1, 2, None]


def test_going_back_to_parameters_of_before_computes_nothing_again(drives: BackgroundRuns):
    drives.start()
    drives.open(setup(Recording()), with_hits(3), "default")
    first = wait_done(drives)
    drives.want(with_hits(4), "default")
    wait_done(drives)
    drives.want(with_hits(3), "default")
    assert wait_done(drives) is first


def test_a_frame_that_cannot_be_read_fails_the_run_and_says_which(
    drives: BackgroundRuns, caplog: pytest.LogCaptureFixture
):
    drives.start()
    drives.open(setup(Recording(broken=frozenset({7}))), Params(), "default")
    failed = wait_done(drives)
    assert (failed.done, drives.state.phase) == (7, "failed")
    assert "frame 7 is not there" in drives.state.note
    assert drives.state_before(5, Params()) is not None, "what it has come to stays"
    assert drives.state_before(9, Params()) is None


def test_nothing_of_a_drive_is_read_or_looked_at_while_somebody_is_in_front(drives: BackgroundRuns):
    source, detector = Recording(), CountingDetector()
    drives.start()
    with drives.turn.foreground():
        drives.open(setup(source, detector), Params(), "default")
        assert not source.reading.wait(0.05)
    assert wait_done(drives).is_complete
    assert (len(source.reads), detector.calls) == (30, 30)


@pytest.mark.parametrize("stopped_at", [1, 7, 30])
def test_a_network_that_is_stopped_for_who_asks_looks_again_and_nothing_is_lost(
    drives: BackgroundRuns, stopped_at: int
):
    detector = SlowDetector(slow_at=stopped_at)
    drives.start()
    drives.open(setup(Recording(), detector), Params(), "default")
    assert detector.slow.wait(WAIT_S)
    drives.turn.asked(rests=True)
    of = wait_done(drives)
    assert (of.is_complete, of.note, detector.stopped, detector.calls) == (True, "", 1, 31)
    undisturbed = completed(opened(Recording()), Params())
    assert repr(of.rows()) == repr(undisturbed.rows())


def test_without_a_recording_there_is_nothing_to_say(drives: BackgroundRuns):
    drives.start()
    drives.close()
    drives.want(Params(), "default")
    drives.offer(Recording().frame(0))
    assert drives.state.to_json() | {"revision": 0} == {
        "revision": 0,
        "run": None,
        "base": None,
        "done": 0,
        "total": 0,
        "running": False,
        "phase": "done",
        "note": "",
    }
    assert drives.state_before(0, Params()) is None


# ---------------------------------------------------------------- the parts


def test_a_frame_without_pixels_is_the_same_to_the_line():
    frame = Recording().frame(3)
    light = without_pixels(frame)
    assert light.image is not None
    assert frame.image is not None
    assert light.image.bgr.shape == frame.image.bgr.shape
    assert light.image.bgr.strides == (0, 0, 0)
    assert light.image.t_ns == frame.image.t_ns
    one, other = (step(State(), each, Params())[1] for each in (frame, light))
    assert repr(one.objects) == repr(other.objects)
    assert one.sensors == other.sensors


def test_a_full_store_keeps_what_it_has():
    store = InputStore(limit_bytes=60_000)
    for index in range(10):
        store.offer(Recording().frame(index))
    held = [index for index in range(10) if store.get(index) is not None]
    assert held == list(range(len(store)))
    assert 0 < len(store) < 10


def test_a_frame_is_held_once():
    store, frame = InputStore(), Recording().frame(0)
    store.offer(frame)
    first = store.get(0)
    store.offer(frame)
    assert store.get(0) is first


def test_a_digest_is_the_same_when_and_only_when_a_run_is_made_from_the_same():
    one = digest("sim:a", ["net"], "both", Params())
    assert one == digest("sim:a", ["net"], "both", Params())
    others = [
        digest("sim:b", ["net"], "both", Params()),
        digest("sim:a", ["other"], "both", Params()),
        digest("sim:a", ["net"], "lidar", Params()),
        digest("sim:a", ["net"], "both", with_hits(9)),
    ]
    assert len({one, *others}) == 5


def book() -> RunRegistry:
    return RunRegistry(lambda number, params, preset: DriveRun(number, params, preset, 30))


def begun(of: RunRegistry, hits: int) -> DriveRun:
    """A partly computed run."""
    of.want(with_hits(hits), "default")
    assert of.current is not None
    of.current._head = of.current._head._replace(at=5)
    return of.current


def test_runs_that_nobody_kept_go_when_newer_ones_come():
    runs = book()
    kept = begun(runs, 1)
    runs.keep(kept.number, "  first   one ")
    base = begun(runs, 2)
    runs.compare_with(base.number)
    for hits in range(3, 12):
        begun(runs, hits)
    numbers = [each.number for each in runs.all()]
    assert numbers == [1, 2, *range(12 - MOST_UNKEPT - 1, 12)]
    assert runs.get(1).name == "first one"
    with pytest.raises(NoSuchRun, match="run 4 not found"):
        runs.get(4)


def test_the_present_run_and_the_base_cannot_be_deleted():
    runs = book()
    begun(runs, 1)
    begun(runs, 2)
    begun(runs, 3)
    for number in (1, 3):
        with pytest.raises(RunRefused):
            runs.delete(number)
    runs.delete(2)
    assert [each.number for each in runs.all()] == [1, 3]


def test_no_more_than_a_dozen_runs_are_kept():
    runs = book()
    for hits in range(1, MOST_KEPT + 1):
        runs.keep(begun(runs, hits).number, "")
    with pytest.raises(RunRefused, match="saved already"):
        runs.keep(begun(runs, 19).number, "")
    runs.keep(1, "renamed")


class Starved(Recording):
    """Too many files are open during the first two reads of frame 3."""

    def frame(self, index: int) -> Frame:
        if index == 3 and self.reads.count(3) < 2:
            self.reads.append(3)
            raise Overloaded("too many open files")
        return super().frame(index)


def test_what_could_not_be_read_for_a_moment_is_no_frames_final_result(
    drives: BackgroundRuns, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.drive.background_runs._TRY_AGAIN_S", 0.0)
    monkeypatch.setattr("pipeline.run._SILENCE_S", 0.0)
    drives.start()
    drives.open(setup(Starved(count=6)), Params(), "default")
    run_ = wait_done(drives)
    assert (run_.note, run_.done) == ("", 6)
    undisturbed = [result.objects for _, result in run(Recording(count=6), Params(), Detectors(CountingDetector()))]
    starved = [result.objects for _, result in run(Starved(count=6), Params(), Detectors(CountingDetector()))]
    assert starved == undisturbed


@dataclass
class Hanging(CountingDetector):
    """Hangs in the given calls until ``gate`` is set."""

    at: tuple[int, ...] = ()
    gate: threading.Event = field(default_factory=threading.Event)

    def detect(self, bgr: U8) -> RawBoxes:
        found = super().detect(bgr)
        if self.calls in self.at:
            self.gate.wait(WAIT_S)
        return found


@pytest.mark.parametrize(("at", "note"), [((3,), ""), ((3, 4, 5), "frame 3: the network counting hangs")])
def test_a_network_that_hangs_is_tried_again_and_given_up_after_the_third_time(
    drives: BackgroundRuns, at: tuple[int, ...], note: str
):
    detector, told = Hanging(at=at), list[Stuck]()
    drives.watchdog, drives.on_stuck = Watchdog(first_s=1.0), told.append
    drives.watchdog.start()
    try:
        drives.start()
        drives.open(setup(Recording(), detector), Params(), "default")
        of = wait_done(drives)
    finally:
        detector.gate.set()
        drives.watchdog.stop()
    assert [(stuck.worker, stuck.doing) for stuck in told] == [("the drive's run", "the network counting")] * len(at)
    assert of.note == note
    assert of.is_complete is not bool(note)
