"""The path along the headings of other vehicles."""

from __future__ import annotations

from dataclasses import replace
from math import cos, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.params import PathParams
from pipeline.path import traffic
from pipeline.path.corridor import Evidence, PathState, predict
from pipeline.path.estimates import PathEstimate, arc, samples
from pipeline.path.traffic import NONE, Traffic, TrafficState
from pipeline.types import EgoState, FusedObject, Moment
from tests.pipeline.build import fused
from tests.pipeline.path.lines import straight_lane

PARAMS = PathParams()
SPEED_MPS = 8.0
EGO = EgoState(0, SPEED_MPS, 0.0)
NOW = Moment(0, 0.1, EGO, EGO)


def vehicle(
    x: float, y: float, heading: float, object_id: int = 1, speed_mps: float = SPEED_MPS, ego: EgoState = EGO
) -> FusedObject:
    """One that the LiDAR has followed for long, by its heading and speed over ground."""
    rate = ego.yaw_rate_radps or 0.0
    over_ground = speed_mps * cos(heading), speed_mps * sin(heading)
    return fused(object_id, x, y, velocity=(over_ground[0] - ego.speed_mps + rate * y, over_ground[1] - rate * x))


def seen(*objects: FusedObject, state: TrafficState = NONE, now: Moment = NOW) -> tuple[TrafficState, Traffic | None]:
    return traffic.follow(state, objects, now, PARAMS)


def path(*objects: FusedObject) -> PathEstimate:
    _, found = seen(*objects)
    assert found is not None
    return found.path


def test_a_car_that_drives_straight_on_ahead_makes_a_straight_path_sure() -> None:
    """Without it the next bend may begin at any moment: at 8 m/s the place of the path at 25 m is known to 4 m."""
    _, alone = predict(PathState(), Evidence(), NOW, PARAMS)
    _, led = predict(PathState(), Evidence(traffic=path(vehicle(25.0, 0.0, 0.0))), NOW, PARAMS)
    assert led.center[25] == pytest.approx([25.0, 0.0], abs=0.01)
    assert alone.profile_m[25] > 3.5 > 2.0 > led.profile_m[25]
    assert led.source == "traffic"


@pytest.mark.parametrize("curvature", [0.01, -0.02])
def test_a_car_in_a_bend_bends_the_path_before_the_own_yaw_rate_tells(curvature: float) -> None:
    (x, y), heading = arc(curvature, np.array([25.0]))[0][0], 25.0 * curvature
    found = path(vehicle(x, y, heading))
    assert found.center[25, 1] == pytest.approx(y, abs=1.5)
    assert found.center[25, 1] * curvature > 0.0


@pytest.mark.parametrize(
    "other",
    [
        pytest.param(vehicle(25.0, 3.5, 0.0), id="in the next lane"),
        pytest.param(vehicle(25.0, 3.5, np.pi - 0.01), id="oncoming"),
    ],
)
def test_whichever_lane_it_is_in(other: FusedObject) -> None:
    assert path(other).center[25, 1] == pytest.approx(0.0, abs=0.4)


@pytest.mark.parametrize(
    "other",
    [
        pytest.param(vehicle(25.0, 0.0, np.pi / 2), id="crosses"),
        pytest.param(vehicle(12.0, -3.0, -1.2), id="turns off"),
        pytest.param(vehicle(18.0, 16.7, 1.45), id="crosses beside, where a sharp bend could lead"),
        pytest.param(vehicle(25.0, 0.0, 0.0, speed_mps=2.0), id="manoeuvres"),
        pytest.param(vehicle(25.0, 0.0, 0.0, speed_mps=0.0), id="stands"),
        pytest.param(replace(vehicle(25.0, 0.0, 0.0), seen_by="V", source="V"), id="only the camera has it"),
        pytest.param(replace(vehicle(25.0, 0.0, 0.0), lidar_hits=4), id="the LiDAR has just found it"),
        pytest.param(replace(vehicle(25.0, 0.0, 0.0), velocity_mps=None), id="its velocity is not known"),
        pytest.param(vehicle(-8.0, 0.0, 0.0), id="behind"),
    ],
)
def test_who_has_no_say(other: FusedObject) -> None:
    assert seen(other)[1] is None


def test_who_turns_off_takes_back_what_it_said() -> None:
    state, found = seen(vehicle(20.0, 0.0, -0.3), vehicle(30.0, 3.5, 0.0, object_id=2))
    assert found is not None
    assert found.path.center[25, 1] < -0.5
    _, after = seen(vehicle(20.0, -1.0, -0.9), vehicle(30.0, 3.5, 0.0, object_id=2), state=state)
    assert after is not None
    assert after.path.center[25, 1] == pytest.approx(0.0, abs=0.4)


def test_where_it_drove_before_shows_the_road_in_between() -> None:
    """After 3 s behind a car in a bend its headings lie along the whole way, and the path is surer for it."""
    curvature, state = 0.02, NONE
    ego = EgoState(0, SPEED_MPS, SPEED_MPS * curvature)
    now = Moment(0, 0.1, ego, ego)
    lead = vehicle(*arc(curvature, np.array([25.0]))[0][0], 25.0 * curvature, ego=ego)
    first = seen(lead, now=now)[1]
    for _ in range(30):
        state, last = seen(lead, state=state, now=now)
    assert first is not None
    assert last is not None
    assert len(last.headings) > 5
    assert last.path.sigma_m[25] < 0.7 * first.path.sigma_m[25]
    expected, _ = arc(curvature, samples(PARAMS.length_m))
    assert last.path.center[25] == pytest.approx(expected[25], abs=0.5)


def test_without_own_motion_or_switched_off_nothing_is_kept() -> None:
    state, _ = seen(vehicle(25.0, 0.0, 0.0))
    assert seen(vehicle(25.0, 0.0, 0.0), state=state, now=Moment(0, 0.1, None, None)) == (NONE, None)
    off = PARAMS.model_copy(update={"use_traffic": False})
    assert traffic.follow(state, (vehicle(25.0, 0.0, 0.0),), NOW, off) == (NONE, None)


def test_paint_outweighs_vehicles_that_go_another_way() -> None:
    leaving = path(*[vehicle(10.0 + 5.0 * n, -0.2 * n, -0.25, object_id=n) for n in range(6)])
    assert abs(leaving.center[30, 1]) > 2.0
    _, painted = predict(PathState(), Evidence(lane=straight_lane(), traffic=leaving), NOW, PARAMS)
    assert "traffic" not in painted.weights


@given(
    st.lists(
        st.tuples(st.floats(0.1, 80.0), st.floats(-20.0, 20.0), st.floats(-3.2, 3.2), st.floats(0.0, 40.0)),
        max_size=12,
    ),
    st.floats(0.0, 40.0),
    st.floats(-1.0, 1.0),
)
def test_whatever_drives_there_the_path_is_finite_and_no_surer_than_the_car_keeps_its_lane(
    others: list[tuple[float, float, float, float]], speed_mps: float, rate_radps: float
) -> None:
    ego = EgoState(0, speed_mps, rate_radps)
    now, state = Moment(0, 0.1, ego, ego), NONE
    for _ in range(2):
        objects = [vehicle(x, y, turn, n, v, ego) for n, (x, y, turn, v) in enumerate(others)]
        state, found = seen(*objects, state=state, now=now)
        if found is not None:
            assert np.isfinite(found.path.center).all()
            assert (found.path.sigma_m >= 0.9 * PARAMS.lane_keeping_sigma_m).all()
