"""Is an object really where it is said to be? What each sensor says for it and against it, as log-odds of existence.

For: a camera's box is worth what boxes of its score turned out to be worth; a LiDAR cluster is worth a great deal.
Against: rays of the LiDAR that passed through the place at the height of a car's body, and were returned by something
behind it. A working LiDAR that looks through a place says that nothing stands there, however sure a box is.

A sensor that could not know says nothing: no ray came that way at that height, or something nearer stopped it. Nothing
is multiplied up either: ten boxes in a row drawn by one network on one wall are hardly more than one, so the camera's
log-odds are those of its running mean score; only the LiDAR's sum up, between bounds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numba
import numpy as np

from pipeline.common.fast_replace import evolve
from pipeline.common.geometry import F64
from pipeline.fusion.vehicle_sizes import usual_size_m
from pipeline.params import ExistenceParams
from pipeline.types import F32, I64, FusedObject, Gate, Ground, Point3

SURE = 4.0
"""Log-odds beyond which nothing gets surer: 98 %."""
_EVEN_SCORE, _SCORE_SLOPE = 0.45, 8.5
"""Boxes of this score are a vehicle half of the time; the log-odds grow by the slope for each 1.0 of score. A logistic
fit to 1,473 boxes of YOLOX-nano on Astyx and KITTI, against labelled vehicles. With any one of the four recordings left
out: 0.40 to 0.52, and 7.7 to 10.1."""
_MEAN_S = 0.5
"""Over how long a box's score is averaged."""
_CLUSTER, _STOPPED, _PIERCED = 2.0, 1.0, -3.0
"""What one sweep adds: a cluster on the object; rays that ended where it is said to be; rays that passed through. A
vehicle that returns nothing while what stands behind it does is rare: e^−3 is one in twenty."""
_BODY_LOW_M, _BODY_HIGH_M = 0.3, 1.2
"""Heights over the road between which every vehicle is solid: under it is air, over it is glass."""
_BODY_SHARE = 0.7
"""Of its width; the sides may be off by the box's error."""
_MIN_RAYS = 3
"""Fewer may be one speck of dirt or one mixed pixel."""
_CLEAR_SHARE = 0.8
"""Of the rays that reached the place, so many passed through where it is free."""
_MARGIN_M = 1.0
_SIGMAS = 2.0
"""The place reaches this far to either side of the distance said."""


class Existence(NamedTuple):
    """Of one object, what earlier frames leave."""

    score: float | None
    """Running mean of its boxes' scores; None before the first."""
    lidar: float
    """The LiDAR's log-odds."""


@dataclass(frozen=True)
class ExistenceState:
    """By object id."""

    known: dict[int, Existence] = field(default_factory=dict)


class SweepRays(Protocol):
    """A sweep as far as its rays matter."""

    @property
    def points(self) -> F32:
        """(N, 4) float32 ``x y z intensity``, ego frame."""
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
    """How the rays towards one place ended."""

    through: int
    """Beyond it."""
    stopped: int
    """At it."""
    blocked: int
    """Before it."""

    @property
    def is_free(self) -> bool:
        """Whether they show that nothing stands there."""
        return self.through >= _MIN_RAYS and self.through >= _CLEAR_SHARE * (self.through + self.stopped)

    @property
    def clear_share(self) -> float | None:
        """Of those that reached the place, how many went on; None if too few did."""
        reached = self.through + self.stopped
        return self.through / reached if reached >= _MIN_RAYS else None


def weigh(
    state: ExistenceState,
    objects: tuple[FusedObject, ...],
    sweep: SweepRays,
    dt_s: float | None,
    params: ExistenceParams,
) -> tuple[ExistenceState, tuple[FusedObject, ...]]:
    """The objects with their ``existence`` and, where rays could tell, a gate that says what they told.

    dt_s: since the frame before, None at the first."""
    if not params.enabled:
        return ExistenceState(), objects
    rays = _rays_to(objects, sweep.points, sweep.ground, sweep.origin) if sweep.ground is not None else {}
    known: dict[int, Existence] = {}
    judged = []
    for item in objects:
        found = _updated(state.known.get(item.id, Existence(None, 0.0)), item, rays.get(item.id), dt_s)
        known[item.id] = found
        camera = (found.score - _EVEN_SCORE) * _SCORE_SLOPE if found.score is not None else 0.0
        odds = _bounded(_bounded(camera) + found.lidar)
        judged.append(_told(item, 1.0 / (1.0 + math.exp(-odds)), rays.get(item.id)))
    return ExistenceState(known), tuple(judged)


