"""A driver or a decoder that hangs for ever: another thread takes over, and the hung one does nothing more."""

from __future__ import annotations

import threading
import time

from pipeline.sources.live.devices.device_reader import HANGS_S, DeviceLost, Reader, ReaderStop
from pipeline.sources.live.devices.lidar import LidarInput
from pipeline.sources.live.source import LiveSensors
from pipeline.types import Sweep
from tests.app.waiting import wait_until
from tests.pipeline.sources.live.bench import endless
from tests.pipeline.sources.live.rig import Replaying, frames_until, loopback_config

WORST_S = 0.4
EVERY_S = 0.5


def looked_at(reader: Reader, from_s: float, seconds: float, every_s: float = EVERY_S) -> float:
    """Looks as the health of the sensors does, twice a second; the time of the last look."""
    for number in range(1, round(seconds / every_s) + 1):
        reader.look(from_s + number * every_s)
    return from_s + round(seconds / every_s) * every_s


def test_a_reading_that_hangs_is_begun_anew_a_second_after_its_usual_longest() -> None:
    gate, begun, said = threading.Event(), list[ReaderStop](), list[str]()
    closed = list[int]()

    class Device:
        def close(self) -> None:
            closed.append(len(begun))

    def read(stop: ReaderStop) -> None:
        begun.append(stop)
        if len(begun) == 1:
            stop.device = Device()
            gate.wait()
            raise DeviceLost("told by the one that hung")
        while not stop:
            stop.wait(0.01)

    reader = Reader("camera", read, said.append, WORST_S)
    reader.start()
    try:
        assert wait_until(lambda: len(begun) == 1)
        asked_s = begun[0].asked_s
        now_s = looked_at(reader, asked_s, WORST_S + HANGS_S - 0.4)
        assert (reader.hung, closed) == (0, []), "it may take this long"
        now_s = looked_at(reader, now_s, EVERY_S)
        assert (reader.hung, closed) == (1, [1]), "what it holds is free for the next"
        assert wait_until(lambda: len(begun) == 2)
        looked_at(reader, time.monotonic(), EVERY_S)
        assert reader.hung == 1, "the fresh one is well"
        gate.set()
        assert wait_until(lambda: sum(each.name == "cipv-camera" for each in threading.enumerate()) == 1)
        assert said == []
    finally:
        gate.set()
        reader.end()
        reader.join()


def test_a_program_that_stood_still_blames_no_reader() -> None:
    """Suspended, or without a processor, for a minute: the reader could not check either."""
    gate, begun = threading.Event(), list[ReaderStop]()

    def read(stop: ReaderStop) -> None:
        begun.append(stop)
        gate.wait()

    reader = Reader("camera", read, lambda text: None, WORST_S)
    reader.start()
    try:
        assert wait_until(lambda: len(begun) == 1)
        reader.look(begun[0].asked_s + 60.0)
        assert reader.hung == 0
        looked_at(reader, begun[0].asked_s + 60.0, WORST_S + HANGS_S)
        assert reader.hung == 1, "it still does not check"
    finally:
        gate.set()
        reader.end()
        reader.join()


def test_a_lidar_whose_decoder_hangs_comes_back_on_the_same_port(sensors: list[LiveSensors]) -> None:
    gate, hung = threading.Event(), list[int]()
    config = loopback_config(camera=None, gnss=None, ego=None)
    source = LiveSensors("live:loopback", config)
    sensors.append(source)
    lidar = source.inputs["lidar"]
    assert isinstance(lidar, LidarInput)
    push = lidar._decoder.push

    def hangs_once(packet: bytes, t_host_ns: int | None = None) -> Sweep | None:
        if not hung:
            hung.append(1)
            gate.wait()
        return push(packet, t_host_ns)

    lidar._decoder.push = hangs_once  # type: ignore[method-assign]
    source.start()
    try:
        with Replaying(config, endless()):
            frame = frames_until(source, lambda frame: frame.sweep is not None)
        assert "hung 1 time and was restarted" in frame.streams[0].note
    finally:
        gate.set()
