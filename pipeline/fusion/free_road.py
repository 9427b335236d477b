"""Determines how the LiDAR's rays towards a position ended: at it, beyond it, before it, or without a return.

A position is a sector of the road ahead: as wide as most of a vehicle's body, and as deep as its distance is uncertain.
It is examined in slices of two metres, each between the heights where every vehicle is solid. Only if rays crossed
every slice at such a height is anything known about the whole position.

A ray that returned from behind a slice passed through it. A ray without a return passed through it as well, if its
sensor works: its ring has returns elsewhere, other rings have some in this sector, and nothing stands before the
position or right behind it. Wet black paint absorbs some rays, so missing returns are counted separately.

A return in a cluster belongs to the object of that cluster. The object in question has none, so the return is not its
own.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numba
import numpy as np

from pipeline.common.geometry import F64
from pipeline.common.made_sweep import made_sweep
from pipeline.fusion.vehicle_sizes import usual_size_m
from pipeline.types import F32, I32, U8, FusedObject, Ground, Point3

_BODY_LOW_M, _BODY_HIGH_M = 0.3, 1.2
"""Heights above the road between which every vehicle is solid: below is air, above is glass."""
_BODY_SHARE = 0.7
"""Share of its width; the sides may be off by the box's error."""
MIN_RAYS = 3
"""Fewer rays may be a speck of dirt or a mixed pixel."""
CLEAR_SHARE = 0.8
"""A place is free if this share of the rays that reached it passed through."""
_SILENT_RAYS = 10
"""Minimum number of rays without a return for this to be evidence: two rings, 1° each."""
_SILENT_FROM_M, _SILENT_M = 30.0, 36.0
"""Closer than the first, the body of a vehicle returns rays whatever its paint: measured for vehicles within 30 m (see
``existence``), whose position uncertainty extends to the second. Missing returns say nothing of an object that is, or
may be, farther away, its tail included: a vehicle that the LiDAR follows may leave its reach there."""
NEAR_M = 20.0
"""Closer than this, every vehicle has a cluster: of 47 labelled ones on Astyx and KITTI, none was seen by the camera
alone."""
_SLICE_M, _MOST_SLICES = 2.0, 24
_BINS = 256
"""Directions by which points are sorted, so that each is compared only with places in its direction."""
_AHEAD = 0.5
"""Elevations of the rings are measured within 27° of straight ahead (as a tangent)."""
_MIN_RING = 5
"""Number of returns of a ring ahead needed to determine its elevation."""
_SIGMAS, _MARGIN_M = 2.0, 1.0
"""The searched range extends this many standard deviations plus a metre to either side of the reported distance."""
_TAIL_SIGMAS = 1.5
"""What stands above the road in the object's direction, up to so many more standard deviations beyond that range, may
be the object itself, so a ray that ended there says nothing: a box drawn too high stays so for seconds."""
_FLANK_M = 3.0
"""If a vehicle stands at an angle, its middle is up to this much farther than its nearest corner."""


class SweepRays(Protocol):
    """The parts of a sweep that are needed to evaluate its rays."""

    @property
    def points(self) -> F32:
        """(N, 4) float32 ``x y z intensity``, ego frame."""
        ...

    @property
    def kind(self) -> I32:
        """(N,) int32 classification of each point: 0 and above is the number of its cluster."""
        ...

    @property
    def ring(self) -> U8:
        """(N,) uint8, the channel of each point."""
        ...

    @property
    def ground(self) -> Ground | None:
        """The road; None without a sweep."""
        ...

    @property
    def origin(self) -> Point3:
        """Ego x y z of the sensor."""
        ...


