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
from scipy.optimize import linear_sum_assignment

from pipeline import kalman
from pipeline.geometry import F64, iou_matrix
from pipeline.kalman import CvState
from pipeline.params import VisionTrackingParams
from pipeline.records import evolve
from pipeline.types import VEHICLES, Box, VisionMeasurement, VisionTrack

SPEED_SIGMA_MPS = 8.0
"""How fast a new object may be closing in or away, before a second sighting tells."""
_NOMINAL_DT_S = 0.1
_MAX_GROWTH = 3.0
"""The pixel gate is meant for pictures 0.1 s apart; it widens with the time since the last sighting, thrice at most."""
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
    partner = _match(expected, measurements, params)
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
    ghosts = {carried[i].id for i, j in pairs if _same_kind(carried[i].label, seen[j].label)}
    return tuple(followed for followed in alive if followed.track.id not in ghosts) if ghosts else alive


def _same_kind(a: str, b: str) -> bool:
    """Whether two names may be one object's: a detector mixes up vehicles, not a person and a car."""
    return a == b or VEHICLES.issuperset((a, b))


def _predict(followed: Followed, dt_s: float, params: VisionTrackingParams) -> Followed:
    """Where the object should be now; carried until a box says that it is there."""
    aged = evolve(
        followed,
        track=evolve(followed.track, carried=True, measured=False),
        unseen_s=followed.unseen_s + dt_s,
        unplaced_s=followed.unplaced_s + dt_s,
    )
    if params.filter == "queue":
        return aged
    return _show(_predict_place(_predict_box(aged, dt_s, params), dt_s, params))


def _predict_box(followed: Followed, dt_s: float, params: VisionTrackingParams) -> Followed:
    px_per_m = _width(followed.track.bbox) / _CAR_WIDTH_M
    moved = kalman.predict(followed.box_filter, dt_s, params.accel_sigma_mps2 * px_per_m)
    box = _around(moved.mean[:2], followed.track.bbox)
    return evolve(followed, box_filter=moved, track=evolve(followed.track, bbox=box))


def _predict_place(followed: Followed, dt_s: float, params: VisionTrackingParams) -> Followed:
    """The place a moment later, and the box grown or shrunk as the range changed. A place not measured for
    ``max_missed_s`` is forgotten, though its box be seen (it may be too near to be measured)."""
    if followed.place_filter is None:
        return followed
    moved = kalman.predict(followed.place_filter, dt_s, params.accel_sigma_mps2)
    before_m, now_m = (math.hypot(*filtered.mean[:2]) for filtered in (followed.place_filter, moved))
    if followed.unplaced_s > params.max_missed_s or now_m <= 0.0 or moved.mean[0] <= 0.0:
        lost = evolve(followed.track, distance_m=None, sigma_m=None, position=None, velocity_mps=None)
        return evolve(followed, place_filter=None, placed=0, track=lost)
    box = _around(followed.box_filter.mean[:2], followed.track.bbox, before_m / now_m)
    return evolve(followed, place_filter=moved, track=evolve(followed.track, bbox=box))


def _match(
    expected: list[Followed], measurements: tuple[VisionMeasurement, ...], params: VisionTrackingParams
) -> dict[int, int]:
    """Index of followed object → index of measurement: the one-to-one choice of least total cost, where leaving a pair
    apart costs as much as a pair at its gate. (Making as many pairs as possible would shift a whole row of cars by one
    when the first leaves the picture.)"""
    if not expected or not measurements:
        return {}
    cost = _costs(expected, measurements, params)
    rows, columns = linear_sum_assignment(np.minimum(cost, 1.0))
    return {int(row): int(column) for row, column in zip(rows, columns, strict=True) if cost[row, column] < 1.0}


