"""Opening recordings and detectors: slow ones, failures and repeated requests."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

import app.engine.engine as engine_module
from app.core.detection_cache import DetectionCache
from app.engine.engine import Engine
from app.engine.seekable_pipeline import SeekablePipeline
from app.engine.snapshot import Snapshot
from pipeline.common.progress import Progress
from pipeline.detection import Detectors
from pipeline.inference.runtime import DetectorMissing
from pipeline.params import Params
from pipeline.types.source import Source
from tests.app.engine.recording_helpers import CountingDetector, Recording, opener
from tests.app.engine.running import WAIT_S, Start, at


class Slowly:
    """Opens "test:long" in steps, each when the test allows it; anything else at once."""

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
    assert engine.wait_for(lambda s: s.uri == "test:long" and s.busy is None, WAIT_S)


def test_what_takes_long_to_open_is_given_up_for_something_else(slowly: tuple[Engine, Slowly]):
    engine, opens = slowly
    engine.control.change(uri="test:long")
    engine.wait_for(lambda s: s.busy == "Opening test:long … 0 %", WAIT_S)
    engine.control.change(uri="test:other")
    opens.goes_on.release()
    assert opens.given_up.wait(WAIT_S)
    shown = engine.wait_for(lambda s: s.uri == "test:other" and s.processed is not None, WAIT_S)
    assert (shown.busy, [n for n in shown.notices if n.level == "error"]) == (None, [])


def test_while_kernels_compile_the_first_frame_is_announced(
    slowly: tuple[Engine, Slowly], monkeypatch: pytest.MonkeyPatch
) -> None:
    engine, _ = slowly
    compiled = threading.Event()
    monkeypatch.setattr("app.engine.engine.is_warm", compiled.is_set)
    monkeypatch.setattr("app.engine.engine.warm_up", lambda: compiled.wait(WAIT_S))
    engine.control.change(uri="test:other")
    shown = engine.wait_for(lambda s: s.uri == "test:other", WAIT_S)
    assert (shown.busy or "").startswith("Preparing the pipeline")
    compiled.set()
    engine.wait_for(lambda s: s.processed is not None and s.busy is None, WAIT_S)


def test_with_another_recording_nothing_of_the_old_one_is_told():
    """A page would request a drive that no longer exists, and draw it under the new name."""
    engine = Engine(
        opener(Recording(), Recording("test:other")),
        lambda _: CountingDetector(),
        Params(),
        uri="test:car",
        whole_drives=True,
    )
    engine.start()
    try:
        old = engine.wait_for(lambda s: s.processed is not None and s.drive.run is not None, WAIT_S).drive.run
        engine.control.seek(5)
        engine.wait_for(at(5), WAIT_S)
        told: list[Snapshot] = []
        engine.listen(told.append)
        engine.control.change(uri="test:other")
        engine.wait_for(lambda s: s.uri == "test:other" and s.processed is not None and s.drive.run is not None, WAIT_S)
        first = next(s for s in told if s.uri == "test:other")
        assert first.processed is None
        assert (first.drive.done, first.index, first.time_s) == (0, 0, 0.0)
        assert all(s.drive.run != old for s in told if s.uri == "test:other")
    finally:
        engine.stop()


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
        SeekablePipeline(source, Detectors(detector), cache, "both").seek(0, Params())
        assert detector.calls == calls
    file.write_text("and after")
    SeekablePipeline(source, Detectors(detector), cache, "both").seek(0, Params())
    assert detector.calls == 2


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


def test_without_a_detector_lidar_goes_on_alone_and_the_page_is_told_the_remedy():
    def missing(_: Source) -> CountingDetector:
        raise DetectorMissing("No detector is installed: run `cipv models pull yolox_nano`.")

    engine = Engine(opener(Recording()), missing, Params(), uri="test:car")
    engine.start()
    try:
        shown = engine.wait_for(lambda s: s.processed is not None, WAIT_S)
        assert any("cipv models pull" in n.text and n.level == "warning" for n in shown.notices)
        assert shown.processed is not None
        assert {item.source for item in shown.processed.result.objects} == {"L"}
    finally:
        engine.stop()


def test_what_a_detector_has_to_say_is_said_on_the_page():
    network = CountingDetector(notes=("it knows simulated cars only",))
    engine = Engine(opener(Recording()), lambda _: network, Params(), uri="test:car")
    engine.start()
    try:
        shown = engine.wait_for(lambda s: s.processed is not None, WAIT_S)
        assert [n.text for n in shown.notices] == [*Recording().notes, "it knows simulated cars only"]
    finally:
        engine.stop()


@pytest.mark.parametrize(
    ("sensors", "told"),
    [("both", []), ("lidar", ["LiDAR only"]), ("camera", ["Camera only"])],
    ids=["both", "LiDAR", "camera"],
)
def test_a_car_with_only_one_sensor_is_told_on_the_page(start: Start, sensors: str, told: list[str]):
    engine, recording, _ = start(sensors=sensors)
    said = [n.text for n in engine.snapshot.notices]
    assert [text.partition(":")[0] for text in said if text not in recording.notes] == told


def test_the_detector_is_asked_for_again_where_images_are_drawn():
    """The network for real images is not the one for the simulator, even if the images have the same size."""
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
            engine.wait_for(lambda s, uri=uri: s.uri == uri and s.processed is not None, WAIT_S)
        assert asked == ["test:car", "sim:car"]
    finally:
        engine.stop()


@pytest.mark.parametrize(("sensors", "sources"), [("lidar", {"L"}), ("camera", {"V"}), ("both", {"VL"})])
def test_sensors_can_be_taken_away(start: Start, sensors: str, sources: set[str]):
    engine, _, detector = start(sensors=sensors)
    tick = engine.snapshot.processed
    assert tick is not None
    assert {item.source for item in tick.result.objects} == sources
    assert tick.frame.image is not None, "people still want to see the image"
    assert (detector.calls == 0) == (sensors == "lidar")
