from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.params import VisionTrackingParams
from pipeline.types import Box, Detection, VisionMeasurement, VisionTrack
from pipeline.vision.place_filter import PlaceMeasurement, start
from pipeline.vision.tracking import VisionTrackerState, track

QUEUE = VisionTrackingParams(filter="queue")
KALMAN = VisionTrackingParams()
FOCAL_PX, CENTRE_PX = 900.0, 640.0
BOTH = pytest.mark.parametrize("params", [QUEUE, KALMAN], ids=["queue", "kalman"])


def _car(x: float, y: float = 0.0, label: str = "car", score: float = 0.9, sigma: float = 0.05) -> VisionMeasurement:
    """A car seen with a focal length of 900 px; ``sigma``: of its distance, as a share."""
    u, w, h = CENTRE_PX - FOCAL_PX * y / x, FOCAL_PX * 1.8 / x, FOCAL_PX * 1.5 / x
    box = (u - w / 2, 360 - h / 2, u + w / 2, 360 + h / 2)
    distance = float(np.hypot(x, y))
    return VisionMeasurement(Detection(box, label, score), distance, sigma * distance, (x, y))


def _blind(box: Box, label: str = "car") -> VisionMeasurement:
    return VisionMeasurement(Detection(box, label, 0.9), None, None, None)


def _drive(
    images: list[tuple[VisionMeasurement, ...] | None], params: VisionTrackingParams, dt_s: float = 0.1
) -> list[tuple[VisionTrack, ...]]:
    state, shown = VisionTrackerState(), []
    for index, image in enumerate(images):
        state, tracks = track(state, image, dt_s if index else None, params)
        shown.append(tracks)
    return shown


@BOTH
@pytest.mark.parametrize("dt_s", [0.1, 0.3])
def test_two_cars_keep_their_numbers(params: VisionTrackingParams, dt_s: float) -> None:
    """The lead comes closer while its neighbour falls back; detections are in order of score, which alternates."""
    images = []
    for step in range(12):
        lead, beside = _car(32.0 - 2.7 * dt_s * step), _car(20.0 + 3.0 * dt_s * step, 3.5)
        images.append((lead, beside) if step % 2 else (beside, lead))
    for tracks in _drive(images, params, dt_s):
        assert [(t.id, round(t.position[1] / 3.5)) for t in tracks if t.position] == [(1, 1), (2, 0)]


@BOTH
def test_a_row_of_cars_does_not_shift_when_the_first_leaves(params: VisionTrackingParams) -> None:
    """Maximising the number of pairs would pass every id to the neighbour."""
    row = [_car(30.0, y) for y in (6.0, 3.6, 1.2, -1.2)]
    tracks = _drive([tuple(row)] * 3 + [(*tuple(row[1:]), _car(30.0, -3.6))], params)[-1]
    places = {t.id: t.position for t in tracks if not t.carried}
    assert places.keys() == {2, 3, 4, 5}
    assert places[2] == pytest.approx((30.0, 3.6))
    assert places[5] == pytest.approx((30.0, -3.6))


@BOTH
def test_one_new_object_takes_one_new_number(params: VisionTrackingParams) -> None:
    """An error in the paper: it uses up an id for every failed candidate."""
    others = tuple(_car(30.0, y) for y in (8.0, 4.0, -4.0))
    tracks = _drive([others, (*others, _car(15.0))], params)[-1]
    assert [t.id for t in tracks] == [1, 2, 3, 4]
    assert tracks[3].hits == 1
    assert tracks[3].velocity_mps is None


@BOTH
def test_an_unseen_object_is_carried_then_ends(params: VisionTrackingParams) -> None:
    shown = _drive([(_car(30.0),)] * 3 + [()] * 12, params)
    carried = [tracks[0] for tracks in shown[3:] if tracks]
    assert all(t.carried and t.hits == 3 for t in carried)
    assert [t.missed for t in carried] == list(range(1, params.queue_frames))
    assert shown[-1] == ()


