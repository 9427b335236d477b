"""Which detectors run on a tick of live sensors, and what a slow lane detector costs it."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from itertools import islice

import numpy as np
import pytest

from pipeline.common.watchdog import Stuck, Watchdog
from pipeline.detection import Detectors, detect
from pipeline.live_detection import LANES_LEFT_OUT, LiveDetectors
from pipeline.params import Params, SyncParams
from pipeline.run import run_live
from pipeline.types import U8, CameraImage, Frame, RawLanes
from tests.pipeline.lanes.lane_scenes import camera

STEP_NS = 100_000_000
_LINES = RawLanes("lanes", np.zeros((0, 2), np.float32), np.zeros(0, np.float32), np.zeros(0, np.int32))


class _Lanes:
    """A lane detector that takes as long as the test wants."""

    name, notes = "lanes", ()

    def __init__(self, is_quick: bool = False) -> None:
        self.calls = 0
        self.error: Exception | None = None
        self.begun, self._may_end = threading.Semaphore(0), threading.Semaphore(10**6 if is_quick else 0)

    def detect(self, bgr: U8) -> RawLanes:
        self.calls += 1
        self.begun.release()
        self._may_end.acquire()
        if self.error is not None:
            raise self.error
        return _LINES

    def end(self) -> None:
        """Let one call end, and wait until its thread has."""
        self._may_end.release()
        for thread in threading.enumerate():
            if thread.name == "cipv-lanes":
                thread.join()


def _tick(index: int, number: int | None = None) -> Frame:
    """The tick with this index, at the time of the n-th one."""
    at = index if number is None else number
    image = CameraImage(at * STEP_NS, np.zeros((36, 64, 3), np.uint8))
    return Frame(index, f"{index}", at * STEP_NS, image=image, camera=camera())


@pytest.fixture
def lanes() -> Iterator[_Lanes]:
    slow = _Lanes()
    yield slow
    slow.end()


def test_a_slow_lane_detector_delays_no_tick(lanes: _Lanes) -> None:
    """Its lines come with the first tick after it, as old as their image."""
    live = LiveDetectors(Detectors(None, lanes, lanes_every=3))
    assert [detect(*live.of(_tick(n))).raw_lanes for n in range(3)] == [None, None, None]
    lanes.end()
    ages_s = [None if (seen := detect(*live.of(_tick(n))).raw_lanes) is None else seen.age_s for n in (3, 4)]
    assert ages_s == [pytest.approx(0.3), None]
    assert lanes.calls == 2, "its turn came again"


def test_a_detector_that_is_fast_enough_for_every_tick_runs_in_it() -> None:
    live = LiveDetectors(Detectors(None, _Lanes(is_quick=True)))
    seen = [detect(*live.of(_tick(n))).raw_lanes for n in range(3)]
    assert [each is not None and each.age_s for each in seen] == [0.0, 0.0, 0.0]


def test_a_lane_detector_that_misses_its_turn_is_named_in_the_result(lanes: _Lanes) -> None:
    live = LiveDetectors(Detectors(None, lanes, lanes_every=3))
    notes = [detect(*live.of(_tick(n))).notes for n in range(5)]
    assert notes == [(), (), (), (LANES_LEFT_OUT,), ()]
    assert lanes.begun.acquire()
    assert lanes.calls == 1


def test_what_a_lane_detector_raises_is_raised_in_the_next_tick_and_once(lanes: _Lanes) -> None:
    live = LiveDetectors(Detectors(None, lanes, lanes_every=3))
    live.of(_tick(0))
    lanes.error = ValueError("no such input")
    lanes.end()
    with pytest.raises(ValueError, match="no such input"):
        live.of(_tick(1))
    assert live.of(_tick(2))[0].raw_lanes is None


def test_lines_of_unknown_age_are_not_used(lanes: _Lanes) -> None:
    """The sensors' clock was set back."""
    live = LiveDetectors(Detectors(None, lanes, lanes_every=3))
    live.of(_tick(100))
    lanes.end()
    assert live.of(_tick(101, number=2))[0].raw_lanes is None