def _costs(expected: list[Followed], measurements: tuple[VisionMeasurement, ...], params: VisionTrackingParams) -> F64:
    """(n, m) how unlike each box is to each expected one: 0 the same, 1 at the gate, infinite for another kind.

    queue: distance of the centres (print: of the half widths). kalman: also how much the width changed."""
    old = np.array([followed.track.bbox for followed in expected])
    new = np.array([seen.detection.bbox for seen in measurements])
    apart = (old[:, None, :2] + old[:, None, 2:] - new[:, :2] - new[:, 2:]) / 2
    moved_px = np.hypot(apart[..., 0], apart[..., 1])
    if params.filter == "queue":
        cost = moved_px / params.gate_px
    else:
        old_width, new_width = old[:, 2] - old[:, 0], new[:, 2] - new[:, 0]
        unseen_s = np.array([followed.unseen_s for followed in expected])
        growth = np.clip(unseen_s / _NOMINAL_DT_S, 1.0, _MAX_GROWTH)
        moved = moved_px / (np.maximum(params.gate_px, params.gate_sizes * old_width) * growth)[:, None]
        ratio = np.maximum(new_width, 1.0) / np.maximum(old_width, 1.0)[:, None]
        cost = np.hypot(moved, np.abs(np.log(ratio)) / math.log(params.max_size_ratio))
    kinds = [followed.track.label for followed in expected]
    named = [seen.detection.label for seen in measurements]
    return np.where([[_same_kind(a, b) for b in named] for a in kinds], cost, np.inf)


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
    shown = evolve(
        followed.track,
        bbox=detection.bbox,
        label=detection.label,
        score=detection.score,
        hits=followed.track.hits + 1,
        missed=0,
        carried=False,
        measured=seen.distance_m is not None,
    )
    current = evolve(followed, track=shown, unseen_s=0.0)
    if params.filter == "queue":
        measured = evolve(shown, distance_m=seen.distance_m, sigma_m=seen.sigma_m, position=seen.position)
        return evolve(current, track=measured)
    votes = dict(followed.votes)
    votes[detection.label] = votes.get(detection.label, 0.0) + detection.score
    label = max(votes, key=lambda name: votes[name])
    box_filter = kalman.update(followed.box_filter, _centre(detection.bbox), _box_noise(detection.bbox))
    current = evolve(current, track=evolve(shown, label=label), votes=tuple(votes.items()), box_filter=box_filter)
    return _place(current, seen, guess, params)


def _missed(followed: Followed) -> Followed:
    return evolve(followed, track=evolve(followed.track, missed=followed.track.missed + 1))


def _place(followed: Followed, seen: VisionMeasurement, guess: SpeedGuess, params: VisionTrackingParams) -> Followed:
    """The measured place taken in; one far from the expected weighs less, by as much as it is too far."""
    if seen.position is None or seen.sigma_m is None or seen.distance_m is None:
        bare = evolve(followed.track, distance_m=seen.distance_m, sigma_m=seen.sigma_m)
        return evolve(followed, track=bare) if followed.place_filter is None else _show(followed)
    noise = place_noise(seen.position, seen.sigma_m, params.bearing_sigma_deg)
    if followed.place_filter is None:
        filtered = kalman.start(seen.position, noise, guess.sigma_mps)
        filtered.mean[2] = guess.along_mps
    else:
        surprise = kalman.mahalanobis2(followed.place_filter, seen.position, noise)
        filtered = kalman.update(followed.place_filter, seen.position, noise * max(1.0, surprise / _OUTLIER))
    share = seen.sigma_m / seen.distance_m
    return _show(evolve(followed, place_filter=filtered, placed=followed.placed + 1, unplaced_s=0.0), share)


def _show(followed: Followed, share: float | None = None) -> Followed:
    """The track's public numbers, from its filter. ``share``: sigma over distance of the measurement taken in.

    The sigma shown never falls below that of one sighting: most of it is the object's own unknown height, an error
    that no number of sightings averages out.
    """
    if followed.place_filter is None:
        return followed
    x, y, vx, vy = followed.place_filter.mean.tolist()
    (xx, xy), (_, yy) = followed.place_filter.cov[:2, :2].tolist()
    range_m = math.hypot(x, y)
    filter_sigma = math.sqrt(x * x * xx + 2 * x * y * xy + y * y * yy) / range_m  # along the ray
    if share is None:
        before = followed.track
        share = before.sigma_m / before.distance_m if before.sigma_m and before.distance_m else 0.0
    shown = evolve(
        followed.track,
        distance_m=range_m,
        sigma_m=max(filter_sigma, share * range_m),
        position=(x, y),
        velocity_mps=(vx, vy) if followed.placed >= 2 else None,
    )
    return evolve(followed, track=shown)


def place_noise(position: tuple[float, float], range_sigma_m: float, bearing_sigma_deg: float) -> F64:
    """(2, 2) covariance of a place seen by a camera: long along the ray, narrow across it."""
    bearing = math.atan2(position[1], position[0])
    across_m = math.hypot(*position) * math.radians(bearing_sigma_deg)
    c, s = math.cos(bearing), math.sin(bearing)
    along, across = range_sigma_m**2, across_m**2
    off = c * s * (along - across)
    return np.array([[c * c * along + s * s * across, off], [off, s * s * along + c * c * across]])


def _box_noise(box: Box) -> F64:
    return np.eye(2) * max(_CENTRE_NOISE * _width(box), 1.0) ** 2


def _box_speed_sigma(box: Box) -> float:
    return SPEED_SIGMA_MPS * _width(box) / _CAR_WIDTH_M


def _around(centre: F64, box: Box, scale: float = 1.0) -> Box:
    half_w, half_h = _width(box) / 2 * scale, (box[3] - box[1]) / 2 * scale
    u, v = float(centre[0]), float(centre[1])
    return u - half_w, v - half_h, u + half_w, v + half_h


def _centre(box: Box) -> tuple[float, float]:
    return (box[0] + box[2]) / 2, (box[1] + box[3]) / 2


def _width(box: Box) -> float:
    return box[2] - box[0]
