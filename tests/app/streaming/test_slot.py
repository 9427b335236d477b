"""A client's slot: newest only, never a queue."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator

import pytest

from app.streaming.slot import FRAMES_UNDER_WAY, Slot
from tests.app.waiting import loop_apart

Taken = Callable[[Slot], list[str | bytes] | None]


async def _now(slot: Slot) -> list[str | bytes] | None:
    task = asyncio.ensure_future(slot.take())
    for _ in range(5):
        await asyncio.sleep(0)
    if task.done():
        return task.result()
    task.cancel()
    return None


@pytest.fixture
def taken() -> Iterator[Taken]:
    """The slot's current item; None if it would wait."""
    with loop_apart() as run:
        yield lambda slot: run(_now(slot))


def test_a_slow_client_gets_only_the_newest_of_each_kind(taken: Taken):
    slot = Slot()
    for number in range(5):
        slot.put("state", f"state {number}")
        slot.put("frame", b"frame %d" % number, number)
        slot.put("pong", f"pong {number}")
    assert taken(slot) == [b"frame 4", "pong 4"]
    assert taken(slot) is None


def test_a_state_goes_out_only_when_it_is_newer_than_the_frame(taken: Taken):
    slot = Slot()
    slot.put("state", "playing")
    slot.put("frame", b"which says so too", 1)
    assert taken(slot) == [b"which says so too"]
    slot.put("frame", b"next", 2)
    slot.put("state", "paused on it")
    assert taken(slot) == [b"next", "paused on it"]


def test_an_older_frame_never_replaces_a_newer_one(taken: Taken):
    slot = Slot()
    slot.put("frame", b"new", 8)
    slot.put("frame", b"old", 7)
    assert taken(slot) == [b"new"]
    slot.put("frame", b"older", 6)
    assert taken(slot) is None


def test_a_paced_client_gets_no_frame_ahead_of_what_it_has_painted(taken: Taken):
    slot = Slot(paced=True)
    for number in range(FRAMES_UNDER_WAY):
        slot.put("frame", b"%d" % number, number)
        assert taken(slot) == [b"%d" % number]
    for number in (10, 11):
        slot.put("frame", b"%d" % number, number)
        assert taken(slot) is None
    slot.painted()
    assert taken(slot) == [b"11"]


def test_the_newest_state_comes_last_also_when_a_frame_had_to_wait(taken: Taken):
    """Otherwise the older frame would make the page show an outdated state."""
    slot = Slot(paced=True)
    for number in range(FRAMES_UNDER_WAY):
        slot.put("frame", b"%d" % number, number)
        assert taken(slot) == [b"%d" % number]
    slot.put("frame", b"playing", 8)
    slot.put("state", "paused")
    assert taken(slot) == ["paused"]
    slot.painted()
    assert taken(slot) == [b"playing", "paused"]
    slot.painted()
    assert taken(slot) is None


def test_a_client_that_is_not_paced_gets_every_frame_it_can_take(taken: Taken):
    slot = Slot()
    for number in range(10):
        slot.put("frame", b"%d" % number, number)
        assert taken(slot) == [b"%d" % number]