class Rays(NamedTuple):
    """Where the rays towards one place ended, at body height. The place is divided into slices."""

    through: float
    """Rays that passed through; minimum over all slices."""
    stopped: float
    """Rays that ended in the place without belonging to a cluster; sum over all slices."""
    taken: float
    """Rays that ended in the place in the cluster of another object; sum over all slices."""
    clear: float
    """Share of the rays reaching a slice that came back from behind it; minimum over all slices."""
    silent: float
    """Like ``through``, including rays without a return."""
    silent_share: float
    """Like ``clear``, including rays without a return."""

    @property
    def is_free(self) -> bool:
        """Whether the rays show that nothing is there."""
        return self.through >= MIN_RAYS and self.clear >= CLEAR_SHARE

    @property
    def is_silent(self) -> bool:
        """Whether a vehicle there would have to absorb nearly all rays."""
        return self.silent >= _SILENT_RAYS and self.stopped + self.taken < MIN_RAYS

    @property
    def is_stopped(self) -> bool:
        """Whether rays ended there that may belong to the object."""
        return self.stopped >= MIN_RAYS

    @property
    def is_taken(self) -> bool:
        """Whether all rays that ended there belong to other objects."""
        return self.taken >= MIN_RAYS and not self.is_stopped

    @property
    def free_share(self) -> float | None:
        """Share of the rays reaching the place that passed through; None if too few reached it."""
        if self.through + self.stopped + self.taken >= MIN_RAYS:
            return self.clear
        return self.silent_share if self.silent >= _SILENT_RAYS else None


class _Beams(NamedTuple):
    """The rings of a sweep."""

    slope: F64
    """(C,) height over distance ahead; NaN for a ring with too few returns."""
    step_rad: float
    """Angle between two rays of a ring."""


def rays_to(objects: tuple[FusedObject, ...], sweep: SweepRays) -> dict[int, Rays]:
    """Where the rays ended towards each object without a LiDAR cluster, by object id."""
    asked = [item for item in objects if not item.seen_by_lidar and item.closest_point is not None and item.distance_m]
    if not asked or not len(sweep.points) or sweep.ground is None:
        return {}
    origin = sweep.origin
    places = np.array([_place(item, origin) for item in asked])
    tails = np.array([_TAIL_SIGMAS * (item.distance_sigma_m or 0.0) for item in asked])
    ends = np.concatenate([places[:, :2] * places[:, 2:3], places[:, :2] * places[:, 3:4]]) + np.array(origin[:2])
    road = sweep.ground.height(ends).reshape(2, -1).T - origin[2]
    at = np.asarray(origin, dtype=np.float64)
    beams = _beams(sweep.points, sweep.ring, at)
    wanted = np.concatenate([places, road, tails[:, None]], axis=1)
    rows = _count(
        sweep.points, sweep.ring, sweep.kind, at, wanted, beams.slope, beams.step_rad, _SILENT_FROM_M, _SILENT_M
    )
    return {item.id: Rays(*row) for item, row in zip(asked, rows.tolist(), strict=True)}


def _place(item: FusedObject, origin: Point3) -> tuple[float, float, float, float, float]:
    """Direction from the LiDAR (unit x, y), minimum and maximum distance along it at which the object may begin, and
    the tangent of half the angle that its body covers."""
    assert item.closest_point is not None
    x, y = item.closest_point[0] - origin[0], item.closest_point[1] - origin[1]
    range_m = max(math.hypot(x, y), 0.1)
    spare = _SIGMAS * (item.distance_sigma_m or 0.0) + _MARGIN_M
    half_m = _BODY_SHARE * usual_size_m(item.label or "car")[1] / 2
    return x / range_m, y / range_m, max(range_m - spare, 0.5), range_m + spare, half_m / range_m


def _beams(points: F32, ring: U8, origin: F64) -> _Beams:
    slope, fullest = _slopes(points, ring, origin)
    steps = np.diff(np.sort(np.arctan2(fullest[:, 1], fullest[:, 0])))
    half = len(steps) // 2
    if not len(steps):
        return _Beams(slope, math.inf)
    low, high = np.partition(steps, (half - 1, half))[[half - 1, half]].tolist() if half else steps[[0, 0]].tolist()
    step_rad = high if len(steps) % 2 else (low + high) / 2
    return _Beams(slope, step_rad if step_rad > 0.0 else math.inf)  # most in one direction: a damaged sweep


