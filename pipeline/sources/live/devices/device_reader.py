"""A thread that reads one device while it is needed: opens it, reads it, and reopens it when the connection is lost."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

logger = logging.getLogger("cipv.live")

RETRY_S = 0.2
"""Interval between attempts to open a device, so that one that returns is open within a second."""
POLL_S = 0.2
"""Longest wait inside a read before it checks whether it should stop."""
CONNECT_S = 0.5
SILENCE_S = 1.5
"""A connection without data for this long is reopened: the other end may have been unplugged."""
_PATIENCE_S = 2.0
HANGS_S = 11.0
"""If a reader has not checked for this long whether it should stop, it hangs in a driver or a decoder: the longest wait
in normal operation is OpenCV's for a camera, 10 s, plus a second."""


class DeviceLost(Exception):
    """A device that can no longer be opened or read; the text says which one and why, for the user."""


class ReaderStop:
    """Polled by the reader; set to stop it. asked_s: time of the last poll."""

    def __init__(self) -> None:
        self._event = threading.Event()
        self.asked_s = time.monotonic()

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
    """Runs ``read`` in a thread, repeatedly. ``say`` receives the reason of a failure, and an empty text on success."""

    def __init__(self, name: str, read: ReadDevice, say: Callable[[str], None]) -> None:
        self._read, self._say = read, say
        self._stop = ReaderStop()
        self._logged = ""
        self._name = f"cipv-{name}"
        self.hung = 0
        """Number of restarts after a hang."""
        self._thread = self._fresh()

    def start(self) -> None:
        self._stop.asked_s = time.monotonic()
        self._thread.start()

    def look(self, now_s: float) -> None:
        """Restart the reader if it hangs. The hung thread cannot be terminated; if it ever continues, it ends without
        reporting anything."""
        hangs_s = now_s - self._stop.asked_s
        if not self._thread.is_alive() or hangs_s <= HANGS_S or self._stop:
            return
        logger.error("%s has not responded for %.0f s; restarting it", self._name, hangs_s)
        self._stop.set()
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
