"""Handles the signals that end the program: Ctrl-C, SIGTERM (systemd, docker) and SIGHUP (a closed terminal or SSH
connection)."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event
from typing import Any

_SIGNALS = (signal.SIGINT, signal.SIGTERM, *((signal.SIGHUP,) if hasattr(signal, "SIGHUP") else ()))


@contextmanager
def asked_to_stop() -> Iterator[Event]:
    """Set by the first signal; what is under way is then finished. Only a second Ctrl-C ends at once, with
    KeyboardInterrupt: a system sends SIGTERM and SIGHUP one after the other, and means the same by both."""
    asked = Event()

    def ask(number: int, _: object) -> None:
        if asked.is_set() and number == signal.SIGINT:
            raise KeyboardInterrupt
        asked.set()

    with _handled(ask):
        yield asked


@contextmanager
def as_interrupts() -> Iterator[None]:
    """SIGTERM and SIGHUP raise KeyboardInterrupt, as Ctrl-C does: a command closes its files either way."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    with _handled(interrupt):
        yield


@contextmanager
def _handled(handler: Any) -> Iterator[None]:
    """Nothing changes on another thread than the main one, which gets the signals, and for a signal that whoever
    started the program has it ignore (nohup)."""
    before: dict[signal.Signals, Any] = {}
    if threading.current_thread() is threading.main_thread():
        before = {number: signal.getsignal(number) for number in _SIGNALS}
        before = {number: known for number, known in before.items() if known is not signal.SIG_IGN}
    for number in before:
        signal.signal(number, handler)
    try:
        yield
    finally:
        for number, known in before.items():
            signal.signal(number, known)
