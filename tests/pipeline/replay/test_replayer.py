"""What is due is sent when it is due; a machine that is too slow puts things off and does not lag."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest

from pipeline.replay.faults import Fault
from pipeline.replay.messages import Message
from pipeline.replay.replayer import replay

MS = 1_000_000


class Notebook:
    """A sender that records what it is given, and when."""

    def __init__(self, takes_s: float = 0.0) -> None:
        self.sent: list[tuple[int, Any]] = []
        self.plugs: list[bool] = []
        self._takes_s = takes_s

    def send(self, payload: Any, stamp_ns: int) -> None:
        self.sent.append((time.time_ns() - stamp_ns, payload))
        time.sleep(self._takes_s)

    def plug(self, is_in: bool) -> None:
        self.plugs.append(is_in)

    def close(self) -> None:
        pass


def images(count: int) -> list[Message]:
    return [Message(k * 10 * MS, "camera", bytes([k % 256])) for k in range(count)]


def test_everything_is_sent_in_order_and_not_early() -> None:
    camera = Notebook()
    sent = replay(images(20), {"camera": camera})
    assert [payload[0] for _, payload in camera.sent] == list(range(20))
    assert sent.events == {"camera": 20}
    assert min(late for late, _ in camera.sent) >= 0


def test_a_machine_that_is_too_slow_puts_off_instead_of_lagging_behind() -> None:
    slow = Notebook(takes_s=0.05)
    sent = replay(images(60), {"camera": slow})
    assert sent.slips > 3
    assert sent.events["camera"] == 60
    assert max(late for late, _ in slow.sent) < 1000 * MS, "without that it would be 2.4 s in the end"


def test_a_plug_is_pulled_and_put_back() -> None:
    camera = Notebook()
    fault = Fault(sensor="camera", kind="disconnect", from_s=0.15, to_s=0.25)
    replay(images(40), {"camera": camera}, faults=[fault])
    assert camera.plugs == [False, True]
    assert len(camera.sent) < 40


def test_a_sensor_nobody_listens_to_is_left_out_and_nothing_is_nothing() -> None:
    assert replay(images(3), {}).events == {}
    assert replay([], {"camera": Notebook()}).events == {}


def test_it_ends_when_it_is_stopped() -> None:
    camera = Notebook()
    sent = replay(images(10_000), {"camera": camera}, stopped=lambda: len(camera.sent) >= 3)
    assert sent.events["camera"] == 3


def test_what_goes_wrong_while_making_messages_is_raised() -> None:
    def broken():
        yield from images(2)
        raise ValueError("no more frames")

    camera = Notebook()
    with pytest.raises(ValueError, match="no more frames"):
        replay(broken(), {"camera": camera})


def test_no_thread_prepares_messages_any_more_once_it_is_interrupted() -> None:
    """A thread that is within a library when Python ends aborts the program."""
    is_within, may_go_on = threading.Event(), threading.Event()

    def endless() -> Iterator[Message]:
        yield from images(100)
        is_within.set()
        may_go_on.wait()
        yield from images(1)

    class Interrupted(Notebook):
        def send(self, payload: Any, stamp_ns: int) -> None:
            is_within.wait()
            threading.Timer(0.2, may_go_on.set).start()
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        replay(endless(), {"camera": Interrupted()})
    assert may_go_on.is_set(), "it was waited for"
    assert "cipv-replay-maker" not in {thread.name for thread in threading.enumerate()}
