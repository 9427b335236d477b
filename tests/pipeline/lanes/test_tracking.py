"""Lane lines over time: the car moves under them, they age, pass through in a lane change, come and go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.lanes.line_fit import FittedLine
from pipeline.lanes.tracking import LaneTracks, ego_lane, expected_shape, predict, shifted, update
from pipeline.params import LaneParams
from pipeline.types import EgoState
from pipeline.types.lane import EgoLane, powers

PARAMS = LaneParams()
ROAD = np.array([0.0, 0.0, -0.5])
COVARIANCE = np.diag(np.square([0.05, 5e-3, 3e-4, 5e-6]))


def found(y_m: float, heading: float = 0.0, half_curvature: float = 0.0, quality: float = 0.9) -> FittedLine:
    return FittedLine(np.array([y_m, heading, half_curvature, 0.0]), COVARIANCE, 4.0, 40.0, quality)


def tracked(*lines: FittedLine, times: int = 5) -> LaneTracks:
    tracks = LaneTracks()
    for _ in range(times):
        tracks = update(tracks, "test", lines, PARAMS)
    return tracks


def lane_of(tracks: LaneTracks) -> EgoLane:
    lane = ego_lane(tracks, 0.0, ROAD, PARAMS)
    assert lane is not None
    return lane


def places(tracks: LaneTracks, x_m: float = 0.0) -> tuple[float | None, float | None]:
    lane = lane_of(tracks)
    return tuple(None if line is None else float(line.y_m(x_m)) for line in (lane.left, lane.right))  # type: ignore[return-value]


@given(st.floats(-2, 2), st.floats(-0.1, 0.1), st.floats(-0.004, 0.004), st.floats(-1e-5, 1e-5), st.floats(0, 10))
def test_a_line_is_the_same_line_after_driving_on(c0: float, c1: float, c2: float, c3: float, way_m: float) -> None:
    coefficients = np.array([c0, c1, c2, c3])
    for x in (0.0, 10.0, 30.0):
        assert powers(x) @ (shifted(way_m) @ coefficients) == pytest.approx(powers(x + way_m) @ coefficients, abs=1e-9)


def test_driving_along_an_arc_keeps_its_line_beside_the_car() -> None:
    """In a left bend of 200 m radius, a line 1.75 m to the left of the driven arc stays there."""
    radius, speed = 200.0, 15.0
    ego = EgoState(0, speed, speed / radius)
    tracks = tracked(FittedLine(np.array([1.75, 0.0, 0.5 / (radius - 1.75), 0.0]), COVARIANCE, 0.0, 40.0, 0.9))
    for _ in range(10):
        tracks = predict(tracks, ego, 0.1, PARAMS)
    line = tracks.lines[0]
    assert powers(0.0) @ line.coefficients == pytest.approx(1.75, abs=0.05)
    assert line.coefficients[1] == pytest.approx(0.0, abs=0.01)


TURNS = {"a turn to the left swings lines to the right": (0.1, -1.0), "to the right, to the left": (-0.1, 1.0)}


@pytest.mark.parametrize("turn", TURNS)
def test_the_sign_of_a_turn(turn: str) -> None:
    yaw_rate, sign = TURNS[turn]
    tracks = predict(tracked(found(1.75), found(-1.75)), EgoState(0, 10.0, yaw_rate), 0.5, PARAMS)
    moved = places(tracks, 20.0)[0]
    assert moved is not None
    assert (moved - 1.75) * sign > 0.5


def test_an_unseen_line_grows_unsure_fades_and_ends() -> None:
    tracks = tracked(found(1.75), found(-1.75))
    ego = EgoState(0, 20.0, 0.0)
    sigmas, qualities = [], []
    while lane_of(tracks).left is not None:
        line = lane_of(tracks).left
        assert line is not None
        sigmas.append(float(line.sigma_m(20.0)))
        qualities.append(line.quality)
        tracks = predict(tracks, ego, 0.1, PARAMS)
    assert len(sigmas) >= 4
    assert sigmas == sorted(sigmas)
    assert qualities == sorted(qualities, reverse=True)
    for _ in range(12):
        tracks = predict(tracks, ego, 0.1, PARAMS)
    assert tracks.lines == ()
    assert lane_of(tracks).age_s > 1.0


def test_a_line_that_images_no_longer_show_ends_sooner() -> None:
    tracks = update(tracked(found(1.75), found(-1.75)), "test", (found(1.75),), PARAMS)
    seen = 0
    while lane_of(tracks).right is not None:
        tracks = update(predict(tracks, EgoState(0, 20.0, 0.0), 0.1, PARAMS), "test", (found(1.75),), PARAMS)
        seen += 1
    assert 1 <= seen <= 4
    assert lane_of(tracks).left is not None


def test_lines_are_smoothed() -> None:
    random = np.random.default_rng(1)
    tracks, measured, believed = LaneTracks(), [], []
    for _ in range(60):
        y = 1.75 + random.normal(0.0, 0.08)
        tracks = predict(tracks, EgoState(0, 20.0, 0.0), 0.1, PARAMS)
        tracks = update(tracks, "test", (replace(found(y), covariance=2.0 * COVARIANCE),), PARAMS)
        measured.append(y)
        believed.append(places(tracks)[0])
    assert np.std(believed[10:]) < 0.6 * np.std(measured[10:])
    assert np.mean(believed[10:]) == pytest.approx(1.75, abs=0.05)


def test_a_lane_change_hands_the_lane_over_at_the_line() -> None:
    """The car drifts to the left by 3.5 m: the left line becomes the right one when the car's centre is over it."""
    at_change, tracks = None, LaneTracks()
    for step in range(71):
        drift = 0.05 * step
        lines = tuple(found(y - drift, quality=0.95) for y in (5.25, 1.75, -1.75) if abs(y - drift) < 5.0)
        tracks = update(predict(tracks, EgoState(0, 20.0, 0.0), 0.1, PARAMS), "test", lines, PARAMS)
        left, right = places(tracks)
        if left is not None and right is not None:
            assert left - right == pytest.approx(3.5, abs=0.4)
        if at_change is None and right is not None and right > -1.0 and drift > 1.0:
            at_change = drift
    assert at_change == pytest.approx(1.75, abs=0.5)
    assert places(tracks) == (pytest.approx(1.75, abs=0.2), pytest.approx(-1.75, abs=0.2))


