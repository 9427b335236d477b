"""A thread that reads one device while it is wanted: opens it, reads it, and opens it again when it is lost."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

logger = logging.getLogger("cipv.live")

RETRY_S = 0.2
"""Between two tries to open a device: one that comes back is there again within a second."""
POLL_S = 0.2
"""Longest wait inside a read before it looks whether it is still wanted."""
CONNECT_S = 0.5
SILENCE_S = 1.5
"""A connection that says nothing for so long is opened anew: its other end may have been unplugged."""
_PATIENCE_S = 2.0


class DeviceLost(Exception):
    """A device that cannot be opened or read any more; the text says which and why, for a person."""


class Stop:
    """Asked by whoever reads, set when the reading shall end."""

    def __init__(self) -> None:
        self._event = threading.Event()

    def __bool__(self) -> bool:
        return self._event.is_set()

    def set(self) -> None:
        self._event.set()

    def wait(self, seconds: float) -> None:
        self._event.wait(seconds)


Read = Callable[[Stop], None]
"""Opens a device and reads it until it is lost (``DeviceLost``, ``OSError``), ends, or ``Stop`` is set."""


class Reader:
    """``read`` in a thread, again and again. ``say`` is told why it cannot, and an empty text when it can."""

    def __init__(self, name: str, read: Read, say: Callable[[str], None]) -> None:
        self._read, self._say = read, say
        self._stop = Stop()
        self._logged = ""
        self._thread = threading.Thread(target=self._work, name=f"cipv-{name}", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def end(self) -> None:
        """Ask it to end."""
        self._stop.set()

    def join(self) -> None:
        """Wait a little until it has ended: a driver that hangs must not hang the program."""
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(_PATIENCE_S)

    def _log_once(self, error: Exception) -> None:
        """With its traceback, but not five times a second."""
        text = repr(error)
        if text != self._logged:
            logger.exception("while reading %s", self._thread.name)
        self._logged = text

    def _work(self) -> None:
        while not self._stop:
            try:
                self._read(self._stop)
            except DeviceLost as lost:
                self._say(str(lost))
            except OSError as error:
                self._say(error.strerror or str(error))
            except Exception as error:  # whatever a driver throws, the other sensors go on and this one is tried again
                self._log_once(error)
                self._say(f"{type(error).__name__}: {error}")
            self._stop.wait(RETRY_S)
