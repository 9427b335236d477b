"""From points in an image to lines on the road, and back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.alignment.projection import Angular
from pipeline.lanes.drawn_lines import in_image, polylines
from pipeline.lanes.road_lines import LaneState, Pitch, RoadView, follow, measure, road_edges, road_plane
from pipeline.lidar.ground import Ground
from pipeline.params import LaneParams
from pipeline.types import EgoState, RawLanes
from pipeline.types.detections import ROAD_LEFT, ROAD_RIGHT
from pipeline.types.lane import EgoLane
from tests.pipeline.build import moment
from tests.pipeline.lanes.lane_scenes import FLAT, GROUND_M, STRAIGHT, aligned, paint

PARAMS = LaneParams(mount_height_m=-GROUND_M)
SURE, UNSURE = Pitch(0.0, 1e-4), Pitch(0.0, 0.014)


def seen(raw: RawLanes, through=None, params: LaneParams = PARAMS, **more) -> EgoLane:
    """The ego lane of one image alone."""
    _, lane = follow(LaneState(), raw, RoadView(through or aligned(), **more), moment(), params)
    assert lane is not None
    return lane


ROADS = {
    "straight": STRAIGHT,
    "off the middle": ((2.6, 0.0, 0.0, 0.0), (-0.9, 0.0, 0.0, 0.0)),
    "turned": ((1.75, 0.06, 0.0, 0.0), (-1.75, 0.06, 0.0, 0.0)),
    "left bend, 150 m": ((1.75, 0.0, 1 / 300, 0.0), (-1.75, 0.0, 1 / 300, 0.0)),
    "right bend, 150 m": ((1.75, 0.0, -1 / 300, 0.0), (-1.75, 0.0, -1 / 300, 0.0)),
    "transition": ((1.75, 0.0, 0.0, 8e-6), (-1.75, 0.0, 0.0, 8e-6)),
    "five lines": (*STRAIGHT, (5.25, 0.0, 0.0, 0.0), (-5.25, 0.0, 0.0, 0.0), (8.75, 0.0, 0.0, 0.0)),
}


@pytest.mark.parametrize("numbered", [False, True])
@pytest.mark.parametrize("road", ROADS)
def test_lines_are_found_where_they_are(road: str, numbered: bool) -> None:
    left, right = ROADS[road][:2]
    lane = seen(paint(ROADS[road], noise_px=0.5, numbered=numbered))
    assert lane.left is not None
    assert lane.right is not None
    for line, true in ((lane.left, left), (lane.right, right)):
        for x_m, within_m in ((5.0, 0.06), (15.0, 0.1), (30.0, 0.3)):
            assert float(line.y_m(x_m)) == pytest.approx(np.polyval(true[::-1], x_m), abs=within_m)
        assert line.quality > 0.8
        assert line.x_max_m == pytest.approx(45.0, abs=4.0)
    assert lane.width_m == pytest.approx(3.5, abs=0.1)


@pytest.mark.parametrize("pitch_deg", [-1.0, -0.4, 0.0, 0.5, 1.0])
def test_the_pitch_is_the_one_under_which_lines_are_parallel(pitch_deg: float) -> None:
    raw = paint(through=aligned(pitch_down_deg=pitch_deg), noise_px=0.3)
    lane = seen(raw, params=PARAMS.model_copy(update={"pitch_sigma_deg": 2.0}))
    assert np.degrees(lane.pitch_rad) == pytest.approx(pitch_deg, abs=0.12)
    assert lane.width_m == pytest.approx(3.5, abs=0.06)


def test_a_pitch_that_is_not_looked_for_bends_the_lane_and_says_so() -> None:
    raw = paint(through=aligned(pitch_down_deg=0.5))
    sure = measure(raw, aligned(), FLAT, SURE, PARAMS)
    assert sure.pitch.rad == pytest.approx(0.0, abs=2e-3)
    unsure = measure(raw, aligned(), FLAT, UNSURE, PARAMS)
    assert unsure.pitch.sigma_rad > 1.5 * sure.pitch.sigma_rad
    sigma = [np.sqrt(found.lines[0].covariance[1, 1]) for found in (sure, unsure)]
    assert sigma[1] > sigma[0]


@given(
    offset=st.floats(-0.8, 0.8),
    heading=st.floats(-0.05, 0.05),
    curvature=st.floats(-1 / 200, 1 / 200),
    width=st.floats(2.9, 4.0),
)
def test_any_plausible_lane_is_found(offset: float, heading: float, curvature: float, width: float) -> None:
    both = [(offset + way * width / 2, heading, curvature / 2, 0.0) for way in (1.0, -1.0)]
    lane = seen(paint(tuple(both), noise_px=0.3))
    assert lane.left is not None
    assert lane.right is not None
    assert float(lane.left.y_m(10.0)) == pytest.approx(np.polyval(both[0][::-1], 10.0), abs=0.2)
    assert float(lane.right.y_m(10.0)) == pytest.approx(np.polyval(both[1][::-1], 10.0), abs=0.2)


def test_clutter_does_not_move_a_line() -> None:
    lane = seen(paint(noise_px=0.5, clutter=120))
    assert lane.left is not None
    assert lane.right is not None
    assert float(lane.left.y_m(15.0)) == pytest.approx(1.75, abs=0.1)
    assert float(lane.right.y_m(15.0)) == pytest.approx(-1.75, abs=0.1)


def test_clutter_alone_is_no_lane() -> None:
    """Random points, different in each image: a line found by chance in one is weak, and gone in the next."""
    state, sure = LaneState(), 0
    for seed in range(12):
        raw = paint((), clutter=150, seed=seed)
        state, lane = follow(
            state, raw, RoadView(aligned()), moment(EgoState(0, 15.0, 0.0), 0.1 if seed else None), PARAMS
        )
        assert lane is not None
        sure += all(line is not None and line.quality > 0.5 for line in (lane.left, lane.right))
    assert sure == 0


@pytest.mark.parametrize("count", [0, 3])
def test_no_points_are_no_lane_and_no_error(count: int) -> None:
    raw = paint()
    lane = seen(RawLanes("few", raw.points[:count], raw.scores[:count], raw.line[:count]))
    assert (lane.left, lane.right, lane.width_m) == (None, None, None)


WRONG = {
    "8° to the side": lambda: aligned(yaw_left_deg=8.0),
    "5° down": lambda: aligned(pitch_down_deg=5.0),
    "3° up": lambda: aligned(pitch_down_deg=-3.0),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_calibration_gives_no_lane_rather_than_a_wrong_one(wrong: str) -> None:
    """An error that the pitch search can correct may still give lines on the paint."""
    lane = seen(paint(), through=WRONG[wrong]())
    if lane.left is not None and lane.right is not None:
        assert lane.left.y_m([5.0, 15.0]) == pytest.approx(1.75, abs=0.2)
        assert lane.right.y_m([5.0, 15.0]) == pytest.approx(-1.75, abs=0.2)


@pytest.mark.parametrize("factor", [0.5, 1.9])
def test_a_wrong_mount_height_gives_no_pair(factor: float) -> None:
    eye_m = 0.8 - GROUND_M
    lane = seen(paint(), params=PARAMS.model_copy(update={"mount_height_m": factor * eye_m - 0.8}))
    assert lane.left is None or lane.right is None


def test_the_calibration_knows_the_roads_height_better_than_the_parameter_and_a_sweep_better_than_both() -> None:
    low = PARAMS.model_copy(update={"mount_height_m": -GROUND_M / 3})
    assert seen(paint(), params=low).width_m != pytest.approx(3.5, abs=0.2)
    assert seen(paint(), params=low, road_z_m=GROUND_M).width_m == pytest.approx(3.5, abs=0.1)
    _, lane = follow(LaneState(plane=FLAT), paint(), RoadView(aligned(), road_z_m=GROUND_M / 3), moment(), low)
    assert lane is not None
    assert lane.width_m == pytest.approx(3.5, abs=0.1)


def test_a_lane_in_the_wrong_place_is_not_made_of_one_far_line() -> None:
    lane = seen(paint(((4.5, 0.0, 0.0, 0.0),)))
    assert (lane.left, lane.right) == (None, None)
    near = seen(paint(((1.5, 0.0, 0.0, 0.0),)))
    assert near.left is not None
    assert near.right is None


def test_points_on_vehicles_are_no_paint() -> None:
    raw = paint(((1.75, 0.0, 0.0, 0.0), (-1.75, 0.0, 0.0, 0.0)))
    right_half = (640.0, 0.0, 1280.0, 720.0)
    lane = seen(raw, vehicles=[right_half])
    assert lane.left is not None
    assert lane.right is None


@pytest.mark.parametrize("pitch_deg", [-0.8, 0.0, 0.8])
def test_lines_are_drawn_back_onto_the_paint(pitch_deg: float) -> None:
    raw = paint(through=aligned(pitch_down_deg=pitch_deg))
    lane = seen(raw, params=PARAMS.model_copy(update={"pitch_sigma_deg": 2.0}))
    drawn = in_image(lane, aligned())
    for uv, points in ((drawn["left"], raw.points[:50]), (drawn["right"], raw.points[60:110])):
        rows = np.interp(-points[:, 1], -uv[:, 1], uv[:, 0])
        inside = (points[:, 1] < uv[0, 1]) & (points[:, 1] > uv[-1, 1])
        assert np.abs(rows - points[:, 0])[inside].max() < 3.0


def test_polylines_end_where_the_paint_does() -> None:
    lane = seen(paint(STRAIGHT[:1]))
    lines = polylines(lane)
    assert lines["left"][-1] == pytest.approx([45.0, 1.75], abs=2.0)
    assert np.all(np.diff(lines["left"][:, 0]) > 0)
    assert lines["right"].shape == (0, 2)


def test_the_angular_model_sees_the_same_lane() -> None:
    """A camera at the ego origin that measures angles: its eye is the LiDAR."""
    angular = Angular(1e-3, 1e-3, 640.0, 360.0)
    x = 1.0 / np.linspace(1 / 4.0, 1 / 30.0, 60)
    uv = np.concatenate([angular.project(np.column_stack([x, np.full(60, y), np.full(60, -1.5)])) for y in (1.6, -1.9)])
    raw = RawLanes("angles", uv.astype(np.float32), np.ones(120, np.float32), np.full(120, -1, np.int32))
    lane = seen(raw, through=angular, params=LaneParams(mount_height_m=1.5))
    assert lane.left is not None
    assert lane.right is not None
    assert float(lane.left.y_m(10.0)) == pytest.approx(1.6, abs=0.05)
    assert float(lane.right.y_m(10.0)) == pytest.approx(-1.9, abs=0.05)


def _sloping(a: float, c: float) -> Ground:
    normal = np.array([-a, 0.0, 1.0]) / np.hypot(a, 1.0)
    plane = np.array([[*normal, -c / np.hypot(a, 1.0)]])
    return Ground(np.zeros(0, bool), plane, np.array([-50.0, 50.0]), np.ones(1, bool))


def test_the_road_is_where_the_lidar_sees_it() -> None:
    assert road_plane(_sloping(0.01, -0.6)) == pytest.approx([0.01, 0.0, -0.6])
    assert road_plane(None) is None
    nowhere = Ground(np.zeros(0, bool), np.full((1, 4), np.nan), np.array([-50.0, 50.0]), np.zeros(1, bool))
    assert road_plane(nowhere) is None


def test_the_roads_plane_is_remembered_and_moves_slowly() -> None:
    state, lane = follow(LaneState(), paint(), RoadView(aligned(), _sloping(0.0, GROUND_M)), moment(), LaneParams())
    assert lane is not None
    assert lane.width_m == pytest.approx(3.5, abs=0.1)
    for _ in range(30):
        state, lane = follow(
            state, paint(), RoadView(aligned(), _sloping(0.0, GROUND_M)), moment(dt_s=0.1), LaneParams()
        )
    state, lane = follow(
        state, paint(), RoadView(aligned(), _sloping(0.0, GROUND_M - 0.2)), moment(dt_s=0.1), LaneParams()
    )
    assert lane is not None
    assert lane.plane[2] == pytest.approx(GROUND_M - 0.02, abs=1e-6)
    _, blind = follow(state, paint(), RoadView(aligned()), moment(dt_s=0.1), LaneParams())
    assert blind is not None
    assert blind.plane == pytest.approx(lane.plane)


def test_before_a_detector_has_looked_there_is_no_lane_and_afterwards_its_age_counts() -> None:
    state, nothing = follow(LaneState(), None, RoadView(aligned()), moment(), PARAMS)
    assert nothing is None
    state, lane = follow(state, paint(), RoadView(aligned()), moment(dt_s=0.1), PARAMS)
    assert lane is not None
    assert (lane.source, lane.age_s) == ("drawn", 0.0)
    _, later = follow(state, None, RoadView(aligned()), moment(dt_s=0.2), PARAMS)
    assert later is not None
    assert later.age_s == pytest.approx(0.2)
    assert later.left is not None
    assert lane.left is not None
    assert float(later.left.sigma_m(20.0)) > float(lane.left.sigma_m(20.0))


def test_the_same_image_gives_the_same_lane() -> None:
    one, other = (seen(paint(noise_px=0.5, clutter=50)) for _ in range(2))
    assert one.left is not None
    assert other.left is not None
    assert one.left.coefficients.tobytes() == other.left.coefficients.tobytes()
    assert one.left.covariance.tobytes() == other.left.covariance.tobytes()


@pytest.mark.parametrize("curvature", [0.0, 1 / 125.0, -1 / 250.0])
def test_the_pitch_stays_where_it_is(curvature: float) -> None:
    """Four lines of a road seen to 55 m for two seconds by a known camera: the pitch stays at zero, in a bend too, so
    the lines reach as far as they are seen."""
    bends = [curvature / (1.0 - curvature * y) / 2.0 for y in (-5.25, -1.75, 1.75, 5.25)]
    lines = tuple((y, 0.0, bend, 0.0) for y, bend in zip((-5.25, -1.75, 1.75, 5.25), bends, strict=True))
    state = LaneState()
    for k in range(20):
        raw = paint(lines, noise_px=1.5, numbered=True, seed=k, x_m=(4.0, 55.0))
        state, lane = follow(state, raw, RoadView(aligned()), moment(EgoState(0, 0.0, 0.0), 0.1 if k else None), PARAMS)
    assert state.pitch is not None
    assert state.pitch.rad == pytest.approx(0.0, abs=1.5e-3)
    assert lane is not None
    assert lane.left is not None
    assert lane.left.x_max_m > 48.0
    assert float(lane.left.y_m(50.0)) == pytest.approx(1.75 + bends[2] * 2500.0, abs=0.6)


ASIDE = ((3.3, 0.0, 0.0, 0.0), (-0.2, 0.0, 0.0, 0.0))
"""What looks like a lane beside the real one while a vehicle hides the road."""


def test_in_front_of_a_standing_car_the_lane_does_not_move() -> None:
    state, before = LaneState(), None
    for k in range(15):
        ego = moment(EgoState(0, max(5.0 - 0.5 * k, 0.0), 0.0), 0.1 if k else None)
        state, before = follow(state, paint(), RoadView(aligned()), ego, PARAMS)
    assert before is not None
    stands = moment(EgoState(0, 0.0, 0.0), 0.1)
    for k in range(60):
        raw = paint(ASIDE) if k % 3 else None
        state, lane = follow(state, raw, RoadView(aligned()), stands, PARAMS)
    assert lane is not None
    for now, then in ((lane.left, before.left), (lane.right, before.right)):
        assert now is not None
        assert then is not None
        assert now.coefficients == pytest.approx(then.coefficients, abs=0.01)
        assert now.quality == pytest.approx(then.quality, abs=0.02)
    drives = moment(EgoState(0, 5.0, 0.0), 0.1)
    for _ in range(30):
        state, lane = follow(state, paint(ASIDE), RoadView(aligned()), drives, PARAMS)
    assert lane is not None
    assert lane.left is not None
    assert lane.left.coefficients[0] == pytest.approx(3.3, abs=0.2), "a lane that is really there is found again"


def test_a_car_that_stands_from_the_start_finds_its_lane() -> None:
    state = LaneState()
    for k in range(20):
        state, lane = follow(
            state, paint(), RoadView(aligned()), moment(EgoState(0, 0.0, 0.0), 0.1 if k else None), PARAMS
        )
    assert lane is not None
    assert lane.left is not None
    assert lane.left.coefficients[0] == pytest.approx(1.75, abs=0.1)


def _after(xy: np.ndarray, speed_mps: float, yaw_rate_radps: float, dt_s: float) -> np.ndarray:
    """Points (M, 2) relative to a car that has driven along an arc."""
    turn = yaw_rate_radps * dt_s
    gone = np.array([np.sin(turn), 1.0 - np.cos(turn)]) * speed_mps / yaw_rate_radps
    return (xy - gone) @ np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])


TURNING = EgoState(0, 15.0, 0.1)


def test_lines_of_an_earlier_image_are_where_they_are_now() -> None:
    raw = replace(paint(numbered=True), age_s=0.3)
    _, lane = follow(LaneState(), raw, RoadView(aligned()), moment(TURNING, 0.1), PARAMS)
    assert lane is not None
    assert lane.age_s == 0.3
    for line, y_m in ((lane.left, 1.75), (lane.right, -1.75)):
        assert line is not None
        x = np.linspace(10.0, 35.0, 20)
        now = _after(np.column_stack([x, np.full(20, y_m)]), 15.0, 0.1, 0.3)
        assert np.asarray(line.y_m(now[:, 0])) == pytest.approx(now[:, 1], abs=0.12)


def test_lines_of_an_image_before_a_long_silence_are_not_used() -> None:
    raw = replace(paint(numbered=True), age_s=PARAMS.max_age_s + 0.1)
    state, lane = follow(LaneState(), raw, RoadView(aligned()), moment(TURNING, 0.1), PARAMS)
    assert lane is None
    assert road_edges(raw, RoadView(aligned()), state, moment(TURNING, 0.1), PARAMS) is None


def test_edges_of_the_drivable_area_of_an_earlier_image_too() -> None:
    lines = paint(numbered=True)
    edges = replace(lines, line=np.where(lines.line == 0, ROAD_LEFT, ROAD_RIGHT).astype(np.int32), age_s=0.3)
    now = moment(TURNING, 0.1)
    state, _ = follow(LaneState(), edges, RoadView(aligned()), now, PARAMS)
    found = road_edges(edges, RoadView(aligned()), state, now, PARAMS)
    fresh = road_edges(replace(edges, age_s=0.0), RoadView(aligned()), state, now, PARAMS)
    assert found is not None
    assert fresh is not None
    assert found == pytest.approx(_after(fresh, 15.0, 0.1, 0.3), abs=0.08)
    assert np.abs(found - fresh).max() > 4.0