def warm_up() -> None:
    """Compile the kernels."""
    place = np.array([[1.0, 0.0, 1.0, 2.0, 1.0, 0.0, 0.0, 0.0]])
    kind, origin = np.zeros(2, np.int32), np.zeros(3)
    points, ring = made_sweep()
    slope, _ = _slopes(points, ring, origin)
    _count(points, ring, kind, origin, place, slope, 0.1, _SILENT_FROM_M, _SILENT_M)


@numba.njit(cache=True, nogil=True)
def _slopes(points, ring, origin):  # type: ignore[no-untyped-def]  # pragma: no cover
    """(C,) mean height over distance of each ring ahead, and x y (M, 2) of the points of the fullest ring, relative to
    ``origin``."""
    rings = int(ring.max()) + 1
    total, count, size = np.zeros(rings), np.zeros(rings), np.zeros(rings, np.int64)
    for i in range(len(points)):
        x, y, z = points[i, 0] - origin[0], points[i, 1] - origin[1], points[i, 2] - origin[2]
        size[ring[i]] += 1
        if x > 0.0 and abs(y) < _AHEAD * x:
            total[ring[i]] += z / np.hypot(x, y)
            count[ring[i]] += 1.0
    for c in range(rings):
        total[c] = total[c] / count[c] if count[c] >= _MIN_RING else np.nan
    fullest, found = size.argmax(), 0
    xy = np.empty((size[fullest], 2))
    for i in range(len(points)):
        if ring[i] == fullest:
            xy[found, 0], xy[found, 1] = points[i, 0] - origin[0], points[i, 1] - origin[1]
            found += 1
    return total, xy


