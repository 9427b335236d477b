"""A driver or a decoder that hangs for ever: another thread takes over, and the hung one does nothing more."""

from __future__ import annotations

import threading
import time

from pipeline.sources.live.devices.device_reader import HANGS_S, DeviceLost, Reader, ReaderStop
from tests.app.waiting import wait_until


def test_a_reading_that_hangs_is_begun_anew() -> None:
    gate, begun, said = threading.Event(), list[ReaderStop](), list[str]()

    def read(stop: ReaderStop) -> None:
        begun.append(stop)
        if len(begun) == 1:
            gate.wait()
            raise DeviceLost("told by the one that hung")
        while not stop:
            stop.wait(0.01)

    reader = Reader("camera", read, said.append)
    reader.start()
    try:
        assert wait_until(lambda: len(begun) == 1)
        reader.look(time.monotonic() + HANGS_S - 1.0)
        assert reader.hung == 0, "the longest that a camera may take"
        reader.look(time.monotonic() + HANGS_S + 1.0)
        assert reader.hung == 1
        assert wait_until(lambda: len(begun) == 2)
        reader.look(time.monotonic() + 0.5)
        assert reader.hung == 1, "the fresh one is well"
        gate.set()
        assert wait_until(lambda: sum(each.name == "cipv-camera" for each in threading.enumerate()) == 1)
        assert said == []
    finally:
        gate.set()
        reader.end()
        reader.join()
