"""The position of one tracked object: filtered, rejected or reinitialised, and its learned height (paper, Distance
Estimation with Regression; the paper has neither)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from pipeline.common import kalman
from pipeline.common.fast_replace import evolve
from pipeline.common.kalman import CvState
from pipeline.params import VisionTrackingParams
from pipeline.types import HeightFrom, VisionMeasurement, VisionTrack
from pipeline.vision import place_filter
from pipeline.vision.place_filter import PlaceMeasurement
from pipeline.vision.ranged_run import RangedRun
from pipeline.vision.vehicle_height import (
    BoxShape,
    Height,
    RoadContact,
    hinted,
    learn,
    other_class,
    relative_to,
)

FASTEST_OVER_GROUND_MPS = 70.0
"""250 km/h: nothing on a road is faster, and a filter that says so has run away."""
FASTEST_ONCOMING_MPS = 45.0
"""160 km/h: the same for what comes towards us."""
_WANDER_SHARE = 0.08
"""Share of the distance by which the height of a box makes it wander within a second: an error that lasts, which the
filter, whose noise is new in every image, takes for motion. Without it, 2 σ held 77 % of the radial speeds of parked
cars on KITTI 0009 after 9 to 20 sightings, and 65 % on four simulated drives; with it, 90 and 86 %."""
_SETTLED = 3
"""Sightings after which a place is trusted against a single one that contradicts it."""


@dataclass(frozen=True)
class Followed:
    """One object between two images."""

    track: VisionTrack
    """What the rest of the pipeline is told."""
    unseen_s: float
    """Since its last sighting."""
    unplaced_s: float
    """Since the last distance that was taken in."""
    placed: int
    """Distances taken in since the place was last begun."""
    box_filter: CvState
    """The centre of its box, pixels."""
    place_filter: CvState | None
    """Its place and relative velocity, ego x y."""
    votes: tuple[tuple[str, float], ...]
    """Summed score of each class name."""
    refused: int = 0
    """Distances refused in a row."""
    height: Height = Height()
    """How tall it is for its class."""
    shape: BoxShape = BoxShape()
    """Of its boxes; what its height is guessed from until it is learned."""
    contact: RoadContact = RoadContact()
    """Where its boxes meet the road; likewise."""
    run: RangedRun = RangedRun()
    """The distances that returns inside its boxes have given."""
    seen: VisionMeasurement | None = None
    """This image's sighting with a distance; None without one."""
    double_of: int | None = None
    """Id of the track on which its first box lay; None if it lay on none."""


class SpeedGuess(NamedTuple):
    """What a new object's relative speed along ego x is taken for, and its standard deviation along each axis."""

    along_mps: float
    """Relative speed along ego x."""
    sigma_mps: float
    """The same along x and y."""


class PredictedPlace(NamedTuple):
    """The place of an object a moment later."""

    place: CvState | None
    """None where it is not known, or no longer."""
    growth: float
    """How much its box has grown as the range changed."""


def predict_places(followed: Sequence[Followed], dt_s: float, params: VisionTrackingParams) -> list[PredictedPlace]:
    """The place of each object ``dt_s`` later. A place not measured for ``max_missed_s`` is forgotten, though its box
    be seen (it may be too near to be measured)."""
    known = [each.place_filter for each in followed if each.place_filter is not None]
    moved = iter(kalman.unstacked(kalman.predict(kalman.stacked(known), dt_s, params.accel_sigma_mps2)))
    return [
        _predicted(each, each.place_filter, next(moved), dt_s, params)
        if each.place_filter is not None
        else PredictedPlace(None, 1.0)
        for each in followed
    ]


def _predicted(
    followed: Followed, before: CvState, now: CvState, dt_s: float, params: VisionTrackingParams
) -> PredictedPlace:
    (before_x, before_y), (x, y) = before.mean[:2].tolist(), now.mean[:2].tolist()
    before_m, now_m = math.hypot(before_x, before_y), math.hypot(x, y)
    if followed.unplaced_s + dt_s > params.max_missed_s or now_m <= 0.0 or x <= 0.0:
        return PredictedPlace(None, 1.0)
    return PredictedPlace(now, before_m / now_m)


