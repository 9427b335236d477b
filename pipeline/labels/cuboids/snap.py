"""Snaps a cuboid that a person placed near a vehicle to the vehicle's points.

The non-ground points in and near it are clustered; the cluster with most points in it (or else near it) is the vehicle.
Points outside the cuboid contradict it; a gap between its side and the points does not, because that part of the
vehicle may be hidden. So a cuboid that contains its points is left unchanged, unless they span its whole length and
width. Otherwise, several placements are tried, with the yaw kept or taken from the points: only the sides that points
contradict are moved to them, or, if they are off by more than a person's error, the cuboid is moved as a whole, with
its visible sides on the points. The best one is used only if its sides explain the points, if it fits those of this
sweep and of the sweeps around it clearly better than the original, and if both place it alike. Otherwise, too, the
cuboid is left unchanged: a dozen points beyond 35 m are no better than a person's judgement of the image. A vehicle is
never seen completely, so the size only grows to contain its points; where both of its ends were seen, in one sweep or
over several, the measured size is used. A cuboid that floats or is below the ground is put on it.

The yaw comes from the closeness fit of the pipeline (``pipeline.lidar.boxes``). Open3D's minimal oriented box, which
fits all three axes or, on flattened points, the smallest area, is less accurate on every real recording available: the
median error of the yaw of 65 labelled cars of Astyx is 3° to 5° (flattened 2.5°) compared with 1.6°, of 20 of KITTI
3.5° (3.2°) compared with 0.6°."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.common.errors import BadInput
from pipeline.common.geometry import Cuboid
from pipeline.labels.cuboids.aggregate import Aggregate
from pipeline.labels.cuboids.outline import Outline, misfit_m, outline, outside_m, placed
from pipeline.labels.cuboids.points_of import FEWEST_POINTS, MARGIN_M, Clustered, clustered, inside, points_of
from pipeline.lidar.boxes import fit_obstacles
from pipeline.lidar.ground import Ground
from pipeline.params import BoxParams
from pipeline.types import F32

_ENOUGH_POINTS = 12
"""With fewer points, the position of a side is uncertain: fitting made more boxes of labelled cars worse than
better."""
_BETTER_M = 0.05
"""A placement must improve the fit by this much, in this sweep and over all sweeps; otherwise it is no better than the
hand-drawn one. With 0.02 over all sweeps, more boxes got worse on each of the labelled drives."""
_TURN_COSTS_M = 0.04
"""A rotation must improve the fit by this much more: of a few points, the closest yaw is often not the vehicle's."""
_AGREE_M = 0.15
"""The placements from this sweep and from all sweeps must be this close to each other: the accuracy of a side with
points on it. If they differ, something beside the vehicle moved one of them. This almost halved how often boxes of
KITTI drive 0009 and of Astyx got worse."""
_CONTAINS_M = 0.05
"""A cuboid contains its points if they are outside by less than this on average: less than an improvement that counts.
Without the rules on contained, explained, widened and turned cuboids, those drawn on labelled vehicles got worse (by
more than 0.02 IoU) in 4 % (Astyx), 12 % (its further frames), 6 % (KITTI 0009) and 4 % (0052) of the cases; with all of
them, in 10 of 2,647 cases when each was moved as a whole."""
_MISPLACED_M = (0.45, 0.4)
"""A side along the length or width from which the points are farther away shows that the cuboid is in the wrong place.
At smaller distances, it may as well be too small, and moving it as a whole takes the opposite side, which no sensor
saw, away from the truth. So, no cuboid got worse in four drawings of each vehicle, which chose these limits (with 0.35
in both, 2 did), and in three others 3 of 1,990 did, by 0.04 at most; if each is moved as a whole, 10 of 2,647 and 22 of
1,990, by 0.23 at most. Of cuboids drawn 0.8 m off, it moves 64 onto their vehicles instead of 77, of 366."""
_WHOLE = 0.8
"""Share of length and width that the points must span to show the whole vehicle: its corners are round."""
_FEWEST_TO_TURN = 2
"""A rotation found in a single sweep needs points over the whole vehicle: a part of one side, or a bumper's corner, has
a yaw of its own."""
_EXPLAINED_M = 0.12
"""Points farther than this from the fitted sides on average belong to more than one vehicle, or not to its sides:
``outline`` counts points as on a side up to this distance. With 0.15, twice as many cuboids got worse."""
_WIDER_M = 0.3
"""Bodies that grow by more than this in width include a neighbour; two mirrors add 0.2 to 0.25 m."""
_SAME_YAW_RAD = 1e-6
_GROWN_M = 0.1
"""Points must extend this far beyond a side to lengthen it."""
_ON_GROUND_M = 0.3
"""A bottom this close to the ground is left there: the bottoms of 656 labelled vehicles up to 50 m away are 0.06 m from
the measured ground (median), 98 % of them closer than this. With 0.1 m, a third of Astyx's labelled vehicles were moved
up or down by the error of the ground alone."""
_RAISED_M = 0.1
"""Smaller changes of height are not applied."""
_MOST_MOVED_M, _MOST_RESIZED_M, _MOST_TURN_RAD = 1.2, 1.0, math.radians(25.0)
"""If points differ from the hand-drawn cuboid by more than this, they belong to something else."""
_MOST_DRAWN_TURN_RAD = math.radians(10.0)
"""A person draws a heading to about 3°, so a correction of more than three times that is the error of the points."""
_TWO_SIDES_M = 0.6
"""A shorter second side is just the depth of a bumper and does not determine the yaw."""
_GROUND_GAP_M = 0.6
"""The ground found is not the cuboid's if the lowest point is farther from it than half a height and this."""


