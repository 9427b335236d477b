"""The path along the headings of other vehicles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import atan2, cos, hypot, pi, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.params import PathParams
from pipeline.path import traffic
from pipeline.path.corridor import Evidence, PathState, predict
from pipeline.path.traffic import NONE, Traffic, TrafficState
from pipeline.types import EgoState, FusedObject, Moment
from tests.pipeline.build import fused
from tests.pipeline.path.lines import straight_lane

PARAMS = PathParams()
DT_S = 0.1
SPEED_MPS = 8.0


@dataclass(frozen=True)
class Driver:
    """A vehicle that goes straight, seen from an ego vehicle that goes straight along x from the origin."""

    x: float
    """Its centre when first seen, in the ground frame."""
    y: float
    heading: float = 0.0
    speed_mps: float = SPEED_MPS
    track: int = 1

    def at(self, t_s: float, ego_mps: float = SPEED_MPS) -> FusedObject:
        """The object as seen at this time."""
        x = self.x + (self.speed_mps * cos(self.heading) - ego_mps) * t_s
        y = self.y + self.speed_mps * sin(self.heading) * t_s
        velocity = self.speed_mps * cos(self.heading) - ego_mps, self.speed_mps * sin(self.heading)
        return replace(fused(self.track, x - 2.25, y, velocity=velocity), lidar_track=self.track)


def drive(
    *drivers: Driver,
    frames: int = 11,
    ego_mps: float = SPEED_MPS,
    change: Callable[[FusedObject, int], FusedObject] = lambda item, _: item,
    state: TrafficState = NONE,
    params: PathParams = PARAMS,
) -> tuple[TrafficState, Traffic | None]:
    """The estimate after this number of frames. change: applied to each object in each frame."""
    found, ego = None, EgoState(0, ego_mps, 0.0)
    for n in range(frames):
        objects = [change(each.at(n * DT_S, ego_mps), n) for each in drivers]
        state, found = traffic.follow(state, objects, Moment(0, DT_S, ego, ego), params)
    return state, found


def centre(found: Traffic | None) -> np.ndarray:
    assert found is not None
    return found.path.center


def test_a_car_that_drives_straight_on_ahead_makes_a_straight_path_sure() -> None:
    """Without it, a bend may begin at any moment: at 8 m/s, the path 25 m ahead is known only to 4 m."""
    ego = EgoState(0, SPEED_MPS, 0.0)
    now = Moment(0, DT_S, ego, ego)
    _, found = drive(Driver(25.0, 0.0))
    assert found is not None
    _, alone = predict(PathState(), Evidence(), now, PARAMS)
    _, led = predict(PathState(), Evidence(traffic=found.path), now, PARAMS)
    assert led.center[25] == pytest.approx([25.0, 0.0], abs=0.01)
    assert alone.profile_m[25] > 3.5 > 2.0 > led.profile_m[25]
    assert led.source == "traffic"


@pytest.mark.parametrize("heading", [0.25, -0.4])
def test_a_car_in_a_bend_bends_the_path_before_the_own_yaw_rate_tells(heading: float) -> None:
    on_arc = 22.0 * cos(heading / 2), 22.0 * sin(heading / 2)
    path = centre(drive(Driver(*on_arc, heading), frames=9)[1])
    assert path[24, 1] / heading > 5.0


@pytest.mark.parametrize(
    "other",
    [pytest.param(Driver(25.0, 3.5), id="in the next lane"), pytest.param(Driver(45.0, 3.5, pi - 0.01), id="oncoming")],
)
def test_whichever_lane_it_is_in(other: Driver) -> None:
    assert centre(drive(other)[1])[25, 1] == pytest.approx(0.0, abs=0.4)


@pytest.mark.parametrize(
    "other",
    [
        pytest.param(Driver(25.0, -8.0, pi / 2), id="crosses"),
        pytest.param(Driver(18.0, 14.0, 1.45), id="crosses beside, where a sharp bend could lead"),
        pytest.param(Driver(12.0, -3.0, -1.2), id="turns off"),
        pytest.param(Driver(25.0, 0.0, speed_mps=2.0), id="manoeuvres"),
        pytest.param(Driver(25.0, 0.0, speed_mps=0.0), id="stands"),
        pytest.param(Driver(2.5, 3.5, pi), id="is behind by now"),
    ],
)
def test_whose_way_is_not_the_roads(other: Driver) -> None:
    assert drive(other, frames=16)[1] is None


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(lambda item: replace(item, seen_by="V"), id="only the camera sees it"),
        pytest.param(lambda item: replace(item, label=None), id="no camera names it"),
        pytest.param(lambda item: replace(item, label="pedestrian"), id="no vehicle"),
        pytest.param(lambda item: replace(item, velocity_mps=None), id="its velocity is not known"),
        pytest.param(lambda item: replace(item, velocity_mps=(-SPEED_MPS, 0.0)), id="its velocity tells otherwise"),
    ],
)
def test_what_is_not_known_to_drive(change: Callable[[FusedObject], FusedObject]) -> None:
    assert drive(Driver(25.0, 0.0), change=lambda item, _: change(item), frames=16)[1] is None


def by_camera(item: FusedObject, n: int = 0, **changed: object) -> FusedObject:
    """As seen by the camera alone, with a distance that varies by 2 m."""
    assert item.bev is not None
    nearer = 1.0 + 2.0 * (-1) ** n / 45.0
    seen = replace(item, source="V", seen_by="V", cuboid=None, lidar_track=None, vision_track=7, distance_sigma_m=3.0)
    bev = tuple((x * nearer, y * nearer) for x, y in item.bev)
    return replace(seen, bev=bev, surely_moving=True, existence=0.95, **changed)  # type: ignore[arg-type]


@pytest.mark.parametrize("heading", [0.2, -0.3])
def test_a_far_car_that_only_the_camera_follows_bends_the_path_too(heading: float) -> None:
    on_arc = 45.0 * cos(heading / 2), 45.0 * sin(heading / 2)
    path = centre(drive(Driver(*on_arc, heading), frames=25, change=by_camera)[1])
    assert path[45, 1] / heading > 8.0


@pytest.mark.parametrize(
    "changed",
    [
        pytest.param({"existence": 0.7}, id="may not exist"),
        pytest.param({"surely_moving": False}, id="may stand"),
        pytest.param({"measured": False}, id="its distance did not fit"),
        pytest.param({"seen_by": ""}, id="not seen now"),
    ],
)
def test_a_car_of_which_the_camera_is_not_sure_shows_no_road(changed: dict[str, object]) -> None:
    def seen(item: FusedObject, n: int) -> FusedObject:
        return replace(by_camera(item, n), **changed)  # type: ignore[arg-type]

    assert drive(Driver(45.0, 0.0), frames=25, change=seen)[1] is None


def test_a_camera_track_that_jumps_aside_shows_no_road() -> None:
    """It jumps from one parked car to another, 3 m beside it."""

    def jumps(item: FusedObject, n: int) -> FusedObject:
        aside = 3.0 if n % 2 else 0.0
        seen = by_camera(item, n)
        assert seen.bev is not None
        return replace(seen, bev=tuple((x, y + aside) for x, y in seen.bev))  # type: ignore[arg-type]

    assert drive(Driver(45.0, 0.0), frames=25, change=jumps)[1] is None


def test_a_track_that_jumps_from_one_parked_car_to_the_next_does_not_drive() -> None:
    """Each car is 6 m farther than the last, so on average the track moves at ego speed."""

    def jumps(item: FusedObject, n: int) -> FusedObject:
        parked = Driver(25.0 + 6.0 * (n // 8), -3.0, speed_mps=0.0).at(n * DT_S)
        return replace(parked, velocity_mps=(-1.0, 0.0))

    assert drive(Driver(0.0, 0.0), change=jumps, frames=40)[1] is None


def test_who_turns_off_takes_back_what_it_said() -> None:
    straight = Driver(32.0, 3.5, track=2)
    state, found = drive(Driver(24.0, 0.0, -0.3), straight)
    assert centre(found)[25, 1] < -0.5
    turning = Driver(32.0, -2.6, -0.9)
    _, after = drive(turning, Driver(32.0, 3.5, track=2), state=state)
    assert centre(after)[25, 1] == pytest.approx(0.0, abs=0.4)


def test_where_it_drove_before_shows_the_road_in_between() -> None:
    """After 3 s behind a car, its headings lie along the whole way and make the path more certain."""
    _, first = drive(Driver(25.0, 0.0), frames=9)
    _, last = drive(Driver(25.0, 0.0), frames=31)
    assert first is not None
    assert last is not None
    assert len(first.headings) == 1
    assert len(last.headings) == 3
    assert last.path.sigma_m[25] < 0.7 * first.path.sigma_m[25]


def test_without_own_motion_or_switched_off_nothing_is_kept() -> None:
    state, _ = drive(Driver(25.0, 0.0))
    item = Driver(25.0, 0.0).at(0.0)
    assert traffic.follow(state, (item,), Moment(0, DT_S, None, None), PARAMS) == (NONE, None)
    off = PARAMS.model_copy(update={"use_traffic": False})
    assert drive(Driver(25.0, 0.0), params=off) == (NONE, None)


def test_paint_outweighs_vehicles_that_go_another_way() -> None:
    _, leaving = drive(*[Driver(18.0 + 5.0 * n, -0.2 * n, -0.25, track=n) for n in range(6)])
    assert abs(centre(leaving)[30, 1]) > 2.0
    assert leaving is not None
    ego = EgoState(0, SPEED_MPS, 0.0)
    lane = Evidence(lane=straight_lane(), traffic=leaving.path)
    _, painted = predict(PathState(), lane, Moment(0, DT_S, ego, ego), PARAMS)
    assert "traffic" not in painted.weights


@given(
    st.lists(
        st.tuples(st.floats(3.0, 80.0), st.floats(-20.0, 20.0), st.floats(-3.2, 3.2), st.floats(0.0, 40.0)),
        max_size=8,
    ),
    st.floats(0.0, 40.0),
)
def test_whatever_drives_there_the_path_is_finite_and_no_surer_than_the_car_keeps_its_lane(
    others: list[tuple[float, float, float, float]], ego_mps: float
) -> None:
    drivers = [Driver(x, y, turn, v, n) for n, (x, y, turn, v) in enumerate(others)]
    _, found = drive(*drivers, ego_mps=ego_mps, frames=8)
    if found is not None:
        assert np.isfinite(found.path.center).all()
        assert (found.path.sigma_m >= 0.9 * PARAMS.lane_keeping_sigma_m).all()
        assert all(hypot(x, y) < 150.0 and abs(atan2(sin(h), cos(h))) <= pi / 2 for x, y, h in found.headings)
