"""Waits for conditions without a notification, and for coroutines."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Coroutine, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, Protocol, TypeVar

WAIT_S = 180.0
T = TypeVar("T")


class Runs(Protocol):
    """Runs a coroutine until it is done."""

    def __call__(self, what: Coroutine[Any, Any, T], /) -> T: ...


@contextmanager
def loop_apart() -> Iterator[Runs]:
    """An event loop in its own thread, since the main thread runs Playwright's loop while a browser is open."""
    with ThreadPoolExecutor(1) as apart:
        runner = asyncio.Runner()

        def run(what: Coroutine[Any, Any, T]) -> T:
            return apart.submit(runner.run, what).result()

        try:
            yield run
        finally:
            apart.submit(runner.close).result()


def wait_until(condition: Callable[[], bool], timeout_s: float = WAIT_S) -> bool:
    """Poll until the condition holds; False if it did not in time."""
    woken = threading.Event()
    for _ in range(round(timeout_s / 0.01)):
        if condition():
            return True
        woken.wait(0.01)
    return False