@BOTH
def test_time_ends_an_object_before_the_frames_do(params: VisionTrackingParams) -> None:
    shown = _drive([(_car(30.0),)] * 2 + [()] * 4, params, dt_s=0.4)
    assert [len(tracks) for tracks in shown] == [1, 1, 1, 1, 0, 0]


@BOTH
def test_a_tick_without_the_camera_is_no_miss(params: VisionTrackingParams) -> None:
    shown = _drive([(_car(30.0),)] * 3 + [None] * 3 + [(_car(30.0),)], params)
    assert all(tracks[0].carried and tracks[0].missed == 0 for tracks in shown[3:6])
    assert (shown[6][0].id, shown[6][0].hits, shown[6][0].carried) == (1, 4, False)


@BOTH
def test_numbers_are_never_given_twice(params: VisionTrackingParams) -> None:
    shown = _drive([(_car(30.0),)] + [()] * 12 + [(_car(30.0),)], params)
    assert shown[-1][0].id == 2


@BOTH
@pytest.mark.parametrize("label", ["person", "traffic light"])
def test_kinds_are_not_mixed_but_vehicle_names_are(params: VisionTrackingParams, label: str) -> None:
    car = _car(30.0)
    other = _blind(car.detection.bbox, label)
    assert [t.id for t in _drive([(car,), (other,)], params)[-1]] == [1, 2]
    assert [t.id for t in _drive([(car,), (_car(30.0, label="truck"),)], params)[-1]] == [1]


def test_queue_shows_what_was_measured_last() -> None:
    first, second = _drive([(_car(30.0),), (_car(28.0),)], QUEUE)
    assert (second[0].distance_m, second[0].position, second[0].velocity_mps) == (28.0, (28.0, 0.0), None)
    assert second[0].bbox == _car(28.0).detection.bbox
    assert first[0].id == second[0].id


def test_queue_gate_is_on_the_move_of_centres() -> None:
    """79 px is the same object, 81 px another one; half widths (as printed) would not change at all."""
    for moved, ids in [(79.0, [1]), (81.0, [1, 2])]:
        box = _car(30.0).detection.bbox
        there = _blind((box[0] + moved, box[1], box[2] + moved, box[3]))
        assert [t.id for t in _drive([(_blind(box),), (there,)], QUEUE)[-1]] == ids


def test_kalman_finds_the_velocity_and_it_is_null_at_first() -> None:
    shown = _drive([(_car(40.0 - 0.5 * step, sigma=0.02),) for step in range(30)], KALMAN)
    assert shown[0][0].velocity_mps is None
    assert shown[1][0].velocity_mps is not None
    assert shown[-1][0].velocity_mps == pytest.approx((-5.0, 0.0), abs=0.3)
    assert shown[-1][0].distance_m == pytest.approx(25.5, abs=0.3)


def test_kalman_carries_the_place_and_the_box_along() -> None:
    shown = _drive([(_car(40.0 - 0.5 * step, sigma=0.02),) for step in range(20)] + [()] * 5, KALMAN)
    before, after = shown[19][0], shown[24][0]
    assert after.carried
    assert after.distance_m == pytest.approx(28.0, abs=0.4)
    assert after.bbox == pytest.approx(_car(28.0).detection.bbox, abs=2.0)
    assert after.sigma_m > before.sigma_m


def test_kalman_follows_a_box_that_crosses_the_image() -> None:
    shown = _drive([(_car(20.0, 8.0 - 0.6 * step),) for step in range(12)] + [()] * 3, KALMAN)
    assert all(len(tracks) == 1 for tracks in shown)
    u = (shown[-1][0].bbox[0] + shown[-1][0].bbox[2]) / 2
    expected = _car(20.0, 8.0 - 0.6 * 14).detection.bbox
    assert u == pytest.approx((expected[0] + expected[2]) / 2, abs=8.0)


def test_one_absurd_distance_hardly_moves_the_track() -> None:
    """A box of half the car doubles its distance in one image, as happens in real ones."""
    steady = [(_car(24.0),)] * 8
    good = _car(24.0)
    half = VisionMeasurement(good.detection, 44.0, 2.2, (44.0, 0.0))
    assert _drive([*steady, (half,)], KALMAN)[-1][0].distance_m == pytest.approx(24.0, abs=2.5)
    assert _drive([*steady, (half,)], QUEUE)[-1][0].distance_m == 44.0


