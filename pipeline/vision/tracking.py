"""Boxes followed from picture to picture (paper, Algorithm 1), as a pure function: state in, state out.

The printed algorithm measures half widths where it means centres, takes the first candidate under the threshold and
gives a new number for every one that fails. Here a box goes to its nearest candidate, one-to-one, and a new object is
numbered once. An object not seen is carried, says so, and ends after ``queue_frames`` pictures or ``max_missed_s``.

Two filters. ``queue`` is the paper's: the newest box of each object stands for it, its distance is the last one
measured, and it has no velocity. ``kalman`` predicts both the box and the place, each with a constant-velocity filter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from pipeline.common import kalman
from pipeline.common.fast_replace import evolve
from pipeline.common.geometry import F64, iou_matrix
from pipeline.common.kalman import CvState
from pipeline.params import VisionTrackingParams
from pipeline.types import Box, VisionMeasurement, VisionTrack
from pipeline.vision.association import match, same_kind

SPEED_SIGMA_MPS = 8.0
"""How fast a new object may be closing in or away, before a second sighting tells."""
_OUTLIER = 9.21
"""99 % point of χ² with 2 degrees of freedom: a place farther off weighs less."""
_CAR_WIDTH_M = 1.8
"""Turns box widths into metres, so that a box's motion in the picture is as lively as its object's on the road."""
_CENTRE_NOISE = 0.04
"""Noise of a box's centre, in box widths."""


@dataclass(frozen=True)
class Followed:
    """One object between two pictures. unseen_s, unplaced_s: since its last sighting, and since its last distance.
    box_filter: its centre in pixels. place_filter: its place, ego x y. votes: summed score of each class name."""

    track: VisionTrack
    unseen_s: float
    unplaced_s: float
    placed: int
    box_filter: CvState
    place_filter: CvState | None
    votes: tuple[tuple[str, float], ...]


class SpeedGuess(NamedTuple):
    """What a new object's relative speed along ego x is taken for, and its standard deviation along each axis."""

    along_mps: float
    sigma_mps: float


@dataclass(frozen=True)
class VisionTrackerState:
    """All that one picture leaves to the next."""

    next_id: int = 1
    followed: tuple[Followed, ...] = field(default=())


def track(
    state: VisionTrackerState,
    measurements: tuple[VisionMeasurement, ...] | None,
    dt_s: float | None,
    params: VisionTrackingParams,
    ego_speed_mps: float | None = None,
) -> tuple[VisionTrackerState, tuple[VisionTrack, ...]]:
    """One tick. ``measurements`` null: the camera gave nothing, which counts as time but not as a picture in which the
    object was missing. ``dt_s`` null: the first tick. ``ego_speed_mps``: what a new object's speed is guessed from.
    Tracks come by id."""
    guess = _first_guess(ego_speed_mps)
    expected = [_predict(followed, dt_s or 0.0, params) for followed in state.followed]
    if measurements is None:
        kept = tuple(followed for followed in expected if followed.unseen_s <= params.max_missed_s)
        return evolve(state, followed=kept), tuple(followed.track for followed in kept)
    partner = match([followed.track for followed in expected], [f.unseen_s for f in expected], measurements, params)
    kept_list = [
        _seen(followed, measurements[partner[row]], guess, params) if row in partner else _missed(followed)
        for row, followed in enumerate(expected)
    ]
    taken = set(partner.values())
    fresh = [measurement for column, measurement in enumerate(measurements) if column not in taken]
    kept_list += [_new(state.next_id + index, measurement, guess, params) for index, measurement in enumerate(fresh)]
    alive = tuple(
        followed
        for followed in kept_list
        if followed.track.missed < params.queue_frames and followed.unseen_s <= params.max_missed_s
    )
    if params.filter == "kalman":
        alive = _without_ghosts(alive, params)
    return VisionTrackerState(state.next_id + len(fresh), alive), tuple(followed.track for followed in alive)


