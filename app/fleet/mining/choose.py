"""Chooses seconds to label: of each reason the most telling ones in turn, spread over drives."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.fleet.mining.seconds import Seconds

LEAST = {"disagreement": 3.0, "margin": 0.5, "consistency": 1.0, "novelty": 1.0}
"""By reason: values below this are no reason."""
TEXTS = {
    "disagreement": "camera and LiDAR disagree ({:.1f} σ)",
    "margin": "close to even odds of being in the path ({:.0%})",
    "consistency": "the lead contradicts its neighbouring frames ({:.1f})",
    "novelty": "unlike other drives ({:.1f} σ)",
}
APART_S = 3
"""Two chosen seconds of a drive are at least so far apart: neighbours teach the same."""


@dataclass(frozen=True)
class ChosenSecond:
    """A second that is worth labeling."""

    address: str
    """Of the recording."""
    second: int
    """Since its first frame."""
    first: int
    """First frame."""
    last: int
    """Last frame, included."""
    reason: str
    """One of ``LEAST``."""
    value: float
    """Of that reason."""

    @property
    def text(self) -> str:
        """The reason, for people."""
        return TEXTS[self.reason].format(self.value)


def _never(address: str, first: int, last: int) -> bool:
    return False


def choose(
    seconds: Seconds,
    count: int,
    per_drive: int,
    is_known: Callable[[str, int, int], bool] = _never,
    is_queued: Callable[[str, int, int], bool] = _never,
) -> list[ChosenSecond]:
    """At most so many seconds, in order of choice.

    Args:
        seconds: of a run.
        count: how many. per_drive: how many of one drive.
        is_known: asked with the address, first and last frame: seconds that need no label, for example because they
            have one.
        is_queued: asked in the same way whether any of the frames has been chosen before: seconds within ``APART_S``
            of those are left out, too.
    """
    orders = {}
    for reason, least in LEAST.items():
        values = seconds.values[reason]
        order = np.lexsort((seconds.second, seconds.drive, -values))
        orders[reason] = iter([int(place) for place in order if values[place] >= least])
    chosen: list[ChosenSecond] = []
    taken: dict[int, list[int]] = {}
    used: Counter[int] = Counter()
    while orders and len(chosen) < count:
        for reason in tuple(orders):
            free = (each for each in orders[reason] if _is_free(seconds, each, taken, used, per_drive))
            new = (each for each in free if not _is_near_queued(seconds, each, is_queued))
            place = next((each for each in new if not _is_known(seconds, each, is_known)), None)
            if place is None:
                del orders[reason]
                continue
            drive = int(seconds.drive[place])
            taken.setdefault(drive, []).append(int(seconds.second[place]))
            used[drive] += 1
            chosen.append(
                ChosenSecond(
                    seconds.addresses[drive],
                    int(seconds.second[place]),
                    int(seconds.first[place]),
                    int(seconds.last[place]),
                    reason,
                    float(seconds.values[reason][place]),
                )
            )
            if len(chosen) == count:
                break
    return chosen


def _is_free(seconds: Seconds, place: int, taken: dict[int, list[int]], used: Counter[int], per_drive: int) -> bool:
    drive, second = int(seconds.drive[place]), int(seconds.second[place])
    return used[drive] < per_drive and all(abs(second - other) >= APART_S for other in taken.get(drive, ()))


def _is_near_queued(seconds: Seconds, place: int, is_queued: Callable[[str, int, int], bool]) -> bool:
    drive, second = seconds.drive[place], seconds.second[place]
    near = slice(max(0, place - APART_S + 1), place + APART_S)  # seconds are in order, but some may be missing
    is_near = (seconds.drive[near] == drive) & (np.abs(seconds.second[near] - second) < APART_S)
    first, last = int(seconds.first[near][is_near].min()), int(seconds.last[near][is_near].max())
    return is_queued(seconds.addresses[drive], first, last)


def _is_known(seconds: Seconds, place: int, is_known: Callable[[str, int, int], bool]) -> bool:
    address = seconds.addresses[int(seconds.drive[place])]
    return is_known(address, int(seconds.first[place]), int(seconds.last[place]))
