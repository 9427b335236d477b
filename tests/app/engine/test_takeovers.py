"""A network or a disk that hangs for ever is reported and replaced, while recording continues."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from app.engine.engine import Engine
from app.engine.session_recording import SessionRecorder
from pipeline.common.progress import Progress
from pipeline.common.watchdog import Watchdog
from pipeline.params import Params
from pipeline.recording.session.source import SessionSource
from pipeline.types import U8, RawBoxes
from pipeline.types.source import AnySource
from tests.app.engine.recording_helpers import CountingDetector, Recording
from tests.app.engine.test_live_engine import WAIT_S, Sensors, shown_after
from tests.app.waiting import wait_until

FIRST_S = 2.0


@dataclass
class Hanging(CountingDetector):
    """Hangs in its third call until ``gate`` is set."""

    gate: threading.Event = field(default_factory=threading.Event)
    hangs: threading.Event = field(default_factory=threading.Event)

    def detect(self, bgr: U8) -> RawBoxes:
        found = super().detect(bgr)
        if self.calls == 3:
            self.hangs.set()
            self.gate.wait(WAIT_S)
        return found


@pytest.fixture
def hanging() -> Iterator[Hanging]:
    detector = Hanging()
    yield detector
    detector.gate.set()


def engine_on(source: Sensors | Recording, first: CountingDetector, folder: Path) -> Engine:
    """An engine whose first detector is the given one; later ones work."""
    opened = iter([first, *(CountingDetector(f"fresh {k}") for k in range(9))])

    def open_source(uri: str, *, progress: Progress) -> AnySource:
        return source

    engine = Engine(
        open_source,
        lambda _: next(opened),
        Params(),
        uri=source.uri,
        playing=True,
        recorder=SessionRecorder(folder),
        watchdog=Watchdog(patience_s=0.2, first_s=FIRST_S),
    )
    engine.start()
    return engine


def test_a_network_that_hangs_for_ever_is_said_and_replaced_and_no_sensor_data_is_lost(
    tmp_path: Path, hanging: Hanging
) -> None:
    sensors = Sensors()
    engine = engine_on(sensors, hanging, tmp_path)
    try:
        engine.wait_for(lambda s: s.live, WAIT_S)
        engine.recorder.start(engine.source)
        shown_after(engine, sensors, 0)
        shown_after(engine, sensors, 1)
        sensors.give(2)
        assert hanging.hangs.wait(WAIT_S)
        tap, sweep = sensors.tapped, Recording().frame(2).sweep
        assert tap is not None
        assert sweep is not None
        for k in range(5):
            tap.sweep(replace(sweep, points=sweep.points + k), 10**18 + sweep.t_ns + k)
        said = engine.wait_for(lambda s: any("hung for" in n.text for n in s.notices), WAIT_S)
        (notice,) = (n for n in said.notices if "hung for" in n.text)
        assert notice.level == "error", "which the in-vehicle display shows too"
        assert "(the network counting) and was restarted; recording continues" in notice.text
        after = shown_after(engine, sensors, 3)
        assert after.processed is not None
        assert {item.seen_by for item in after.processed.result.objects} == {"VL"}, "by a fresh network"
        assert notice in after.notices
        assert after.processed.result.objects[0].hits == 3, "tracks go on: of the ticks 0, 1 and 3"
        hanging.gate.set()
        assert wait_until(lambda: sum(t.name == "cipv-engine" for t in threading.enumerate()) == 1), "it has ended"
        shown_after(engine, sensors, 4)
        state = engine.recorder.stop()
    finally:
        engine.stop()
    assert state is not None
    assert (state.error, state.dropped) == (None, 0)
    session = SessionSource("a", str(state.file))
    assert [session.frame(index).t_ns for index in range(len(session))] == [Recording().t_ns(k) for k in (0, 1, 3, 4)]
    assert len(list(session.file.messages(("/lidar/points",)))) == 4 + 5


def test_a_disk_that_hangs_is_said_and_playback_pauses_when_it_does_so_again_and_again(tmp_path: Path) -> None:
    recording = Recording()
    engine = engine_on(recording, CountingDetector(), tmp_path)
    try:
        engine.wait_for(lambda s: s.index > 1, WAIT_S)
        recording.gate.clear()
        shown = engine.wait_for(lambda s: any("keeps hanging" in n.text for n in s.notices), WAIT_S)
        assert any("(reading a frame)" in n.text for n in shown.notices)
        assert engine.wait_for(lambda s: not s.playing, WAIT_S).uri == recording.uri
        assert engine.alive
    finally:
        recording.gate.set()
        engine.stop()
