"""The page and the command line agree: whatever way a frame was reached, it is the one that ``cipv run`` writes."""

from __future__ import annotations

import json
import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import pytest

from app.engine.engine import Engine
from app.engine.snapshot import Snapshot
from pipeline.detection import Detectors, Detects, detector_for
from pipeline.params import Params, with_changes
from pipeline.run import run
from pipeline.sources import open_source
from pipeline.types import Frame, RawBoxes, Result
from pipeline.types.result_json import to_json
from pipeline.types.source import Source, TruthObject
from tests.app.engine.recording_helpers import CountingDetector, Recording
from tests.looking import yolox_nano

WAIT_S = 180.0


class First:
    """The first frames of another source, each read or rendered once: that takes longer than the pipeline, and a frame
    is reached in five ways here."""

    def __init__(self, source: Source, count: int) -> None:
        self.uri, self.title, self.rate_hz, self.notes = source.uri, source.title, source.rate_hz, source.notes
        self._source, self._count = source, count
        self.frame: Callable[[int], Frame] = cache(source.frame)

    def __len__(self) -> int:
        return self._count

    def t_ns(self, index: int) -> int:
        return self._source.t_ns(index)

    def truth(self, index: int) -> tuple[TruthObject, ...] | None:
        return self._source.truth(index)


def body(result: Result) -> str:
    """A result's bytes, times of this machine apart."""
    plain = to_json(result)
    del plain["timing_ms"]
    return json.dumps(plain)


def from_command_line(source: Source, detector: Detects[RawBoxes], params: Params) -> list[str]:
    return [body(result) for _, result in run(source, params, Detectors(detector))]


@contextmanager
def page(open_it: Callable[[], Source], detector: Detects[RawBoxes], params: Params | None = None) -> Iterator[Engine]:
    """An engine on a recording, paused at its first frame."""
    engine = Engine(
        lambda _, progress: open_it(), lambda _: detector, params or Params(), uri=open_it().uri, whole_drives=True
    )
    engine.start()
    try:
        engine.wait_for(lambda s: s.processed is not None, WAIT_S)
        yield engine
    finally:
        engine.stop()


def at(index: int) -> Callable[[Snapshot], bool]:
    return lambda s: s.processed is not None and s.index == index


def is_done(params: Params) -> Callable[[Snapshot], bool]:
    return lambda s: s.params == params and s.drive.phase == "done" and s.drive.done == s.count > 0


def assert_same_everywhere(engine: Engine, expected: list[str], seeks: int = 30) -> None:
    """Seeks in any order, steps, and playing with frames skipped."""
    order = list(range(len(expected)))
    random.Random(0).shuffle(order)
    for index in order[:seeks]:
        engine.control.seek(index)
        shown = engine.wait_for(at(index), WAIT_S)
        assert shown.processed is not None
        assert not shown.state_json()["provisional"]
        assert body(shown.processed.result) == expected[index], f"frame {index}, sought"
    seen: dict[int, str] = {}
    end = engine.listen(lambda s: seen.update({s.index: body(s.processed.result)}) if s.processed else None)
    engine.control.seek(0)
    engine.wait_for(at(0), WAIT_S)
    engine.control.step(2)
    engine.wait_for(at(2), WAIT_S)
    engine.control.change(playing=True, loop=False, speed=10.0)
    engine.wait_for(lambda s: not s.playing and s.index == len(expected) - 1, WAIT_S)
    end()
    assert len(seen) > 3
    assert all(text == expected[index] for index, text in seen.items()), "played"


def test_a_recording_whose_states_are_known_shows_the_command_lines_frames():
    expected = from_command_line(Recording(), CountingDetector(), Params())
    with page(Recording, CountingDetector()) as engine:
        engine.wait_for(is_done(Params()), WAIT_S)
        assert_same_everywhere(engine, expected)


def test_a_simulated_drive_agrees():
    source = First(open_source("sim:straight"), 20)
    detector = detector_for(source)
    expected = from_command_line(source, detector, Params())
    with page(lambda: source, detector) as engine:
        engine.wait_for(is_done(Params()), WAIT_S)
        assert_same_everywhere(engine, expected)


def test_a_real_drive_agrees_with_other_parameters_too(data_dir: Path):
    """Clips with minutes between them: trackers restart, ids continue."""
    whole = open_source(f"astyx:{data_dir / 'astyx'}")
    source = First(whole, len(whole))
    detector = yolox_nano(data_dir, 2048, 618)
    other = with_changes(Params(), {"cipv.confirm_hits": 5, "cluster.tolerance_m": 0.7})
    with page(lambda: source, detector) as engine:
        engine.wait_for(is_done(Params()), WAIT_S)
        assert_same_everywhere(engine, from_command_line(source, detector, Params()), seeks=12)
        engine.control.set_params(other)
        engine.wait_for(is_done(other), WAIT_S)
        assert_same_everywhere(engine, from_command_line(source, detector, other), seeks=12)


def test_a_frame_shown_too_early_says_so_and_becomes_the_command_lines():
    expected = from_command_line(Recording(), CountingDetector(), Params())
    engine = Engine(
        lambda _, progress: Recording(), lambda _: CountingDetector(), Params(), uri="test:car", whole_drives=True
    )
    try:
        with engine.drives.turn.foreground():  # while somebody is in front, no drive is computed
            engine.start()
            engine.control.seek(25)
            early = engine.wait_for(at(25), WAIT_S)
            assert early.processed is not None
            assert early.state_json()["provisional"]
            assert body(early.processed.result) != expected[25], "a short warm-up has seen the car less often"
        late = engine.wait_for(lambda s: s.processed is not None and s.processed.exact and s.index == 25, WAIT_S)
        assert late.processed is not None
        assert late.sequence > early.sequence
        assert body(late.processed.result) == expected[25]
    finally:
        engine.stop()


def test_while_a_slider_is_dragged_the_frame_is_provisional_and_no_drive_is_computed():
    with page(Recording, CountingDetector()) as engine:
        engine.wait_for(is_done(Params()), WAIT_S)
        engine.control.seek(20)
        engine.wait_for(at(20), WAIT_S)
        revision = engine.control.change_params({"cipv.confirm_hits": 6}, final=False)
        dragged = engine.wait_for(lambda s: s.params_revision == revision, WAIT_S)
        assert dragged.state_json()["provisional"]
        recording = engine.drives.recording
        assert recording is not None
        assert [each.params for each in recording.runs.all()] == [Params()]
        revision = engine.control.change_params({"cipv.confirm_hits": 6})
        shown = engine.wait_for(
            lambda s: s.params_revision == revision and s.processed is not None and s.processed.exact, WAIT_S
        )
        assert shown.processed is not None
        expected = from_command_line(Recording(), CountingDetector(), shown.params)
        assert body(shown.processed.result) == expected[20]


@pytest.mark.parametrize("sensors", ["lidar", "camera"])
def test_with_one_sensor_taken_away_they_agree(sensors):
    expected = [body(r) for _, r in run(Recording(), Params(), Detectors(CountingDetector()), sensors)]
    engine = Engine(
        lambda _, progress: Recording(),
        lambda _: CountingDetector(),
        Params(),
        uri="test:car",
        sensors=sensors,
        whole_drives=True,
    )
    engine.start()
    try:
        engine.wait_for(is_done(Params()), WAIT_S)
        assert_same_everywhere(engine, expected)
    finally:
        engine.stop()