PAIRS = {
    "a lane": ((1.75, -1.75), (1.75, -1.75)),
    "the nearest lines that make a lane, not a seam between them": ((1.75, 0.4, -1.75), (1.75, -1.75)),
    "too narrow: the surer alone": ((0.8, -0.8), None),
    "too wide: one alone": ((3.2, -3.2), None),
    "the lane beside is not ours": ((-1.7, -5.2), (None, -1.7)),
}


@pytest.mark.parametrize("pair", PAIRS)
def test_which_lines_are_the_ego_lane(pair: str) -> None:
    lines, expected = PAIRS[pair]
    got = places(tracked(*(found(y) for y in lines)))
    if expected is None:
        assert got.count(None) >= 1
    else:
        assert got == tuple(None if y is None else pytest.approx(y, abs=0.05) for y in expected)


def test_lines_that_run_apart_are_no_lane() -> None:
    lane = lane_of(tracked(found(1.75, 0.06), found(-1.75, -0.06)))
    assert lane.left is None or lane.right is None
    assert lane.width_m is None


def test_a_weak_line_is_not_believed() -> None:
    assert places(tracked(found(1.75, quality=0.2), found(-1.75))) == (None, pytest.approx(-1.75, abs=0.05))


def test_a_sure_line_narrows_the_search() -> None:
    assert expected_shape(LaneTracks()) is None
    assert expected_shape(tracked(found(1.75, 0.03, 1e-3), times=1)) is None
    shape = expected_shape(tracked(found(1.75, 0.03, 1e-3)))
    assert shape is not None
    assert (shape.heading_rad, shape.curvature_per_m) == (pytest.approx(0.03), pytest.approx(2e-3))


def test_covariances_stay_symmetric_and_positive() -> None:
    tracks = LaneTracks()
    for step in range(200):
        tracks = predict(tracks, EgoState(0, 30.0, 0.05), 0.1, PARAMS)
        tracks = update(tracks, "test", (found(1.75), found(-1.75)) if step % 3 == 0 else (), PARAMS)
        for line in tracks.lines:
            assert np.allclose(line.covariance, line.covariance.T, rtol=0, atol=1e-12)
            assert np.all(np.diag(line.covariance) > 0.0)


@pytest.mark.parametrize("y_m", [-0.6, -0.1, 0.4])
def test_a_line_alone_under_the_car_says_nothing(y_m: float) -> None:
    """It is unknown on which side of it the lane is, and it may be a shadow or a track in snow."""
    assert places(tracked(found(y_m))) == (None, None)
    assert places(tracked(found(y_m), found(y_m - np.copysign(3.5, y_m)))) != (None, None), (
        "with another one a lane away it is a lane"
    )