def _without_ghosts(alive: tuple[Followed, ...], params: VisionTrackingParams) -> tuple[Followed, ...]:
    """Without carried objects whose expected box lies on one that was seen: that is the same car under a new number, or
    a car that the nearer one hides, and either way nothing is known of it any more."""
    seen = [followed.track for followed in alive if not followed.track.carried]
    carried = [followed.track for followed in alive if followed.track.carried]
    overlap = iou_matrix(np.array([track.bbox for track in carried]), np.array([track.bbox for track in seen]))
    pairs = np.argwhere(overlap > params.ghost_iou)
    ghosts = {carried[i].id for i, j in pairs if same_kind(carried[i].label, seen[j].label)}
    return tuple(followed for followed in alive if followed.track.id not in ghosts) if ghosts else alive


def _predict(followed: Followed, dt_s: float, params: VisionTrackingParams) -> Followed:
    """Where the object should be now; carried until a box says that it is there."""
    aged = evolve(followed, unseen_s=followed.unseen_s + dt_s, unplaced_s=followed.unplaced_s + dt_s)
    if params.filter == "queue":
        return evolve(aged, track=evolve(followed.track, carried=True, measured=False))
    box = followed.track.bbox
    moved = kalman.predict(followed.box_filter, dt_s, params.accel_sigma_mps2 * _width(box) / _CAR_WIDTH_M)
    place, scale = _predict_place(aged, dt_s, params)
    track = evolve(followed.track, carried=True, measured=False, bbox=_around(moved.mean, box, scale))
    if place is not None:
        track = _shown(track, place, followed.placed)
    elif followed.place_filter is not None:
        track = evolve(track, distance_m=None, sigma_m=None, position=None, velocity_mps=None)
    placed = followed.placed if place is not None or followed.place_filter is None else 0
    return evolve(aged, box_filter=moved, place_filter=place, placed=placed, track=track)


def _predict_place(followed: Followed, dt_s: float, params: VisionTrackingParams) -> tuple[CvState | None, float]:
    """The place a moment later, and how much the box has grown as the range changed. A place not measured for
    ``max_missed_s`` is forgotten, though its box be seen (it may be too near to be measured)."""
    if followed.place_filter is None:
        return None, 1.0
    moved = kalman.predict(followed.place_filter, dt_s, params.accel_sigma_mps2)
    (before_x, before_y), (x, y) = followed.place_filter.mean[:2].tolist(), moved.mean[:2].tolist()
    before_m, now_m = math.hypot(before_x, before_y), math.hypot(x, y)
    if followed.unplaced_s > params.max_missed_s or now_m <= 0.0 or x <= 0.0:
        return None, 1.0
    return moved, before_m / now_m


def _first_guess(ego_speed_mps: float | None) -> SpeedGuess:
    """What is on a road stands or goes along with us: relative speeds from −v to 0, around −v/2. A guess of 0 ± 8 m/s
    would take 2 s to believe that a car standing ahead of a fast ego vehicle stands. Without ego speed it must do."""
    if ego_speed_mps is None:
        return SpeedGuess(0.0, SPEED_SIGMA_MPS)
    return SpeedGuess(-ego_speed_mps / 2, max(SPEED_SIGMA_MPS, ego_speed_mps / 2))


def _new(track_id: int, seen: VisionMeasurement, guess: SpeedGuess, params: VisionTrackingParams) -> Followed:
    detection = seen.detection
    shown = VisionTrack(
        id=track_id,
        bbox=detection.bbox,
        label=detection.label,
        score=detection.score,
        distance_m=seen.distance_m,
        sigma_m=seen.sigma_m,
        position=seen.position,
        velocity_mps=None,
        hits=1,
        missed=0,
        carried=False,
        measured=seen.distance_m is not None,
    )
    box_filter = kalman.start(_centre(detection.bbox), _box_noise(detection.bbox), _box_speed_sigma(detection.bbox))
    votes = ((detection.label, detection.score),)
    followed = Followed(shown, 0.0, 0.0 if seen.position else math.inf, 0, box_filter, None, votes)
    return _place(followed, seen, guess, params) if params.filter == "kalman" else followed


