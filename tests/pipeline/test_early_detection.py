"""Detectors that process the image of the next tick while its sweep is still being measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.detection import Detectors, detect
from pipeline.live_detection import LiveDetectors
from pipeline.params import Params, SyncParams, with_changes
from pipeline.types import U8, CameraImage, Frame, RawBoxes, RawLanes
from pipeline.vision.far_view import FarView
from tests.pipeline.lanes.lane_scenes import camera

STEP_NS = 100_000_000


class _Boxes:
    """A detector whose only box is as wide as the image is bright. seen: brightness of each image it got."""

    notes = ()

    def __init__(self, name: str) -> None:
        self.name = name
        self.seen: list[int] = []

    def detect(self, bgr: U8) -> RawBoxes:
        shade = int(bgr[0, 0, 0])
        self.seen.append(shade)
        return RawBoxes(self.name, np.array([[5, 5, 5 + shade, 9]], np.float32), np.ones(1, np.float32), ("car",))


class _Lanes:
    """A lane detector that counts its calls."""

    name, notes, calls = "lanes", (), 0

    def detect(self, bgr: U8) -> RawLanes:
        self.calls += 1
        return RawLanes(self.name, np.zeros((0, 2), np.float32), np.zeros(0, np.float32), np.zeros(0, np.int32))


class _Sensors:
    """Live sensors. Between two ticks they give ``known``, then ``tick``."""

    def __init__(self) -> None:
        self.known: Frame | None = None
        self.tick: Frame | None = None
        self._is_asked_first = True

    def next(self, timeout_s: float, params: SyncParams) -> Frame | None:
        """The tick, but not before it was asked what is known of it, if anything is."""
        if self.known is not None and self._is_asked_first:
            return None
        self._is_asked_first = True
        tick, self.tick = self.tick, None
        return tick

    def upcoming(self, params: SyncParams) -> Frame | None:
        self._is_asked_first = False
        return self.known


def _image(shade: int) -> Frame:
    return Frame(0, "0", 0, image=CameraImage(0, np.full((64, 64, 3), shade, np.uint8)), camera=camera())


def _bright(found: Frame) -> list[int]:
    assert found.raw_boxes is not None
    return [round(float(x2 - x1)) for x1, _, x2, _ in found.raw_boxes.boxes]


class _Bench:
    """Live detectors, and sensors that tick as the test wants."""

    def __init__(self, **detectors: object) -> None:
        self.sensors, self.params, self._index = _Sensors(), Params(), -1
        self.live = LiveDetectors(Detectors(**detectors))  # type: ignore[arg-type]

    def tick(self, known: Frame | None, tick: Frame, dropped: int = 0) -> Frame:
        """A tick of which an image was known before, processed by the detectors."""
        self._index += 1 + dropped
        self.sensors.known, self.sensors.tick = known, replace(tick, index=self._index, t_ns=self._index * STEP_NS)
        came = self.live.next_tick(self.sensors, 60.0, self.params)  # type: ignore[arg-type]
        assert came is not None
        return detect(*self.live.of(came), self.live.look)


def test_an_image_that_is_known_before_its_tick_is_processed_before_it() -> None:
    boxes, lanes = _Boxes("whole"), _Lanes()
    bench = _Bench(boxes=boxes, lanes=lanes)
    image = _image(20)
    bench.sensors.known = image
    bench.live.next_tick(bench.sensors, 0.05, bench.params)  # type: ignore[arg-type]
    assert (boxes.seen, lanes.calls) == ([20], 1), "there is no tick yet"
    found = bench.tick(image, image)
    assert (_bright(found), boxes.seen, lanes.calls) == ([20], [20], 1), "once"
    assert found.raw_lanes is not None


def test_a_tick_with_another_image_than_expected_has_what_is_in_its_own() -> None:
    boxes = _Boxes("whole")
    bench = _Bench(boxes=boxes)
    assert _bright(bench.tick(_image(20), _image(30))) == [30]
    assert boxes.seen == [20, 30]


def test_an_equal_image_is_another_image() -> None:
    boxes = _Boxes("whole")
    bench = _Bench(boxes=boxes)
    bench.tick(_image(20), _image(20))
    assert boxes.seen == [20, 20]


def test_a_tick_that_is_there_already_does_not_wait_for_a_later_image() -> None:
    """On a slow machine ticks are due whenever it is asked, so no time is spent on images that may never be used."""
    boxes = _Boxes("whole")
    bench = _Bench(boxes=boxes)
    bench.sensors.tick = _image(30)
    assert bench.live.next_tick(bench.sensors, 60.0, bench.params) is not None  # type: ignore[arg-type]
    assert boxes.seen == []


@pytest.mark.parametrize(
    ("case", "enabled", "dropped", "early"),
    [
        ("as in every tick", True, 0, ["whole", "far"]),
        ("disabled", False, 0, ["whole"]),
        ("left to each tick after one was dropped", True, 1, ["whole"]),
    ],
)
def test_the_far_view_is_processed_early_where_every_tick_has_it(
    case: str, enabled: bool, dropped: int, early: list[str]
) -> None:
    whole, far = _Boxes("whole"), _Boxes("far")
    bench = _Bench(boxes=whole, far=FarView(far, 32))
    bench.params = with_changes(Params(), {"detection.far_view": enabled})
    first = _image(10)
    bench.tick(None, first)
    bench.tick(None, first, dropped)
    whole.seen, far.seen = [], []
    bench.sensors.known = _image(20)
    bench.live.next_tick(bench.sensors, 0.05, bench.params)  # type: ignore[arg-type]
    assert [each.name for each in (whole, far) if each.seen] == early, case


def test_both_views_of_a_tick_are_those_of_its_early_image() -> None:
    whole, far = _Boxes("whole"), _Boxes("far")
    bench = _Bench(boxes=whole, far=FarView(far, 32))
    for shade in range(1, 20):
        image = _image(shade)
        found = bench.tick(image, image)
        assert _bright(found) == [shade, shade]
        assert found.raw_boxes is not None
        assert found.raw_boxes.far_count == 1
    assert whole.seen == far.seen == list(range(1, 20))


def test_a_detector_that_fails_early_is_tried_again_in_the_tick() -> None:
    class Fails(_Boxes):
        def detect(self, bgr: U8) -> RawBoxes:
            if not self.seen:
                self.seen.append(0)
                raise ValueError("once")
            return super().detect(bgr)

    boxes = Fails("whole")
    bench = _Bench(boxes=boxes)
    image = _image(20)
    bench.sensors.known = image
    with pytest.raises(ValueError, match="once"):
        bench.live.next_tick(bench.sensors, 60.0, bench.params)  # type: ignore[arg-type]
    assert _bright(bench.tick(image, image)) == [20]