def test_a_lane_detector_that_hangs_is_noticed(lanes: _Lanes) -> None:
    watchdog, told = Watchdog(first_s=30.0), list[Stuck]()
    watching = partial(watchdog.watching, "lane detection", told.append)
    LiveDetectors(Detectors(None, lanes, lanes_every=3), watching).of(_tick(0))
    assert lanes.begun.acquire()
    watchdog.look(time.monotonic() + 1e6)
    assert [(stuck.worker, stuck.doing) for stuck in told] == [("lane detection", "the network lanes")]


def test_lanes_are_looked_for_in_every_nth_tick_that_is_run() -> None:
    for indices, looked in (
        (range(7), [0, 3, 6]),
        (range(0, 21, 3), [0, 9, 18]),
        (range(1, 22, 3), [1, 10, 19]),
        ((0, 1, 4, 5, 6, 10, 11), [0, 5, 11]),
    ):
        assert _looked(indices) == looked


def _looked(indices: Iterable[int]) -> list[int]:
    """The ticks whose image the lane detector got, if it is quick."""
    lanes, seen = _Lanes(is_quick=True), []
    live = LiveDetectors(Detectors(None, lanes, lanes_every=3))
    for number, index in enumerate(indices):
        calls = lanes.calls
        live.of(_tick(index, number))
        for thread in threading.enumerate():
            if thread.name == "cipv-lanes":
                thread.join()
        seen += [index] * (lanes.calls - calls)
    return seen


@pytest.mark.parametrize("every", [1, 3])
def test_the_far_part_of_the_image_has_every_second_turn(every: int) -> None:
    """Of the turns that were taken, whatever their ticks' indices."""
    lanes, far = _Lanes(is_quick=True), _Lanes(is_quick=True)
    far.name = "far"
    live = LiveDetectors(Detectors(None, lanes, lanes_every=every, far_lanes=far))
    calls = []
    for number in range(4 * every):
        detect(*live.of(_tick(7 * number, number)))
        for thread in threading.enumerate():
            if thread.name == "cipv-lanes":
                thread.join()
        calls.append((lanes.calls, far.calls))
    assert calls[::every] == [(1, 0), (1, 1), (2, 1), (2, 2)]


def test_a_tick_without_an_image_passes_the_lanes_turn_on() -> None:
    frames = [_tick(n) for n in range(6)]
    frames[3] = replace(frames[3], image=None)
    lanes = _Lanes(is_quick=True)
    live = LiveDetectors(Detectors(None, lanes, lanes_every=3))
    calls = []
    for frame in frames:
        live.of(frame)
        for thread in threading.enumerate():
            if thread.name == "cipv-lanes":
                thread.join()
        calls.append(lanes.calls)
    assert calls == [1, 1, 1, 1, 2, 2]


class _Ticks:
    """Live sensors that tick with these frames; before the fourth, the lane detector ends."""

    def __init__(self, frames: list[Frame], lanes: _Lanes) -> None:
        self._left, self._lanes, self._count = iter(frames), lanes, 0

    def start(self) -> None:
        pass

    def close(self) -> None:
        pass

    def next(self, timeout_s: float, params: SyncParams) -> Frame:
        self._count += 1
        if self._count == 4:
            self._lanes.end()
        return next(self._left)


def test_results_of_live_sensors_say_how_old_the_lines_are(lanes: _Lanes) -> None:
    sensors = _Ticks([_tick(n) for n in range(5)], lanes)
    ran = list(islice(run_live(sensors, Params(), Detectors(None, lanes, lanes_every=3)), 5))
    assert [frame.raw_lanes is not None for frame, _ in ran] == [False, False, False, True, False]
    found = ran[3][1].layers.lanes
    assert found is not None
    assert found.age_s == pytest.approx(0.3)
    assert [result.sensors.lanes_age_ms for _, result in ran] == [None, None, None, pytest.approx(300.0), None]