def _updated(before: Existence, item: FusedObject, rays: Rays | None, dt_s: float | None) -> Existence:
    score, lidar = before.score, before.lidar
    if item.seen_by_camera and item.score is not None:
        fresh = 1.0 - math.exp(-(dt_s or 0.0) / _MEAN_S)
        score = item.score if score is None else score + fresh * (item.score - score)
    if item.seen_by_lidar:
        lidar += _CLUSTER
    elif rays is not None and rays.is_free:
        lidar += _PIERCED
    elif rays is not None and rays.stopped >= _MIN_RAYS:
        lidar += _STOPPED
    return Existence(score, _bounded(lidar))


def _told(item: FusedObject, probability: float, rays: Rays | None) -> FusedObject:
    share = rays.clear_share if rays is not None else None
    if share is None or rays is None:
        return evolve(item, existence=probability)
    return evolve(
        item, existence=probability, gates=(*item.gates, Gate("free_road", share, _CLEAR_SHARE, not rays.is_free))
    )


def _bounded(odds: float) -> float:
    return min(max(odds, -SURE), SURE)


def _rays_to(objects: tuple[FusedObject, ...], points: F32, ground: Ground, origin: Point3) -> dict[int, Rays]:
    """How the rays towards each object ended that the LiDAR has no cluster of, by its id."""
    asked = [item for item in objects if not item.seen_by_lidar and item.closest_point is not None and item.distance_m]
    if not asked or not len(points):
        return {}
    places = np.array([_place(item, origin) for item in asked])
    ends = np.concatenate([places[:, :2] * places[:, 2:3], places[:, :2] * places[:, 3:4]]) + np.array(origin[:2])
    road = ground.height(ends).reshape(2, -1).T - origin[2]
    counts = _count(points, np.asarray(origin, dtype=np.float64), np.concatenate([places, road], axis=1))
    return {item.id: Rays(*row) for item, row in zip(asked, counts.tolist(), strict=True)}


def _place(item: FusedObject, origin: Point3) -> tuple[float, float, float, float, float]:
    """Direction from the LiDAR (unit x, y), from how far to how far along it the object may begin, and half the angle
    that its body takes, as a tangent."""
    assert item.closest_point is not None
    x, y = item.closest_point[0] - origin[0], item.closest_point[1] - origin[1]
    range_m = max(math.hypot(x, y), 0.1)
    spare = _SIGMAS * (item.distance_sigma_m or 0.0) + _MARGIN_M
    half_m = _BODY_SHARE * usual_size_m(item.label or "car")[1] / 2
    return x / range_m, y / range_m, max(range_m - spare, 0.5), range_m + spare, half_m / range_m


def warm_up() -> None:
    """Compile the kernel."""
    _count(np.zeros((1, 4), np.float32), np.zeros(3), np.ones((1, 7)))


@numba.njit(cache=True, nogil=True)
def _count(points: F32, origin: F64, places: F64) -> I64:
    """(K, 3) rays through, stopped at and blocked before each of (K, 7) places: unit x, y, near, far, tangent of half
    the angle, and the road's height at near and far, all from ``origin``."""
    counts = np.zeros((len(places), 3), np.int64)
    for i in range(len(points)):
        x, y, z = points[i, 0] - origin[0], points[i, 1] - origin[1], points[i, 2] - origin[2]
        for k in range(len(places)):
            along = x * places[k, 0] + y * places[k, 1]
            if along <= 0.0 or abs(y * places[k, 0] - x * places[k, 1]) > places[k, 4] * along:
                continue
            near, far = places[k, 2], places[k, 3]
            at_near, at_far = z * near / along - places[k, 5], z * far / along - places[k, 6]
            inside_near = _BODY_LOW_M <= at_near <= _BODY_HIGH_M
            inside_far = _BODY_LOW_M <= at_far <= _BODY_HIGH_M
            if not (inside_near and inside_far):
                continue
            if along > far:
                counts[k, 0] += 1
            elif along >= near:
                counts[k, 1] += 1
            else:
                counts[k, 2] += 1
    return counts