def test_one_wrong_name_does_not_rename_the_object() -> None:
    images = [(_car(24.0),)] * 4 + [(_car(24.0, label="bus", score=0.6),)]
    assert _drive(images, KALMAN)[-1][0].label == "car"
    assert _drive(images, QUEUE)[-1][0].label == "bus"


def test_sigma_never_falls_below_one_sightings() -> None:
    last = _drive([(_car(30.0, sigma=0.1),)] * 40, KALMAN)[-1][0]
    assert last.sigma_m == pytest.approx(3.0, rel=0.01)


def test_an_object_without_distance_is_followed_all_the_same() -> None:
    near = _blind((300.0, 200.0, 900.0, 719.5))
    tracks = _drive([(near,)] * 3, KALMAN)[-1]
    assert (tracks[0].hits, tracks[0].distance_m, tracks[0].position, tracks[0].velocity_mps) == (3, None, None, None)


def test_a_distance_no_longer_measured_is_forgotten() -> None:
    """The lead comes so near that its box is cut off: the last distance must not persist."""
    car = _car(20.0)
    shown = _drive([(car,)] * 5 + [(_blind(car.detection.bbox),)] * 12, KALMAN)
    assert shown[6][0].distance_m == pytest.approx(20.0, abs=0.2)
    assert shown[-1][0].hits == 17
    assert shown[-1][0].distance_m is None
    assert shown[-1][0].velocity_mps is None


def test_a_distance_without_a_place_is_shown_as_it_is() -> None:
    seen = VisionMeasurement(_car(20.0).detection, 20.0, 2.0, None)
    last = _drive([(seen,)] * 3, KALMAN)[-1][0]
    assert (last.distance_m, last.sigma_m, last.position) == (20.0, 2.0, None)


def test_noise_lies_along_the_ray() -> None:
    range_m = 20 * 2**0.5
    noise = start(PlaceMeasurement(range_m, np.pi / 4, 3.0 / range_m, np.radians(0.3)), 0.0, 8.0).cov[:2, :2]
    along, across = np.array([1.0, 1.0]) / 2**0.5, np.array([-1.0, 1.0]) / 2**0.5
    assert along @ noise @ along == pytest.approx(9.0)
    assert across @ noise @ across == pytest.approx((20 * 2**0.5 * np.radians(0.3)) ** 2)


_boxes = st.tuples(st.floats(5.0, 80.0), st.floats(-12.0, 12.0), st.sampled_from(["car", "truck", "person"]))
_images = st.lists(st.one_of(st.none(), st.lists(_boxes, max_size=6)), max_size=12)


@BOTH
@given(_images, st.floats(0.02, 1.4))
def test_every_detection_is_in_one_track_and_tracks_are_bounded(
    params: VisionTrackingParams, images: list[list[tuple[float, float, str]] | None], dt_s: float
) -> None:
    measured = [None if p is None else tuple(_car(x, y, label) for x, y, label in p) for p in images]
    born = 0
    for image, tracks in zip(measured, _drive(measured, params, dt_s), strict=True):
        seen = [t for t in tracks if not t.carried]
        assert len({t.id for t in tracks}) == len(tracks)
        assert sorted(t.bbox for t in seen) == sorted(m.detection.bbox for m in image or ())
        assert all(t.missed < params.queue_frames for t in tracks)
        assert all(t.velocity_mps is None for t in tracks if t.hits < 2)
        assert all(np.isfinite(t.bbox).all() for t in tracks)
        born = max([born, *(t.id for t in tracks)])
    assert born <= sum(len(p or ()) for p in images)