def _seen(followed: Followed, seen: VisionMeasurement, guess: SpeedGuess, params: VisionTrackingParams) -> Followed:
    """The object with this picture's box and distance taken in."""
    detection = seen.detection
    label, votes, box_filter = detection.label, followed.votes, followed.box_filter
    if params.filter == "kalman":
        tally = dict(votes)
        tally[label] = tally.get(label, 0.0) + detection.score
        label, votes = max(tally, key=lambda name: tally[name]), tuple(tally.items())
        box_filter = kalman.update(box_filter, _centre(detection.bbox), _box_noise(detection.bbox))
    track = evolve(
        followed.track,
        bbox=detection.bbox,
        label=label,
        score=detection.score,
        hits=followed.track.hits + 1,
        missed=0,
        carried=False,
        measured=seen.distance_m is not None,
    )
    if params.filter == "queue":
        track = evolve(track, distance_m=seen.distance_m, sigma_m=seen.sigma_m, position=seen.position)
    current = evolve(followed, track=track, unseen_s=0.0, votes=votes, box_filter=box_filter)
    return _place(current, seen, guess, params) if params.filter == "kalman" else current


def _missed(followed: Followed) -> Followed:
    return evolve(followed, track=evolve(followed.track, missed=followed.track.missed + 1))


def _place(followed: Followed, seen: VisionMeasurement, guess: SpeedGuess, params: VisionTrackingParams) -> Followed:
    """The measured place taken in; one far from the expected weighs less, by as much as it is too far."""
    if seen.position is None or seen.sigma_m is None or seen.distance_m is None:
        if followed.place_filter is not None:
            return evolve(followed, track=_shown(followed.track, followed.place_filter, followed.placed))
        return evolve(followed, track=evolve(followed.track, distance_m=seen.distance_m, sigma_m=seen.sigma_m))
    noise = place_noise(seen.position, seen.sigma_m, params.bearing_sigma_deg)
    if followed.place_filter is None:
        filtered = kalman.start(seen.position, noise, guess.sigma_mps)
        filtered.mean[2] = guess.along_mps
    else:
        surprise = kalman.mahalanobis2(followed.place_filter, seen.position, noise)
        filtered = kalman.update(followed.place_filter, seen.position, noise * max(1.0, surprise / _OUTLIER))
    placed = followed.placed + 1
    track = _shown(followed.track, filtered, placed, seen.sigma_m / seen.distance_m)
    return evolve(followed, track=track, place_filter=filtered, placed=placed, unplaced_s=0.0)


def _shown(track: VisionTrack, place: CvState, placed: int, share: float | None = None) -> VisionTrack:
    """The track with its public numbers, from its filter. ``share``: sigma over distance of the measurement taken in.

    The sigma shown never falls below that of one sighting: most of it is the object's own unknown height, an error
    that no number of sightings averages out.
    """
    x, y, vx, vy = place.mean.tolist()
    (xx, xy), (_, yy) = place.cov[:2, :2].tolist()
    range_m = math.hypot(x, y)
    filter_sigma = math.sqrt(x * x * xx + 2 * x * y * xy + y * y * yy) / range_m  # along the ray
    if share is None:
        share = track.sigma_m / track.distance_m if track.sigma_m and track.distance_m else 0.0
    return evolve(
        track,
        distance_m=range_m,
        sigma_m=max(filter_sigma, share * range_m),
        position=(x, y),
        velocity_mps=(vx, vy) if placed >= 2 else None,
    )


def place_noise(position: tuple[float, float], range_sigma_m: float, bearing_sigma_deg: float) -> F64:
    """(2, 2) covariance of a place seen by a camera: long along the ray, narrow across it."""
    bearing = math.atan2(position[1], position[0])
    across_m = math.hypot(*position) * math.radians(bearing_sigma_deg)
    c, s = math.cos(bearing), math.sin(bearing)
    along, across = range_sigma_m**2, across_m**2
    off = c * s * (along - across)
    return np.array([[c * c * along + s * s * across, off], [off, s * s * along + c * c * across]])


def _box_noise(box: Box) -> F64:
    variance = max(_CENTRE_NOISE * _width(box), 1.0) ** 2
    return np.array([[variance, 0.0], [0.0, variance]])


def _box_speed_sigma(box: Box) -> float:
    return SPEED_SIGMA_MPS * _width(box) / _CAR_WIDTH_M


def _around(centre: F64, box: Box, scale: float) -> Box:
    half_w, half_h = _width(box) / 2 * scale, (box[3] - box[1]) / 2 * scale
    u, v = float(centre[0]), float(centre[1])
    return u - half_w, v - half_h, u + half_w, v + half_h


def _centre(box: Box) -> tuple[float, float]:
    return (box[0] + box[2]) / 2, (box[1] + box[3]) / 2


def _width(box: Box) -> float:
    return box[2] - box[0]
