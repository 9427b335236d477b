"""Finding the timestamped value that is nearest to a time, or the last one before it."""

from __future__ import annotations

from typing import Generic, TypeVar

import numpy as np
import numpy.typing as npt

Value = TypeVar("Value")
Times = npt.NDArray[np.int64]


def nearest(times_ns: Times, t_ns: int, within_ns: int) -> int | None:
    """Index of the time nearest to ``t_ns`` in ascending times, the earlier one if two are equally near; None if none
    is within ``within_ns``."""
    at = int(np.searchsorted(times_ns, t_ns))
    around = [index for index in (at - 1, at) if 0 <= index < len(times_ns)]
    best = min(around, key=lambda index: abs(int(times_ns[index]) - t_ns), default=None)
    return best if best is not None and abs(int(times_ns[best]) - t_ns) <= within_ns else None


class Timeline(Generic[Value]):
    """Values sorted by time; they may be passed in any order."""

    def __init__(self, times_ns: list[int], values: list[Value]) -> None:
        order = np.argsort(np.asarray(times_ns, dtype=np.int64), kind="stable")
        self.times_ns: Times = np.asarray(times_ns, dtype=np.int64)[order]
        self._values = [values[index] for index in order]

    def __len__(self) -> int:
        return len(self._values)

    def latest(self, t_ns: int, within_ns: int) -> Value | None:
        """The last value at or before ``t_ns``; None if it is older than ``within_ns``."""
        at = int(np.searchsorted(self.times_ns, t_ns, side="right")) - 1
        return self._values[at] if at >= 0 and t_ns - int(self.times_ns[at]) <= within_ns else None