def take_place(
    followed: Followed,
    seen: VisionMeasurement,
    guess: SpeedGuess,
    ego_speed_mps: float | None,
    params: VisionTrackingParams,
    slip_m: float = 0.0,
) -> Followed:
    """The measured place taken in, or refused when it cannot be that object's. When it is refused for long, the
    distances are right and the filter is wrong: it starts anew from them, and its speed has to be measured again.

    slip_m: how far the box may lie off sideways, beyond its usual noise."""
    if seen.position is None or seen.sigma_m is None or seen.distance_m is None:
        if followed.place_filter is not None:
            return evolve(followed, track=with_place(followed, followed.place_filter, followed.placed))
        return evolve(followed, track=evolve(followed.track, distance_m=seen.distance_m, sigma_m=seen.sigma_m))
    followed = _hinted(followed, seen, params)
    # a truck that is called a car in one image is as tall as before
    by_class_m = seen.distance_as(followed.track.label) or seen.distance_m
    share, own_m = seen.sigma_m / seen.distance_m, by_class_m * followed.height.factor
    if seen.size_share is not None:
        pixel_share = math.sqrt(max(share**2 - seen.size_share**2, 0.0))
        share = math.hypot(pixel_share, followed.height.share(seen.size_share))
    noise_share = seen.noise_share if seen.noise_share is not None else share
    if seen.ranged_m is not None:
        # what the height is learned to be moves the place there first, so that it is no motion
        followed = learned(followed, seen.ranged_m, seen.ranged_sigma_m, params)
        own_m, share = seen.ranged_m, seen.ranged_sigma_m / seen.ranged_m
        noise_share = share
    sighting = PlaceMeasurement(
        own_m,
        math.atan2(seen.position[1], seen.position[0]),
        noise_share,
        math.hypot(math.radians(params.bearing_sigma_deg), slip_m / own_m),
    )
    filtered, placed = None, followed.placed + 1
    if followed.place_filter is not None:
        filtered, nis = place_filter.update(followed.place_filter, sighting)
        if nis > params.max_nis:
            # one or two sightings have no standing against a third that contradicts them
            if followed.placed >= _SETTLED and followed.refused + 1 < params.restart_after:
                shown = with_place(followed, followed.place_filter, followed.placed, measured=False)
                return evolve(followed, track=shown, refused=followed.refused + 1)
            filtered = None
        elif not _is_plausible(filtered, ego_speed_mps):
            filtered = None
        if filtered is None:
            return take_place(_forgotten(followed), seen, guess, ego_speed_mps, params, slip_m)
    if filtered is None:
        filtered, placed = place_filter.start(sighting, guess.along_mps, guess.sigma_mps), 1
    height_from = _height_from(followed)
    run = followed.run if placed > 1 else RangedRun()
    run = run.then(seen.ranged_sigma_m if seen.ranged_m is not None else None, followed.unplaced_s)
    followed = evolve(followed, run=run)
    track = with_place(followed, filtered, placed, share, returns=seen.returns, height_from=height_from)
    return evolve(followed, track=track, place_filter=filtered, placed=placed, unplaced_s=0.0, refused=0)


def _forgotten(followed: Followed) -> Followed:
    """The object without a place, and without the height on which that rested: its boxes show something else now, such
    as a whole vehicle instead of half of one."""
    return evolve(followed, place_filter=None, height=Height(), shape=BoxShape(), contact=RoadContact())


def learned(followed: Followed, range_m: float, sigma_m: float, params: VisionTrackingParams) -> Followed:
    """The object with what a measured range says of its height. Its place moves with that, so that it is no motion, but
    no farther than the range: one that rests on earlier ranges is right already."""
    seen = followed.seen
    if (
        not params.learn_height
        or seen is None
        or seen.distance_m is None
        or not seen.noise_share
        or not seen.size_share
    ):
        return followed
    by_class_m = seen.distance_as(followed.track.label) or seen.distance_m
    factor = _class_factor(followed.track.label, seen)
    height = learn(followed.height, by_class_m, seen.noise_share, seen.size_share, range_m, sigma_m, factor)
    place = followed.place_filter
    if place is not None and height != followed.height:
        due = range_m / math.hypot(*place_filter.position(place))
        step = height.factor / followed.height.factor
        place = place_filter.scaled(place, min(max(step, min(due, 1.0)), max(due, 1.0)))
    return evolve(followed, height=height, place_filter=place)


def is_likelier(one: Followed, other: Followed, range_m: float) -> bool:
    """Whether a measured range is rather that of one object than that of the other: it would make its height the more
    usual one."""
    return _unusual(one, range_m) < _unusual(other, range_m)


def _unusual(followed: Followed, range_m: float) -> float:
    """|ln(height / usual height)| of an object at a range, as what it is called or as a car; infinite if its box is not
    measured in this image."""
    seen, label = followed.seen, followed.track.label
    if seen is None or seen.distance_m is None:
        return math.inf
    by_class = math.log(range_m / (seen.distance_as(label) or seen.distance_m))
    return min(abs(by_class), abs(by_class + math.log(_class_factor(label, seen))))


