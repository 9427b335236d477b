"""Combines messages into ticks: a tick is a LiDAR sweep with the image and ego motion nearest to it in time.

Without a LiDAR, each image is a tick; without a camera, the LiDAR works alone. Nothing is queued: a tick that nobody
took is replaced by the next. This module uses neither threads nor a clock; the caller passes the time, on the host's
timeline.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from itertools import pairwise
from typing import Generic, TypeVar

from pipeline.params import SyncParams
from pipeline.types import EgoState, GnssFix, Sweep

T = TypeVar("T")
P = TypeVar("P")

_PAST_NS, _FUTURE_NS = 2_000_000_000, 200_000_000
"""A message with a timestamp outside these bounds around now is damaged, or the sensor's clock was set."""
_PATIENCE_NS, _LONGEST_PATIENCE_NS = 250_000_000, 1_000_000_000
"""The LiDAR is waited for during three of its periods, within these bounds, before the camera triggers ticks
instead."""
_KEPT, _IMAGES_KEPT = 64, 24
"""Images are large; this many are 0.4 s of a 60 Hz camera, and a sweep is 0.05 s old when it is complete."""
_HELD_PERIODS, _HELD_AT_LEAST_NS, _HELD_UNKNOWN_NS = 1.5, 500_000_000, 1_500_000_000
"""Own motion is valid for this many periods of its source; a receiver that sends once a second is a second old before
its next message. The last is for a source with only one message so far."""


@dataclass(frozen=True)
class Stamped(Generic[T]):
    """A sensor's message."""

    t_ns: int
    """When it was measured, by the drive's clock."""
    value: T
    """What was measured."""
    arrived_ns: int
    """When it arrived, by this machine's clock."""


