"""A hand-over that holds only the newest value."""

from __future__ import annotations

import threading

from app.core.latest_value import Newest

WAIT_S = 180.0


def test_only_the_newest_is_taken() -> None:
    slot = Newest[int]()
    for value in (1, 2, 3):
        slot.put(value)
    assert slot.take() == 3
    slot.put(4)
    assert slot.take() == 4


def test_what_is_put_back_gives_way_to_what_came_meanwhile() -> None:
    slot = Newest[int]()
    slot.put(1)
    first = slot.take()
    assert first == 1
    slot.put_back(first)
    assert slot.take() == 1
    slot.put(2)
    slot.put_back(1)
    assert slot.take() == 2


def test_who_waits_gets_what_comes_and_hears_the_end() -> None:
    slot = Newest[int]()
    taken: list[int | None] = []
    came = threading.Event()

    def work() -> None:
        while (value := slot.take()) is not None:
            taken.append(value)
            came.set()

    worker = threading.Thread(target=work, daemon=True)
    worker.start()
    slot.put(7)
    assert came.wait(WAIT_S)
    slot.end()
    worker.join(WAIT_S)
    assert not worker.is_alive()
    assert taken == [7]


def test_after_the_end_nothing_is_given_any_more() -> None:
    slot = Newest[int]()
    assert not slot.ends_within(0.0)
    slot.put(1)
    slot.end()
    assert slot.take() is None
    assert slot.ends_within(WAIT_S)
