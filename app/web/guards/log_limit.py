"""Limits how often libraries log the same line: clients decide how often that happens.

Without descriptors asyncio reports each connection that it cannot accept with a traceback, thousands a second, and
uvicorn each request that is none, websockets each message that viser does not understand: logs would fill the disk
that recordings are on.
"""

from __future__ import annotations

import asyncio
import logging
import time

PERIOD_S = 60.0
LOGGERS = ("asyncio", "uvicorn.error")
_MOST_KNOWN = 200


class OncePerPeriod(logging.Filter):
    """Drops a message that was logged within the last ``PERIOD_S``, any beyond 200 messages in that time, and requests
    that end with the server, which are no errors."""

    def __init__(self) -> None:
        super().__init__()
        self._said_s: dict[str, float] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        if record.exc_info is not None and isinstance(record.exc_info[1], asyncio.CancelledError):
            return False
        text, now_s = record.getMessage(), time.monotonic()
        self._said_s = {each: at_s for each, at_s in self._said_s.items() if now_s - at_s < PERIOD_S}
        if text in self._said_s or len(self._said_s) >= _MOST_KNOWN:
            return False
        self._said_s[text] = now_s
        return True


_ONCE = OncePerPeriod()
_ONCE_OF_THE_REST = OncePerPeriod()
"""For all loggers without a handler of their own, whose messages Python's last resort prints. Its own memory, because
messages of ``LOGGERS`` may have been counted already."""


def limit_logs() -> None:
    """Install the limits for this process; may be called repeatedly."""
    for name in LOGGERS:
        logging.getLogger(name).addFilter(_ONCE)
    if logging.lastResort is not None:
        logging.lastResort.addFilter(_ONCE_OF_THE_REST)
