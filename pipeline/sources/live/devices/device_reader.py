"""A thread that reads one device while it is needed: opens it, reads it, and reopens it when the connection is lost."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import Protocol

logger = logging.getLogger("cipv.live")

RETRY_S = 0.2
"""Interval between attempts to open a device, so that one that returns is open within a second."""
POLL_S = 0.2
"""Longest wait inside a read before it checks whether it should stop."""
CONNECT_S = 0.5
NAME_S = 2.0
"""Longest time to look up a host's name on a network that works; sensors usually have numeric addresses."""
SILENCE_S = 1.5
"""A connection without data for this long is reopened: the other end may have been unplugged."""
_PATIENCE_S = 2.0
HANGS_S = 1.0
"""A reader hangs in a driver or a decoder if this long after its usual longest wait it has still not checked whether it
should stop."""
_LOOK_COUNTS_S = 0.6
"""What one look can add to the time without a check, just more than the interval of looks: while the program itself
stood still, or waited for a processor, no reader is blamed."""


class Closable(Protocol):
    """Something that can be closed, from any thread."""

    def close(self) -> object: ...


class DeviceLost(Exception):
    """A device that can no longer be opened or read; the text says which one and why, for the user."""


class ReaderStop:
    """Polled by the reader; set to stop it. asked_s: time of the last poll. device: what the reader holds that another
    one needs, such as a socket bound to a port; it is closed if the reader hangs."""

    def __init__(self) -> None:
        self._event = threading.Event()
        self.asked_s = time.monotonic()
        self.device: Closable | None = None

    def __bool__(self) -> bool:
        self.asked_s = time.monotonic()
        return self._event.is_set()

    def set(self) -> None:
        self._event.set()

    def wait(self, seconds: float) -> None:
        self.asked_s = time.monotonic() + seconds
        self._event.wait(seconds)


ReadDevice = Callable[[ReaderStop], None]
"""Opens a device and reads until it is lost (``DeviceLost``, ``OSError``), ends, or ``ReaderStop`` is set."""


class Reader:
    """Runs ``read`` in a thread, repeatedly. ``say`` receives the reason of a failure, and an empty text on success.
    worst_s: the longest that ``read`` usually takes from one check of whether it should stop to the next."""

    def __init__(self, name: str, read: ReadDevice, say: Callable[[str], None], worst_s: float) -> None:
        self._read, self._say, self._hangs_s = read, say, worst_s + HANGS_S
        self._stop = ReaderStop()
        self._logged = ""
        self._name = f"cipv-{name}"
        self.hung = 0
        """Number of restarts after a hang."""
        self._looked_s = self._asked_s = self._silent_s = 0.0
        self._thread = self._fresh()

    def start(self) -> None:
        self._stop.asked_s = self._looked_s = time.monotonic()
        self._thread.start()

    def look(self, now_s: float) -> None:
        """Restart the reader if it hangs; called twice a second. The hung thread cannot be terminated; if it ever
        continues, it ends without reporting anything."""
        asked_s = self._stop.asked_s
        passed_s, self._looked_s = now_s - max(self._looked_s, asked_s), now_s
        self._silent_s = max(0.0, min(passed_s, _LOOK_COUNTS_S)) + (self._silent_s if asked_s == self._asked_s else 0.0)
        self._asked_s = asked_s
        if not self._thread.is_alive() or self._silent_s <= self._hangs_s or self._stop:
            return
        logger.error("%s has not responded for %.1f s; restarting it", self._name, now_s - asked_s)
        self._stop.set()
        device = self._stop.device
        if device is not None:
            device.close()
        self.hung, self._stop = self.hung + 1, ReaderStop()
        self._thread = self._fresh()
        self._thread.start()

    def _fresh(self) -> threading.Thread:
        return threading.Thread(target=self._work, args=(self._stop,), name=self._name, daemon=True)

    def end(self) -> None:
        """Ask it to end."""
        self._stop.set()

    def join(self) -> None:
        """Wait briefly until it has ended: a driver that hangs must not hang the program."""
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(_PATIENCE_S)

    def _log_once(self, error: Exception) -> None:
        """With its traceback, but only once for a repeated error."""
        text = repr(error)
        if text != self._logged:
            logger.exception("while reading %s", self._thread.name)
        self._logged = text

    def _work(self, stop: ReaderStop) -> None:
        while not stop:
            text = self._tried(stop)
            if text and not stop:
                self._say(text)
            stop.wait(RETRY_S)

    def _tried(self, stop: ReaderStop) -> str:
        """The reason why reading ended."""
        try:
            self._read(stop)
        except DeviceLost as lost:
            return str(lost)
        except OSError as error:
            return error.strerror or str(error)
        except Exception as error:  # whatever a driver raises, the other sensors continue and this one is retried
            self._log_once(error)
            return f"{type(error).__name__}: {error}"
        return ""