class TooFewPoints(BadInput):
    """There are not enough points to fit a cuboid."""


@dataclass(frozen=True)
class Refitted:
    """A cuboid after fitting."""

    cuboid: Cuboid
    """The result; the hand-drawn cuboid if nothing fits better."""
    points: int
    """Number of points of this sweep used for the fit."""
    turned: bool
    """Whether the points determined its yaw."""
    sweeps: int = 1
    """Number of sweeps used."""
    is_better: bool = True
    """False if the hand-drawn cuboid was left unchanged."""


def refit(sweep: F32 | Clustered, cuboid: Cuboid, around: Aggregate | None = None) -> Refitted:
    """Fit a cuboid to the points in and near it, if that is better than its current position.

    sweep: (N, 4) float32 ``x y z intensity``, ego frame. around: the same vehicle's points of several sweeps.
    TooFewPoints, with their number, for fewer than five.
    """
    known = sweep if isinstance(sweep, Clustered) else clustered(sweep)
    points = points_of(known, cuboid)
    if points is None or len(points) < FEWEST_POINTS:
        count = int((inside(known.points, cuboid, MARGIN_M) & ~known.ground.mask).sum())
        raise TooFewPoints(
            f"{count} point{'' if count == 1 else 's'} in and near the cuboid: it needs {FEWEST_POINTS} close together"
        )
    own = Aggregate(-1, points, np.zeros((1, 2)), {})
    every = around if around is not None else own
    found = _best(own, every, known.ground, cuboid) if len(points) >= _ENOUGH_POINTS else None
    flat, is_better = found or cuboid, found is not None
    upright = _stood(flat, points, known.ground, _ON_GROUND_M)
    if not is_better and abs(upright.center[2] - cuboid.center[2]) < _RAISED_M:
        return Refitted(cuboid, len(points), False, max(len(every.placed), 1), is_better=False)
    turned = found is not None and abs(_wrapped(flat.yaw_rad - cuboid.yaw_rad)) > _SAME_YAW_RAD
    return Refitted(upright, len(points), turned, max(len(every.placed), 1))


def _best(own: Aggregate, every: Aggregate, ground: Ground, cuboid: Cuboid) -> Cuboid | None:
    """The placement that fits the points of this sweep and of all sweeps best; None if it is not clearly better than
    the cuboid, or if this sweep and all sweeps do not agree on it."""
    is_contained = min(outside_m(each.points, cuboid) for each in (own, every)) < _CONTAINS_M
    sources = (own, every) if every is not own else (own,)
    tried = [
        [(_laid_on(one, cuboid, cuboid.yaw_rad + turn_rad), turn_rad) for turn_rad in turns]
        for one in sources
        for turns in [dict.fromkeys((0.0, _shape_turn_rad(one.points, ground, cuboid)))]
    ]
    drawn_m = [misfit_m(each.points, each.eyes, cuboid) for each in (own, every)]
    best, best_m = None, 0.0
    for source, placements in enumerate(tried):
        others = [each for other, there in enumerate(tried) if other != source for each, _ in there]
        for one, turn_rad in placements:
            left_m = [misfit_m(each.points, each.eyes, one) for each in (own, every)]
            own_m, every_m = (before - after for before, after in zip(drawn_m, left_m, strict=True))
            gain_m = own_m + every_m - (_TURN_COSTS_M if turn_rad else 0.0)
            is_better = min(own_m, every_m) > _BETTER_M and gain_m > best_m and left_m[0] < _EXPLAINED_M
            is_alike = not others or _apart_m(one, others) <= _AGREE_M
            # what the points do not span needs a second witness
            is_bold = is_contained or (turn_rad != 0.0 and len(every.placed) < _FEWEST_TO_TURN)
            if is_better and is_alike and _is_near(one, cuboid) and not (is_bold and _is_hidden(every, one)):
                best, best_m = one, gain_m
    return best


def _is_hidden(every: Aggregate, one: Cuboid) -> bool:
    """Whether the points do not span its length and width."""
    span = outline(every.points, every.eyes, one.yaw_rad).span
    return bool((span < _WHOLE * np.array(one.size[:2])).any())


def _apart_m(one: Cuboid, others: Sequence[Cuboid]) -> float:
    """Distance of its centre from the nearest of the others."""
    return min(math.dist(one.center[:2], each.center[:2]) for each in others)