def without_ranges(followed: Followed) -> Followed:
    """The object as if its height had never been learned from a range: again as its class, its shape and the road say.
    Its place moves with that."""
    seen, label = followed.seen, followed.track.label
    if seen is None or not followed.height.is_ranged:
        return followed
    share = seen.size_share or 0.0
    shape, other = followed.shape if label == "car" else BoxShape(), other_class(label, seen.class_factors)
    height = hinted(shape, followed.contact, share, other)
    followed = evolve(followed, height=height, place_filter=_rescaled(followed, height))
    if followed.place_filter is None:
        return followed
    track = with_place(followed, followed.place_filter, followed.placed, height.share(share))
    return evolve(followed, track=evolve(track, height_from=_height_from(followed)))


def _rescaled(followed: Followed, height: Height) -> CvState | None:
    """The place with another height, so that the change is no motion."""
    place = followed.place_filter
    if place is None or height.mean == followed.height.mean:
        return place
    return place_filter.scaled(place, height.factor / followed.height.factor)


def _hinted(followed: Followed, seen: VisionMeasurement, params: VisionTrackingParams) -> Followed:
    """The object with this sighting, and with what its box tells of the height while no range has: by its shape, and by
    where it meets the road. Its place moves with that, so that it is no motion."""
    shape, contact = followed.shape, followed.contact
    if params.use_aspect:
        shape = shape.seen(seen.aspect)
    by_class_m = seen.distance_as(followed.track.label)
    if seen.road is not None and by_class_m is not None:
        contact = contact.seen(relative_to(seen.road, math.log((seen.distance_m or by_class_m) / by_class_m)))
    if followed.height.is_ranged:
        return evolve(followed, seen=seen, shape=shape, contact=contact)
    label = followed.track.label
    other = other_class(label, seen.class_factors)
    height = hinted(shape if label == "car" else BoxShape(), contact, seen.size_share or 0.0, other)
    height = height._replace(contradictions=followed.height.contradictions)
    place = _rescaled(followed, height)
    return evolve(followed, seen=seen, shape=shape, contact=contact, height=height, place_filter=place)


def _class_factor(label: str, seen: VisionMeasurement) -> float:
    """By how much vehicles of that name may be lower than the name says: a lorry may be a car, a car is no lorry."""
    return max(seen.class_factors.get(label, 1.0), 1.0)


def _height_from(followed: Followed) -> HeightFrom:
    if followed.height.is_ranged:
        return "range"
    if followed.height.sigma is not None:
        return "road"
    return "shape" if followed.height.mean else "class"


def renamed(followed: Followed, label: str, seen: VisionMeasurement) -> Followed:
    """The object as one of the class that it is taken for now: what is known of its height stays the same in metres."""
    before, now = seen.class_factors.get(followed.track.label), seen.class_factors.get(label)
    if before is None or now is None or before == now:
        return followed
    step = math.log(before / now)
    contact = followed.contact.as_ratio_to(step)
    height = followed.height
    if height.sigma is not None:
        height = height._replace(mean=height.mean + step)
    return evolve(followed, height=height, contact=contact)


def _is_plausible(place: CvState, ego_speed_mps: float | None) -> bool:
    """Whether something on a road can move so. Without the own speed, the limits are twice as wide."""
    along_mps = float(place.mean[2])
    own = ego_speed_mps if ego_speed_mps is not None else 0.0
    spare = 0.0 if ego_speed_mps is not None else FASTEST_ONCOMING_MPS
    return -FASTEST_ONCOMING_MPS - spare <= along_mps + own <= FASTEST_OVER_GROUND_MPS + spare


def with_place(
    followed: Followed, place: CvState, placed: int, share: float | None = None, **others: Any
) -> VisionTrack:
    """The object's track with its public numbers, from its filter. ``share``: sigma over distance of the measurement
    taken in. ``others``: fields that change with them.

    The sigma shown never falls below that of one sighting: most of it is the object's own unknown height, an error
    that no number of sightings averages out.
    """
    track = followed.track
    x, y, vx, vy = place.mean.tolist()
    range_m, (range_sigma, speed_sigma) = math.hypot(x, y), place_filter.radial_sigmas(place)
    # a line through positions over the time T has σ_v = √3 σ_r / T at its end
    memory_s = math.sqrt(3.0) * range_sigma / speed_sigma
    if share is None:
        share = track.sigma_m / track.distance_m if track.sigma_m and track.distance_m else 0.0
    return evolve(
        track,
        distance_m=range_m,
        sigma_m=max(range_sigma, share * range_m),
        position=(x, y),
        velocity_mps=(vx, vy) if placed >= 2 else None,
        # what stays wrong with the distance is wrong with its change in the same proportion
        speed_sigma_mps=math.hypot(speed_sigma, share * math.hypot(vx, vy)),
        wander_mps=followed.run.wander_mps(_WANDER_SHARE * range_m / math.sqrt(memory_s)),
        ranges=placed,
        **others,
    )
