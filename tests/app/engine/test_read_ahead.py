"""One frame prepared while the worker does something else."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest

from app.engine.read_ahead import ReadAhead

WAIT_S = 180.0


@dataclass
class Work:
    """Records what was prepared. ``gate``: while it is cleared, preparing waits."""

    done: list[int] = field(default_factory=list)
    gate: threading.Event = field(default_factory=threading.Event)
    begun: threading.Semaphore = field(default_factory=lambda: threading.Semaphore(0))
    told: threading.Semaphore = field(default_factory=lambda: threading.Semaphore(0))

    def prepare(self, index: int) -> None:
        self.begun.release()
        assert self.gate.wait(WAIT_S)
        if index < 0:
            raise OSError("cannot be read")
        self.done.append(index)


@pytest.fixture
def work() -> Iterator[Work]:
    work = Work()
    yield work
    work.gate.set()


def test_it_prepares_what_is_wanted_and_says_so(work: Work):
    work.gate.set()
    ahead = ReadAhead(work.prepare, work.told.release)
    assert (ahead.ready, ahead.busy) == (None, False)
    ahead.want(7)
    assert work.told.acquire(timeout=WAIT_S)
    assert (ahead.ready, ahead.busy, work.done) == (7, False, [7])
    ahead.want(7)
    assert not ahead.busy, "it is there already"
    ahead.end()


def test_a_newer_wish_replaces_one_that_was_not_begun(work: Work):
    ahead = ReadAhead(work.prepare, work.told.release)
    ahead.want(1)
    assert work.begun.acquire(timeout=WAIT_S)
    for index in (2, 3, 1, 4):
        ahead.want(index)
    assert ahead.busy
    work.gate.set()
    for _ in range(2):
        assert work.told.acquire(timeout=WAIT_S)
    assert work.done == [1, 4]
    ahead.end()


def test_what_cannot_be_prepared_is_ready_all_the_same(work: Work):
    """Reading it for display then reports the error."""
    work.gate.set()
    ahead = ReadAhead(work.prepare, work.told.release)
    ahead.want(-1)
    assert work.told.acquire(timeout=WAIT_S)
    assert ahead.ready == -1
    ahead.end()


def test_who_ends_it_with_patience_leaves_no_thread_behind():
    before = set(threading.enumerate())
    ahead = ReadAhead(lambda index: None, lambda: None)
    assert set(threading.enumerate()) - before
    ahead.end(patience_s=60.0)
    assert set(threading.enumerate()) <= before
