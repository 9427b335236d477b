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


def choose(
    seconds: Seconds, count: int, per_drive: int, is_known: Callable[[str, int, int], bool] = lambda *_: False
) -> list[ChosenSecond]:
    """At most so many seconds, in order of choice.

    Args:
        seconds: of a run.
        count: how many. per_drive: how many of one drive.
        is_known: asked with the address, first and last frame: seconds that need no label, for example because they
            have one.
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
            free = (each for each in orders[reason] if _is_free(seconds, each, taken, used, per_drive, is_known))
            place = next(free, None)
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


def _is_free(
    seconds: Seconds,
    place: int,
    taken: dict[int, list[int]],
    used: Counter[int],
    per_drive: int,
    is_known: Callable[[str, int, int], bool],
) -> bool:
    drive, second = int(seconds.drive[place]), int(seconds.second[place])
    if used[drive] >= per_drive or any(abs(second - other) < APART_S for other in taken.get(drive, ())):
        return False
    return not is_known(seconds.addresses[drive], int(seconds.first[place]), int(seconds.last[place]))