@numba.njit(cache=True, nogil=True)
def _diamond(x, y):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Number of the direction's bin: grows with the angle from behind over the right, ahead and the left to behind,
    without a trigonometric function."""
    away = abs(x) + abs(y)
    part = y / away if away > 0.0 else 0.0
    if x < 0.0:
        part = 2.0 - part if y >= 0.0 else -2.0 - part
    return min(max(int((part + 2.0) * (0.25 * _BINS)), 0), _BINS - 1)


@numba.njit(cache=True, nogil=True)
def _by_direction(places):  # type: ignore[no-untyped-def]  # pragma: no cover
    """The places (K, 8), as in ``_count``, that may lie in each direction: those of bin b are
    ``which[first[b] : first[b + 1]]``."""
    reached = np.zeros((_BINS, len(places)), np.bool_)
    for k in range(len(places)):
        ux, uy, half = places[k, 0], places[k, 1], places[k, 4]
        at, last = _diamond(ux + uy * half, uy - ux * half) - 1, _diamond(ux - uy * half, uy + ux * half) + 1
        for b in range(at, last + 1 if last >= at else last + 1 + _BINS):
            reached[b % _BINS, k] = True
    first, which = np.zeros(_BINS + 1, np.int64), np.empty(reached.sum(), np.int64)
    for b in range(_BINS):
        first[b + 1] = first[b]
        for k in range(len(places)):
            if reached[b, k]:
                which[first[b + 1]] = k
                first[b + 1] += 1
    return first, which


@numba.njit(cache=True, nogil=True)
def _slices(places):  # type: ignore[no-untyped-def]  # pragma: no cover
    """The slices of the places (K, 8), as in ``_count``: (K,) their number, and (K, most) for each the distance of its
    middle and the height of the road there above that at the near end."""
    counts = np.empty(len(places), np.int64)
    middles, roads = np.empty((len(places), _MOST_SLICES)), np.empty((len(places), _MOST_SLICES))
    for k in range(len(places)):
        near, deep = places[k, 2], places[k, 3] - places[k, 2]
        counts[k] = min(max(int(np.ceil(deep / _SLICE_M)), 1), _MOST_SLICES)
        half = 0.5 * deep / counts[k]
        for b in range(counts[k]):
            middles[k, b] = near + (2 * b + 1) * half
            roads[k, b] = (places[k, 6] - places[k, 5]) * (middles[k, b] - near) / deep
    return counts, middles, roads


@numba.njit(cache=True, nogil=True)
def _count(points, ring, kind, origin, places, slope, step_rad, silent_from_m, silent_m):  # type: ignore[no-untyped-def]  # pragma: no cover
    """(K, 6) fields of ``Rays`` for (K, 8) places: unit x, y, near, far, tangent of half the angle, height of the road
    at near and far, and how far beyond far the object may be, all relative to ``origin``. slope, step_rad: beams."""
    out = np.zeros((len(places), 6))
    through, stopped = np.zeros((len(places), _MOST_SLICES)), np.zeros((len(places), _MOST_SLICES))
    taken = np.zeros((len(places), _MOST_SLICES))
    seen, hidden = np.zeros((len(places), len(slope))), np.zeros(len(places))
    first, which = _by_direction(places)
    counts, middles, roads = _slices(places)
    for i in range(len(points)):
        x, y, z = points[i, 0] - origin[0], points[i, 1] - origin[1], points[i, 2] - origin[2]
        towards = _diamond(x, y)
        for k in which[first[towards] : first[towards + 1]]:
            along = x * places[k, 0] + y * places[k, 1]
            if along <= 0.0 or abs(y * places[k, 0] - x * places[k, 1]) > places[k, 4] * along:
                continue
            seen[k, ring[i]] += 1.0
            near, deep = places[k, 2], places[k, 3] - places[k, 2]
            over_road = z - places[k, 5] - (places[k, 6] - places[k, 5]) * (along - near) / deep
            beyond = along - places[k, 3]
            hidden[k] += over_road > _BODY_LOW_M and (along < near or 0.0 < beyond < _FLANK_M)
            if over_road > _BODY_LOW_M and 0.0 < beyond < places[k, 7]:
                continue
            half = 0.5 * deep / counts[k]
            for b in range(counts[k]):
                at = middles[k, b]
                if at - half > along:  # it ended before this slice and all behind it
                    break
                height = z * at / along - places[k, 5] - roads[k, b]
                if _BODY_LOW_M <= height <= _BODY_HIGH_M:
                    through[k, b] += along > at + half
                    stopped[k, b] += kind[i] < 0 and at - half <= along <= at + half
                    taken[k, b] += kind[i] >= 0 and at - half <= along <= at + half
    for k in range(len(places)):
        is_near = 0.5 * (places[k, 2] + places[k, 3]) <= silent_from_m and places[k, 3] + places[k, 7] <= silent_m
        rays, live = 2.0 * places[k, 4] / step_rad, is_near and seen[k].sum() >= MIN_RAYS and hidden[k] < MIN_RAYS
        out[k, 0] = out[k, 3] = out[k, 4] = out[k, 5] = np.inf
        for b in range(counts[k]):
            at = middles[k, b]
            silent = 0.0
            for c in range(len(slope)):
                height = slope[c] * at - places[k, 5] - roads[k, b]
                if live and _BODY_LOW_M <= height <= _BODY_HIGH_M:
                    silent += max(rays - seen[k, c], 0.0)
            passed, ended = through[k, b] + silent, stopped[k, b] + taken[k, b]
            out[k, 0] = min(out[k, 0], through[k, b])
            out[k, 1] += stopped[k, b]
            out[k, 2] += taken[k, b]
            out[k, 3] = min(out[k, 3], through[k, b] / max(through[k, b] + ended, 1.0))
            out[k, 4] = min(out[k, 4], passed)
            out[k, 5] = min(out[k, 5], passed / max(passed + ended, 1.0))
    return out
