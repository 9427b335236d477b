"""The health of a live sensor: rate, age, jitter and loss, computed only from the data that arrived."""

from __future__ import annotations

import math
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable
from typing import Literal

import numpy as np

from pipeline.formats.velodyne import say_refused
from pipeline.types import StreamHealth

_SILENT_NS, _STALE_NS, _MISSED = 1_000_000_000, 250_000_000, 3
"""Without messages for this time and this many of its periods, a sensor is silent, or before that stale."""
_WINDOW_NS = 3_000_000_000
_FEWEST = 3
_KEPT = 1024
_SAID_S = 60.0
"""How long a restart is reported, as that of other workers."""

Sensor = Literal["lidar", "camera", "gnss", "ego"]


class StreamStats:
    """Counts one sensor's messages. Times are on the host's timeline. note: message of its reader (why a device cannot
    be opened, source of its times). hung: how often its driver or decoder hung and was restarted. refused: packets by
    reason. remarks: functions that return additional messages, or an empty text. warnings: those about what is wrong at
    present although the sensor delivers."""

    def __init__(self, sensor: Sensor) -> None:
        self.sensor: Sensor = sensor
        self.note = ""
        self.lost = self.hung = 0
        self._hung_s = -math.inf
        self.refused: Counter[str] = Counter()
        self.remarks: tuple[Callable[[], str], ...] = ()
        self.warnings: tuple[Callable[[], str], ...] = ()
        self._arrived: deque[int] = deque(maxlen=_KEPT)
        self._newest_ns: int | None = None

    def arrived(self, now_ns: int, t_ns: int) -> None:
        """A message arrived now, measured at ``t_ns``."""
        self._arrived.append(now_ns)
        self._newest_ns = t_ns

    def was_restarted(self, times: int) -> None:
        """Its readers have been restarted this often after a hang."""
        if times > self.hung:
            self.hung, self._hung_s = times, time.monotonic()

    def warning(self) -> str:
        """A sentence for every page, that stays the same as long as nothing changes; empty if all is well."""
        hung = "hung and was restarted" if time.monotonic() - self._hung_s < _SAID_S else ""
        text = "; ".join(text for text in (hung, *(ask() for ask in self.warnings)) if text)
        return f"{self.sensor}: {text}" if text else ""

    def since_ns(self, now_ns: int) -> int | None:
        """Time since the last message; None before the first."""
        return now_ns - self._arrived[-1] if self._arrived else None

    def period_ns(self) -> int | None:
        """Median of the last intervals between messages; None until there are enough."""
        times = np.array(list(self._arrived)[-16:])
        return int(np.median(np.diff(times))) if len(times) >= _FEWEST else None

    def health(self, now_ns: int, impossible: int = 0) -> StreamHealth:
        """Current health. impossible: messages refused because their timestamps are too old or in the future.

        Rate and jitter are computed over the last three seconds and are None with fewer than three messages; jitter is
        the standard deviation of the intervals between arrivals.
        """
        arrived = list(self._arrived)  # copied, because a reader thread may append meanwhile
        times = np.array([t for t in arrived if now_ns - t <= _WINDOW_NS], dtype=np.int64)
        gaps_ms = np.diff(times) / 1e6
        enough = len(times) >= _FEWEST and gaps_ms.sum() > 0
        return StreamHealth(
            self.sensor,
            self._state(now_ns),
            rate_hz=float(len(gaps_ms) / (gaps_ms.sum() / 1e3)) if enough else None,
            age_ms=(now_ns - self._newest_ns) / 1e6 if self._newest_ns is not None else None,
            jitter_ms=float(gaps_ms.std()) if enough else None,
            lost=self.lost,
            note=self._said(impossible),
        )

    def _state(self, now_ns: int) -> Literal["ok", "stale", "silent", "absent"]:
        since = self.since_ns(now_ns)
        if since is None:
            return "absent"
        missed_ns = _MISSED * (self.period_ns() or 0)
        if since >= max(_SILENT_NS, missed_ns):
            return "silent"
        return "stale" if since >= max(_STALE_NS, missed_ns) else "ok"

    def _said(self, impossible: int) -> str:
        refused = say_refused(self.refused.copy())  # copied, because a reader thread may add a reason meanwhile
        times = f"{impossible} refused: impossible timestamp" if impossible else ""
        again = f"hung {self.hung} {'time' if self.hung == 1 else 'times'} and was restarted" if self.hung else ""
        return "; ".join(text for text in (self.note, again, *(ask() for ask in self.remarks), times, refused) if text)


def not_delivering(streams: Iterable[StreamHealth]) -> str:
    """``lidar absent (no data on UDP port 2368 yet), camera silent``: the sensors that do not deliver, in a sentence
    that stays the same as long as this does not change; empty if all deliver."""
    bad = (each for each in streams if each.state != "ok")
    return ", ".join(f"{each.sensor} {each.state}" + (f" ({each.note})" if each.note else "") for each in bad)
