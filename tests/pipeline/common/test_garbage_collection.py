"""Garbage collection is paused for as long as requested, and what is loaded is exempt from it, but nothing else."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Iterator

import pytest

from pipeline.common.garbage_collection import freeze_loaded_objects, gc_paused


@pytest.fixture(autouse=True)
def as_before() -> Iterator[None]:
    was_on = gc.isenabled()
    gc.enable()
    yield
    (gc.enable if was_on else gc.disable)()


def test_it_rests_until_the_last_is_done() -> None:
    first, second = gc_paused(), gc_paused()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert not gc.isenabled()
    second.__exit__(None, None, None)
    assert gc.isenabled()


def test_it_goes_on_after_a_failure() -> None:
    with pytest.raises(ValueError, match="wrong"), gc_paused():
        raise ValueError("wrong")
    assert gc.isenabled()


def test_where_it_was_off_it_stays_off() -> None:
    gc.disable()
    with gc_paused():
        pass
    assert not gc.isenabled()


def test_what_is_loaded_is_exempt_once_and_a_closed_server_is_not() -> None:
    class Server:
        def __init__(self) -> None:
            self.itself = self

    freeze_loaded_objects("a module of this test")
    frozen = gc.get_freeze_count()
    closed = Server()
    gone = weakref.ref(closed)
    del closed
    freeze_loaded_objects("a module of this test")
    assert gc.get_freeze_count() <= frozen
    gc.collect()
    assert gone() is None