class SensorBuffer(Generic[T]):
    """Recent messages of one sensor, in order of time. taken: accepted messages, including ``late`` ones that arrived
    out of order. duplicates, implausible: refused messages, by reason."""

    def __init__(self, keep: int = _KEPT) -> None:
        self._keep = keep
        self._kept: list[Stamped[T]] = []
        self.taken = self.late = self.duplicates = self.implausible = 0

    def add(self, t_ns: int, value: T, now_ns: int) -> bool:
        """Add a message; false if it is a duplicate or its time is impossible. A message that arrived out of order is
        inserted at its position."""
        if not now_ns - _PAST_NS <= t_ns <= now_ns + _FUTURE_NS:
            self.implausible += 1
            return False
        place = bisect_left(self._kept, t_ns, key=lambda item: item.t_ns)
        if place < len(self._kept) and self._kept[place].t_ns == t_ns:
            self.duplicates += 1
            return False
        self.taken += 1
        self.late += place < len(self._kept)
        self._kept.insert(place, Stamped(t_ns, value, now_ns))
        del self._kept[: -self._keep]
        while self._kept and self._kept[0].t_ns < now_ns - _PAST_NS:
            del self._kept[0]
        return True

    def newest(self) -> Stamped[T] | None:
        return self._kept[-1] if self._kept else None

    def nearest(self, t_ns: int) -> Stamped[T] | None:
        """The message whose time is nearest; of two equally near, the later one."""
        place = bisect_left(self._kept, t_ns, key=lambda item: item.t_ns)
        around = self._kept[max(0, place - 1) : place + 1]
        return min(reversed(around), key=lambda item: abs(item.t_ns - t_ns), default=None)

    def period_ns(self) -> int | None:
        """The usual interval between messages; None with fewer than two."""
        steps = sorted(later.t_ns - earlier.t_ns for earlier, later in pairwise(self._kept))
        return steps[len(steps) // 2] if steps else None


@dataclass(frozen=True)
class Together(Generic[P]):
    """The messages of one tick."""

    t_ns: int
    """Time of the message that triggers the tick."""
    arrived_ns: int
    """When that message was complete."""
    sweep: Stamped[Sweep] | None
    """None when the LiDAR is missing."""
    image: Stamped[P] | None
    """The image nearest in time; None when the camera is missing."""
    skew_ns: int | None
    """Image minus sweep; None without both."""
    ego: EgoState | None
    """Ego motion at ``t_ns``; None when too old."""
    gnss: GnssFix | None
    """The newest fix; None when too old."""
    replaced: int
    """Number of earlier ticks that were not taken in time."""
    notes: tuple[str, ...]
    """What is missing and why."""


@dataclass(frozen=True)
class Upcoming(Generic[P]):
    """What is known of the next tick before its sweep is complete."""

    t_ns: int
    """When it will most likely be."""
    image: Stamped[P]
    """The image nearest to that time."""
    ego: EgoState | None
    """Own motion nearest to that time; None when too old."""


class Synchroniser(Generic[P]):
    """``P`` is the type of an image. A sensor that is not configured is simply never added."""

    def __init__(self) -> None:
        self.sweeps: SensorBuffer[Sweep] = SensorBuffer()
        self.images: SensorBuffer[P] = SensorBuffer(_IMAGES_KEPT)
        self.egos: SensorBuffer[EgoState] = SensorBuffer()
        self.fixes: SensorBuffer[GnssFix] = SensorBuffer()
        self._ticked_ns: int | None = None
        self._taken = (0, 0)

    def tick(self, now_ns: int, params: SyncParams) -> Together[P] | None:
        """The newest tick not returned yet; None if there is none, or its image is still pending."""
        sweep = self._newer(self.sweeps.newest())
        if sweep is not None:
            if self._image_is_coming(sweep, now_ns, params):
                return None
            return self._together(sweep, self._image_near(sweep.t_ns, params), params)
        if self.lidar_is_silent(now_ns):
            image = self._shifted(self.images.newest(), params)
            if self._newer(image) is not None:
                return self._together(None, image, params)
        return None

    def upcoming(self, now_ns: int, params: SyncParams) -> Upcoming[P] | None:
        """The image of the next tick, known before its sweep is complete: a sweep's time is the middle of its
        rotation, so the image nearest to it usually arrives first. None while a later image may still be nearer, and
        if the next sweep cannot be foreseen."""
        last, period_ns = self.sweeps.newest(), self.sweeps.period_ns()
        if last is None or period_ns is None or self._newer(last) is not None or self.lidar_is_silent(now_ns):
            return None
        t_ns = last.t_ns + period_ns
        newest, image = self._shifted(self.images.newest(), params), self._image_near(t_ns, params)
        if newest is None or image is None or abs(image.t_ns - t_ns) > params.max_skew_ms * 1e6:
            return None
        until_next_ns = self.images.period_ns()
        if newest.t_ns < t_ns and (until_next_ns is None or newest.t_ns + until_next_ns - t_ns < t_ns - newest.t_ns):
            return None
        return Upcoming(t_ns, image, _nearest_valid(self.egos, t_ns, params.ego_offset_ms))

    def lidar_is_silent(self, now_ns: int) -> bool:
        """Whether there was no sweep for three of its periods, or never one."""
        last = self.sweeps.newest()
        if last is None:
            return True
        before = self.sweeps.nearest(last.t_ns - 1)
        period_ns = last.t_ns - before.t_ns if before is not None else 0
        return now_ns - last.arrived_ns > min(max(3 * period_ns, _PATIENCE_NS), _LONGEST_PATIENCE_NS)

    def _newer(self, item: Stamped[T] | None) -> Stamped[T] | None:
        """The message if it is later than the last tick: time never goes back."""
        is_new = item is not None and (self._ticked_ns is None or item.t_ns > self._ticked_ns)
        return item if is_new else None

    def _image_is_coming(self, sweep: Stamped[Sweep], now_ns: int, params: SyncParams) -> bool:
        """Whether the camera delivers, but none of its images is later than the sweep yet; then a short wait is
        worthwhile."""
        newest = self._shifted(self.images.newest(), params)
        if newest is None or newest.t_ns >= sweep.t_ns or now_ns - newest.arrived_ns > _PATIENCE_NS:
            return False
        return now_ns - sweep.arrived_ns < params.wait_ms * 1e6

    def _image_near(self, t_ns: int, params: SyncParams) -> Stamped[P] | None:
        offset_ns = round(params.camera_offset_ms * 1e6)
        return self._shifted(self.images.nearest(t_ns - offset_ns), params)

    def _shifted(self, image: Stamped[P] | None, params: SyncParams) -> Stamped[P] | None:
        """The image with the camera's offset added to its time."""
        if image is None:
            return None
        return Stamped(image.t_ns + round(params.camera_offset_ms * 1e6), image.value, image.arrived_ns)

    def _together(self, sweep: Stamped[Sweep] | None, image: Stamped[P] | None, params: SyncParams) -> Together[P]:
        leader: Stamped[Sweep] | Stamped[P] | None = sweep or image
        assert leader is not None
        self._ticked_ns = t_ns = leader.t_ns
        notes = []
        skew_ns = image.t_ns - t_ns if image is not None and sweep is not None else None
        if image is not None and skew_ns is not None and abs(skew_ns) > params.max_skew_ms * 1e6:
            notes.append(f"no image within {params.max_skew_ms:g} ms: the nearest is {skew_ns / 1e6:+.0f} ms off")
            image = skew_ns = None
        return Together(
            t_ns,
            leader.arrived_ns,
            sweep,
            image,
            skew_ns,
            ego=_nearest_valid(self.egos, t_ns, params.ego_offset_ms),
            gnss=_nearest_valid(self.fixes, t_ns, params.gnss_offset_ms),
            replaced=self._count_replaced(leader_is_sweep=sweep is not None),
            notes=tuple(notes),
        )

    def _count_replaced(self, leader_is_sweep: bool) -> int:
        """Number of triggering messages since the last tick that were not taken in time. Remembers its position."""
        sweeps, images = self._taken
        self._taken = (self.sweeps.taken, self.images.taken)
        return max(0, self.sweeps.taken - sweeps - 1 if leader_is_sweep else self.images.taken - images - 1)


def _nearest_valid(stream: SensorBuffer[T], t_ns: int, offset_ms: float) -> T | None:
    """The message of a sensor nearest to a time, with the sensor's offset; None if none is valid then."""
    at_ns = t_ns - round(offset_ms * 1e6)
    item = stream.nearest(at_ns)
    return item.value if item is not None and abs(item.t_ns - at_ns) <= _holds_for_ns(stream.period_ns()) else None


def _holds_for_ns(period_ns: int | None) -> float:
    return _HELD_UNKNOWN_NS if period_ns is None else max(_HELD_PERIODS * period_ns, _HELD_AT_LEAST_NS)
