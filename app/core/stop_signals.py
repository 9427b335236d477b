"""Handles the signals that end the program: Ctrl-C, SIGTERM (systemd, docker) and SIGHUP (a closed terminal or SSH
connection)."""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event
from typing import Any

SAVE_S, REST_S = 1.5, 3.0
"""For what is not written yet, and for everything else: less than the 5 s after which impatient supervisors kill."""
_SIGNALS = (signal.SIGINT, signal.SIGTERM, *((signal.SIGHUP,) if hasattr(signal, "SIGHUP") else ()))


@contextmanager
def asked_to_stop() -> Iterator[Event]:
    """An event set by the first signal, after which the current work is completed. Only a second Ctrl-C ends
    immediately, with KeyboardInterrupt: systems send SIGTERM followed by SIGHUP for a single request."""
    asked, is_asked = Event(), False

    def ask(number: int, _: object) -> None:
        nonlocal is_asked
        if not is_asked:
            is_asked = True  # first: a signal that arrives during ``set``, which holds a lock, must not call it again
            asked.set()
        elif number == signal.SIGINT:
            raise KeyboardInterrupt

    with _handled(ask):
        yield asked


def end_process_once(asked: Event, save: Callable[[], object]) -> None:
    """Once ``asked`` is set, call ``save`` and end the process at most ``REST_S`` later, even if something hangs.

    At exit, Python waits for all threads of a pool, and a thread that waits for a disk or database without response
    never ends: a supervisor would kill the program and report a failure.
    """

    def end() -> None:
        asked.wait()
        save()
        time.sleep(REST_S)
        print("cipv: exited without waiting for hung work; the recording is closed", file=sys.stderr, flush=True)
        os._exit(0)

    threading.Thread(target=end, name="cipv-shutdown", daemon=True).start()


class _Teardown:
    """Python's teardown of the interpreter at exit, which frees every module and object one by one.

    With the libraries and a drive of a server that takes over a second of processor time, so many seconds on a busy
    machine. No thread runs any more then, so that of ``end_process_once`` cannot end it either.
    """

    def __init__(self) -> None:
        self.skipped_with: int | None = None
        atexit.register(self._skip)  # on import, before other modules register theirs: the last to be called

    def _skip(self) -> None:
        if self.skipped_with is None:
            return
        try:
            sys.stdout.flush()
            sys.stderr.flush()
        except (OSError, ValueError):
            return  # Python reports output that cannot be written
        os._exit(self.skipped_with)


_TEARDOWN = _Teardown()


def skip_teardown(status: int) -> None:
    """Call when everything is closed and written: the process exits with ``status`` once its threads have ended and all
    functions registered with ``atexit`` were called, without freeing its memory first."""
    _TEARDOWN.skipped_with = status


@contextmanager
def as_interrupts() -> Iterator[None]:
    """SIGTERM and SIGHUP raise KeyboardInterrupt, like Ctrl-C, so that a command closes its files in all cases."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    with _handled(interrupt):
        yield


@contextmanager
def held_back() -> Iterator[None]:
    """Raises KeyboardInterrupt at the end of the block, if a stop was asked for within: for a start of a few seconds
    that leaves a mess if it is cut off. Processes started by threads that it starts ignore Ctrl-C, which a terminal
    sends to all of them: their parent ends them."""
    from multiprocessing import resource_tracker  # registers an exit handler, which is to be called before ours

    resource_tracker.ensure_running()  # its start would unblock Ctrl-C in the thread that needs it first
    is_asked = False

    def ask(*_: object) -> None:
        nonlocal is_asked
        is_asked = True

    with _handled(ask), _blocked_interrupts():
        yield
    if is_asked:
        raise KeyboardInterrupt


@contextmanager
def _blocked_interrupts() -> Iterator[None]:
    """Threads and processes inherit what is blocked. Has no effect on Windows."""
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _handled(handler: Any) -> Iterator[None]:
    """Has no effect outside the main thread, which receives the signals, and for signals that the parent process has
    set to be ignored (nohup)."""
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