def _laid_on(one: Aggregate, cuboid: Cuboid, yaw_rad: float) -> Cuboid:
    """The cuboid aligned with the points, for a given yaw: moved as a whole if they show that it is misplaced, else
    with the contradicted sides moved and the others left in place."""
    found = outline(one.points, one.eyes, yaw_rad)
    middle, half = found.axes @ np.array(cuboid.center[:2]), np.array(cuboid.size[:2]) / 2
    low, high = middle - half, middle + half
    beyond_m = np.maximum(low - found.low, found.high - high)
    if (beyond_m > _MISPLACED_M).any():
        return _moved_onto(found, cuboid, yaw_rad)
    for axis, ends in enumerate(found.firm):
        is_whole = ends == "both"
        if is_whole or found.low[axis] < low[axis] - (_BETTER_M if ends == "low" else _GROWN_M):
            low[axis] = found.low[axis]
        if is_whole or found.high[axis] > high[axis] + (_BETTER_M if ends == "high" else _GROWN_M):
            high[axis] = found.high[axis]
    x, y = found.axes.T @ ((low + high) / 2)
    length, width = (high - low).tolist()
    return Cuboid((float(x), float(y), cuboid.center[2]), (length, width, cuboid.size[2]), _wrapped(yaw_rad))


def _moved_onto(found: Outline, cuboid: Cuboid, yaw_rad: float) -> Cuboid:
    """The cuboid with its firm sides on the points. It keeps its size unless they extend farther, or show both ends."""
    size = [
        float(span if ends == "both" or span > side + _GROWN_M else side)
        for span, side, ends in zip(found.span, cuboid.size[:2], found.firm, strict=True)
    ]
    x, y = placed(found, cuboid, size, found.firm)
    return Cuboid((x, y, cuboid.center[2]), (size[0], size[1], cuboid.size[2]), _wrapped(yaw_rad))


def _is_near(tried: Cuboid, cuboid: Cuboid) -> bool:
    """Whether it is still the vehicle that the person meant."""
    longer_m, wider_m = (abs(a - b) for a, b in zip(tried.size[:2], cuboid.size[:2], strict=True))
    return (
        math.dist(tried.center[:2], cuboid.center[:2]) <= _MOST_MOVED_M
        and longer_m <= _MOST_RESIZED_M
        and wider_m <= _WIDER_M
        and abs(_wrapped(tried.yaw_rad - cuboid.yaw_rad)) <= _MOST_DRAWN_TURN_RAD
    )


def _shape_turn_rad(points: F32, ground: Ground, cuboid: Cuboid) -> float:
    """Rotation according to the points; 0 if they do not show two sides."""
    seen = _around(points, ground)
    turn_rad = _quarter(seen.yaw_rad - cuboid.yaw_rad)
    is_told = min(seen.size[:2]) >= _TWO_SIDES_M and abs(turn_rad) <= _MOST_TURN_RAD
    return turn_rad if is_told else 0.0


def onto_points(points: F32, ground: Ground, cuboid: Cuboid) -> Refitted:
    """Fit a cuboid that nobody has positioned to (M, 4) points, all belonging to its vehicle."""
    turn_rad = _shape_turn_rad(points, ground, cuboid)
    yaw_rad = cuboid.yaw_rad + turn_rad
    found = outline(points, np.zeros((1, 2)), yaw_rad)
    size = np.maximum(cuboid.size[:2], found.span)
    x, y = placed(found, cuboid, size.tolist(), found.seen)
    flat = Cuboid((x, y, cuboid.center[2]), (float(size[0]), float(size[1]), cuboid.size[2]), _wrapped(yaw_rad))
    return Refitted(_stood(flat, points, ground), len(points), bool(turn_rad))


def _stood(cuboid: Cuboid, points: F32, ground: Ground, close_m: float = 0.0) -> Cuboid:
    """Placed on the ground unless it is this close to it, and at least as high as its points."""
    x, y = cuboid.center[:2]
    bottom = float(ground.height(np.array([[x, y]]))[0])
    lowest, top = float(points[:, 2].min()), float(points[:, 2].max())
    if not math.isfinite(bottom) or abs(lowest - bottom) > _GROUND_GAP_M + cuboid.size[2] / 2:
        bottom = lowest
    stands = cuboid.center[2] - cuboid.size[2] / 2
    if abs(stands - bottom) < close_m:
        bottom = stands
    height = max(cuboid.size[2], top - bottom)
    return Cuboid((x, y, bottom + height / 2), (cuboid.size[0], cuboid.size[1], height), cuboid.yaw_rad)


def _around(points: F32, ground: Ground) -> Cuboid:
    return fit_obstacles(points, np.zeros(len(points), dtype=np.int32), ground, BoxParams(method="l_shape"))[0].cuboid


def _quarter(angle_rad: float) -> float:
    """In [−45°, 45°]: boxes are symmetric under quarter turns."""
    return (angle_rad + math.pi / 4) % (math.pi / 2) - math.pi / 4


def _wrapped(angle_rad: float) -> float:
    return math.remainder(angle_rad, 2.0 * math.pi)
