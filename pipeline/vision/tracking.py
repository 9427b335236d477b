"""Tracks boxes from image to image (paper, Algorithm 1), as a pure function: state in, state out.

The printed algorithm measures half widths where it means centres, takes the first candidate under the threshold and
gives a new number to every one that fails. Here, a box goes to its nearest candidate, one-to-one, and a new object is
numbered once. An object that is not seen is carried, marked as such, and dropped after ``queue_frames`` images or
``max_missed_s``.

There are two filters. ``queue`` is the paper's: the newest box of each object represents it, its distance is the last
one measured, and it has no velocity. ``kalman`` predicts both the box and the position, each with a constant-velocity
filter.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pipeline.common.fast_replace import evolve
from pipeline.common.geometry import iou_matrix
from pipeline.common.kalman import CvState
from pipeline.params import VisionTrackingParams
from pipeline.types import VisionMeasurement, VisionTrack
from pipeline.vision import box_filter
from pipeline.vision.association import Expected, first_box_on, match, same_kind
from pipeline.vision.followed import (
    Followed,
    PredictedPlace,
    SpeedGuess,
    is_likelier,
    learned,
    predict_places,
    renamed,
    take_place,
    with_place,
    without_ranges,
)


@dataclass(frozen=True)
class VisionTrackerState:
    """State from one image to the next."""

    next_id: int = 1
    """Number of the next new track; numbers are never reused."""
    followed: tuple[Followed, ...] = field(default=())
    """All live tracks."""
    pan_pxps: float | None = None
    """Speed of the image to the right due to the yaw rate at the last tick; None if that was not known."""


def track(
    state: VisionTrackerState,
    measurements: tuple[VisionMeasurement, ...] | None,
    dt_s: float | None,
    params: VisionTrackingParams,
    ego_speed_mps: float | None = None,
    pan_pxps: float | None = None,
) -> tuple[VisionTrackerState, tuple[VisionTrack, ...]]:
    """One tick. ``measurements`` None: no image; time passes, but the objects do not count as missed. ``dt_s`` None:
    the first tick. ``ego_speed_mps``: used to guess the speed of a new object. ``pan_pxps``: speed at which a distant
    object moves to the right in the image because the car turns to the left, pixels/s; None if that is not known.
    Tracks are returned by id."""
    # Predict every track to now; without an image that is all
    guess = _first_guess(ego_speed_mps)
    change = pan_pxps - state.pan_pxps if pan_pxps is not None and state.pan_pxps is not None else None
    expected = _predict(state.followed, dt_s or 0.0, change, params)
    if measurements is None:
        kept = tuple(followed for followed in expected if followed.unseen_s <= params.max_missed_s)
        return evolve(state, followed=kept, pan_pxps=pan_pxps), tuple(followed.track for followed in kept)
    # Match tracks and boxes one-to-one; a track without a box was missed in this image
    partner = match([_expected(followed, params) for followed in expected], measurements, params)
    corrected = _correct(expected, measurements, partner, params)
    kept_list = [
        _seen(followed, measurements[partner[row]], corrected[row], guess, ego_speed_mps, params)
        if row in partner
        else _missed(followed)
        for row, followed in enumerate(expected)
    ]
    # Start a new track for every unmatched box; end tracks that were missed for too long
    taken = set(partner.values())
    fresh = [measurement for column, measurement in enumerate(measurements) if column not in taken]
    on = first_box_on(fresh, [each.track for each in kept_list])
    kept_list += [
        _new(state.next_id + n, *each, guess, pan_pxps or 0.0, params)
        for n, each in enumerate(zip(fresh, on, strict=True))
    ]
    alive = tuple(
        followed
        for followed in kept_list
        if followed.track.missed < params.queue_frames and followed.unseen_s <= params.max_missed_s
    )
    if params.filter == "kalman":
        alive = _without_ghosts(alive, params)
    after = VisionTrackerState(state.next_id + len(fresh), alive, pan_pxps)
    return after, tuple(followed.track for followed in alive)


def learn_heights(
    state: VisionTrackerState, ranges: Mapping[int, tuple[float, float]], params: VisionTrackingParams
) -> VisionTrackerState:
    """Learn heights from LiDAR distances of objects seen by both sensors. A learned height applies from the next image
    on; the object's position is scaled with it, so that the change is not mistaken for motion.

    ranges: distance and its standard deviation in metres, by id of the vision track.
    """
    if params.filter == "queue" or not ranges:
        return state
    return evolve(
        state,
        followed=tuple(
            learned(each, *ranges[each.track.id], params) if each.track.id in ranges else each
            for each in state.followed
        ),
    )


def forget_heights(
    state: VisionTrackerState, tracks: tuple[VisionTrack, ...], bereft: Mapping[int, tuple[int, float]]
) -> tuple[VisionTrackerState, tuple[VisionTrack, ...]]:
    """The objects and their tracks, without heights that were learned from another vehicle's ranges.

    bereft: by track id, the track whose box has the cluster now by which the height was learned, and the cluster's
    range in metres. The cluster belongs to the box whose height it makes the more usual one.
    """
    by_id = {each.track.id: each for each in state.followed}
    wrong = {
        number: without_ranges(by_id[number])
        for number, (other, range_m) in bereft.items()
        if by_id[number].height.is_ranged and is_likelier(by_id[other], by_id[number], range_m)
    }
    followed = tuple(wrong.get(each.track.id, each) for each in state.followed)
    return evolve(state, followed=followed), tuple(
        wrong[each.id].track if each.id in wrong else each for each in tracks
    )


def _expected(followed: Followed, params: VisionTrackingParams) -> Expected:
    """The prediction that the next box of an object is compared with."""
    noise = box_filter.centre_variance(followed.track.bbox, params)
    spread = math.sqrt(followed.box_filter.cov[0, 0] + noise)
    return Expected(followed.track, spread, math.sqrt(noise), followed.unseen_s, followed.double_of)


def _without_ghosts(alive: tuple[Followed, ...], params: VisionTrackingParams) -> tuple[Followed, ...]:
    """Without carried objects whose predicted box overlaps a seen one. Such an object is the same car under a new id,
    or is hidden by the nearer car; in both cases its state is no longer known."""
    seen = [followed.track for followed in alive if not followed.track.carried]
    carried = [followed.track for followed in alive if followed.track.carried]
    overlap = iou_matrix(np.array([track.bbox for track in carried]), np.array([track.bbox for track in seen]))
    pairs = np.argwhere(overlap > params.ghost_iou)
    ghosts = {carried[i].id for i, j in pairs if same_kind(carried[i].label, seen[j].label)}
    return tuple(followed for followed in alive if followed.track.id not in ghosts) if ghosts else alive


def _predict(
    followed: Sequence[Followed], dt_s: float, pan_change_pxps: float | None, params: VisionTrackingParams
) -> list[Followed]:
    """The objects predicted to now; each counts as carried until a box confirms it. All filters of a kind are predicted
    together. pan_change_pxps: by how much the image moves faster to the right than at the last tick; None if not
    known."""
    if params.filter == "queue":
        tracks = [evolve(each.track, carried=True, measured=False, returns=0) for each in followed]
        return [_aged(each, dt_s, track=track) for each, track in zip(followed, tracks, strict=True)]
    boxes = box_filter.predict(
        [each.box_filter for each in followed], [each.track.bbox for each in followed], dt_s, pan_change_pxps, params
    )
    places = predict_places(followed, dt_s, params)
    return [_predicted(each, box, place, dt_s) for each, box, place in zip(followed, boxes, places, strict=True)]


def _predicted(followed: Followed, moved: CvState, predicted: PredictedPlace, dt_s: float) -> Followed:
    place, growth = predicted
    unseen: dict[str, Any] = {
        "carried": True,
        "measured": False,
        "returns": 0,
        "bbox": box_filter.around(moved.mean, followed.track.bbox, growth),
    }
    if place is not None:
        track = with_place(followed, place, followed.placed, **unseen)
    elif followed.place_filter is not None:
        track = evolve(followed.track, **unseen, distance_m=None, sigma_m=None, position=None, velocity_mps=None)
    else:
        track = evolve(followed.track, **unseen)
    placed = followed.placed if place is not None or followed.place_filter is None else 0
    return _aged(followed, dt_s, box_filter=moved, place_filter=place, placed=placed, track=track)


def _aged(followed: Followed, dt_s: float, **changes: Any) -> Followed:
    """The object ``dt_s`` later, not seen yet, with these fields changed."""
    unseen_s, unplaced_s = followed.unseen_s + dt_s, followed.unplaced_s + dt_s
    return evolve(followed, unseen_s=unseen_s, unplaced_s=unplaced_s, seen=None, **changes)


def _correct(
    expected: Sequence[Followed],
    measurements: Sequence[VisionMeasurement],
    partner: Mapping[int, int],
    params: VisionTrackingParams,
) -> dict[int, CvState]:
    """The box filters of all matched objects, by their row in ``expected``, updated together by their boxes."""
    if params.filter == "queue":
        return {row: expected[row].box_filter for row in partner}
    boxes = [measurements[column].detection.bbox for column in partner.values()]
    before, predicted = [expected[row].box_filter for row in partner], [expected[row].track.bbox for row in partner]
    return dict(zip(partner, box_filter.update(before, boxes, predicted, params), strict=True))


def _first_guess(ego_speed_mps: float | None) -> SpeedGuess:
    """Objects on a road stand still or move in our direction: relative speeds from −v to 0, around −v/2. Starting from
    0 ± 8 m/s, it would take 2 s to recognise that a car ahead of a fast ego vehicle stands still. Without ego speed
    this is the fallback."""
    if ego_speed_mps is None:
        return SpeedGuess(0.0, box_filter.SPEED_SIGMA_MPS)
    return SpeedGuess(-ego_speed_mps / 2, max(box_filter.SPEED_SIGMA_MPS, ego_speed_mps / 2))


def _new(
    track_id: int,
    seen: VisionMeasurement,
    double_of: int | None,
    guess: SpeedGuess,
    pan_pxps: float,
    params: VisionTrackingParams,
) -> Followed:
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
        ranges=int(seen.distance_m is not None),
    )
    centre = box_filter.start(detection.bbox, pan_pxps, params)
    votes = ((detection.label, detection.score),)
    unplaced_s = 0.0 if seen.position else math.inf
    followed = Followed(shown, 0.0, unplaced_s, 0, centre, None, votes, double_of=double_of)
    return take_place(followed, seen, guess, None, params) if params.filter == "kalman" else followed


def _seen(
    followed: Followed,
    seen: VisionMeasurement,
    centre: CvState,
    guess: SpeedGuess,
    ego_speed_mps: float | None,
    params: VisionTrackingParams,
) -> Followed:
    """The object updated by this image's box and distance. centre: its box filter, already updated by the box."""
    detection = seen.detection
    label, votes, slip = detection.label, followed.votes, 0.0
    if params.filter == "kalman":
        tally = dict(votes)
        tally[label] = tally.get(label, 0.0) + detection.score
        label, votes = max(tally, key=lambda name: tally[name]), tuple(tally.items())
        slip = box_filter.slip_px(detection.bbox, followed.track.bbox, 0) / box_filter.width(detection.bbox)
    track = evolve(
        followed.track,
        bbox=detection.bbox,
        label=label,
        score=detection.score,
        hits=followed.track.hits + 1,
        images=followed.track.images + 1,
        missed=0,
        carried=False,
        measured=seen.distance_m is not None,
    )
    if params.filter == "queue":
        ranges = track.ranges + 1 if seen.distance_m is not None else 0
        track = evolve(track, distance_m=seen.distance_m, sigma_m=seen.sigma_m, position=seen.position, ranges=ranges)
    followed = renamed(followed, label, seen)
    current = evolve(followed, track=track, unseen_s=0.0, votes=votes, box_filter=centre)
    slip_m = slip * box_filter.CAR_WIDTH_M
    return take_place(current, seen, guess, ego_speed_mps, params, slip_m) if params.filter == "kalman" else current


def _missed(followed: Followed) -> Followed:
    track = evolve(followed.track, missed=followed.track.missed + 1, images=followed.track.images + 1)
    return evolve(followed, track=track)