def test_a_standing_car_ahead_of_a_fast_ego_car_is_soon_known_to_stand() -> None:
    """Twelve images of a car approached at 28 m/s: with a known ego speed, its closing speed is right soon."""

    def closing_mps(ego_speed_mps: float | None) -> float:
        state = VisionTrackerState()
        for index in range(12):
            seen = _car(70.0 - 2.8 * index, sigma=0.12)
            state, tracks = track(state, (seen,), 0.1 if index else None, VisionTrackingParams(), ego_speed_mps)
        assert tracks[0].velocity_mps is not None
        return -tracks[0].velocity_mps[0]

    assert closing_mps(28.0) > 25.0
    assert closing_mps(None) < 24.0


@pytest.mark.parametrize("images", [1, 3, 20], ids=lambda images: f"{images} double boxes")
def test_a_vehicle_keeps_its_number_however_long_it_had_two_boxes(images: int) -> None:
    """The detector then returns only the box that was the second one."""
    first, second = _car(40.0), _car(39.0, -0.6)
    shown = _drive([(first,)] * 10 + [(first, second)] * images + [(second,)] * 10, KALMAN)
    assert [len(tracks) for tracks in shown[10:-10]] == [2] * images
    assert [[each.id for each in tracks] for tracks in shown[-5:]] == [[1]] * 5


def test_a_carried_box_on_a_seen_one_is_a_ghost() -> None:
    """A car jumps in the image by more than the gate and gets a new id: the old track must not stay beside it."""
    gone = [(_car(20.0, 0.0),)] * 3 + [(_car(20.0, 0.0), _car(20.0, 6.0))] * 2
    shown = _drive([*gone, (_car(21.0, 0.1, label="person"), _car(20.0, 6.0))], KALMAN)
    assert [track.carried for track in shown[-1]] == [True, False, False], "another kind of object is no ghost's heir"
    tight = KALMAN.model_copy(update={"gate_px": 5.0, "gate_sizes": 0.1})
    jumped = _drive([(_car(20.0, 0.0),)] * 3 + [(_car(20.0, 0.45),)], tight)
    assert [(track.id, track.carried) for track in jumped[-1]] == [(2, False)]


def test_a_known_turn_keeps_the_number_of_a_small_box_that_is_missed_meanwhile() -> None:
    """A car 70 m ahead; ours turns ever faster for 0.8 s, in which the car is missed."""
    state, u_off, ids = VisionTrackerState(), 0.0, []
    for k in range(24):
        pan_pxps = FOCAL_PX * 0.4 * max(0.0, 0.1 * (k - 10))
        u_off += 0.1 * pan_pxps
        seen = (_car(70.0, -u_off / FOCAL_PX * 70.0),) if not 10 <= k < 18 else ()
        state, tracks = track(state, seen, 0.1 if k else None, KALMAN, 10.0, pan_pxps)
        ids += [each.id for each in tracks if not each.carried]
    assert set(ids) == {1}


@pytest.mark.parametrize(("aside_m", "same"), [(0.3, True), (2.5, False)])
def test_a_missed_car_does_not_give_its_number_to_a_neighbour(aside_m: float, same: bool) -> None:
    """Straight on, with a measured yaw rate: the car's own box hardly moves in 0.6 s, so another box is another car."""
    state = VisionTrackerState()
    for k in range(22):
        seen = (_car(48.0),) if k < 15 else () if k < 21 else (_car(48.0, aside_m),)
        state, tracks = track(state, seen, 0.1 if k else None, KALMAN, 20.0, 0.0)
    assert ([each.id for each in tracks if not each.carried] == [1]) is same


def test_a_new_far_box_moves_with_the_image() -> None:
    state, _ = track(VisionTrackerState(), (_car(70.0),), None, KALMAN, 10.0, 250.0)
    _, (shown,) = track(state, None, 0.1, KALMAN, 10.0, 250.0)
    assert (shown.bbox[0] + shown.bbox[2]) / 2 == pytest.approx(CENTRE_PX + 25.0, abs=0.5)


@BOTH
def test_a_track_says_whether_its_distance_was_measured_now(params: VisionTrackingParams) -> None:
    car = _car(20.0)
    shown = _drive([(car,), (_blind(car.detection.bbox),), (car,), ()], params)
    assert [(tracks[0].carried, tracks[0].measured) for tracks in shown] == [
        (False, True),
        (False, False),
        (False, True),
        (True, False),
    ]
