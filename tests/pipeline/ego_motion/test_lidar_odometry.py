"""Own motion from sweeps."""

from __future__ import annotations

from math import cos, sin

import pytest

from pipeline.ego_motion import registration
from pipeline.ego_motion.lidar_odometry import OdometryState, OdometryStep, follow
from pipeline.types import EgoState
from tests.pipeline.ego_motion.streets import ROAD, seen, street, tunnel

STREET = street()


def drive(
    world: object, speed_mps: float, yaw_rate_radps: float = 0.0, sweeps: int = 8, prior: EgoState | None = None
) -> list[OdometryStep]:
    """Odometry along a road at constant speed, with a sweep every 0.1 s."""
    found = [OdometryStep(OdometryState(), None)]
    x = y = heading = 0.0
    for k in range(sweeps):
        sweep = seen(world, x, y, heading, k * 100_000_000)  # type: ignore[arg-type]
        found.append(follow(found[-1].state, sweep, ROAD, (), 0.1, prior))
        x, y = x + speed_mps * 0.1 * cos(heading), y + speed_mps * 0.1 * sin(heading)
        heading += yaw_rate_radps * 0.1
    return found[1:]


@pytest.mark.parametrize(("speed_mps", "yaw_rate_radps"), [(0.0, 0.0), (12.0, 0.15), (30.0, 0.0)])
def test_speed_yaw_rate_and_pose_without_any_other_sensor(speed_mps: float, yaw_rate_radps: float) -> None:
    found = drive(STREET, speed_mps, yaw_rate_radps)
    assert [each.motion is not None for each in found[:3]] == [False, False, True], "two displacements must agree"
    last = found[-1].motion
    assert last is not None
    assert last.speed_mps == pytest.approx(speed_mps, abs=0.3)
    assert last.yaw_rate_radps == pytest.approx(yaw_rate_radps, abs=0.01)
    assert last.pose[0] == pytest.approx(speed_mps * 0.7, abs=0.5)
    assert last.speed_sigma_mps < 0.5


def test_the_same_sweeps_give_the_same_bytes() -> None:
    assert drive(STREET, 12.0, 0.1, 5)[-1].motion == drive(STREET, 12.0, 0.1, 5)[-1].motion


def test_a_tunnel_fixes_nothing_along_the_road_and_is_named() -> None:
    last = drive(tunnel(), 20.0, prior=EgoState(0, 20.0, 0.0))[-1]
    assert last.motion is None
    assert last.note == "LiDAR odometry: no structure along the road, as in a tunnel"


def test_too_few_points_are_named() -> None:
    last = drive(STREET[:6], 10.0)[-1]
    assert (last.motion, last.note) == (None, "LiDAR odometry: too few static objects nearby")


def test_another_place_is_refused_and_odometry_starts_anew() -> None:
    """A recording cut from several drives jumps between frames, without a gap in its times."""
    found = drive(STREET, 12.0)[-1]
    elsewhere = street(seed=9)
    for k in range(4):
        found = follow(found.state, seen(elsewhere, 1.2 * k, 0.0, 0.0, k), ROAD, (), 0.1, None)
        if k == 0:
            assert found.note == "LiDAR odometry: sweeps contradict each other"
    for k in range(4, 9):
        found = follow(found.state, seen(elsewhere, 1.2 * k, 0.0, 0.0, k), ROAD, (), 0.1, None)
    assert found.motion is not None
    assert found.motion.speed_mps == pytest.approx(12.0, abs=0.4)
    assert found.motion.pose[0] < 12.0, "its place is counted from the new beginning"


def test_a_refused_sweep_places_the_car_where_it_was_foreseen() -> None:
    before = drive(STREET, 12.0)[-1]
    assert before.motion is not None
    found = follow(before.state, seen(STREET, 12.0 * 0.8 + 1.5, 0.0, 0.0, 8), ROAD, (), 0.1, None)
    assert found.note == "LiDAR odometry: sweeps contradict each other"
    assert found.motion is not None
    assert found.motion.pose[0] - before.motion.pose[0] == pytest.approx(0.1 * found.motion.speed_mps, abs=0.1)


def test_a_gap_starts_odometry_anew() -> None:
    state = drive(STREET, 12.0)[-1].state
    assert follow(state, seen(STREET, 50.0, 0.0, 0.0, 1), ROAD, (), None, None).state.clouds == ()
    assert len(follow(state, seen(STREET, 50.0, 0.0, 0.0, 1), ROAD, (), 1.6, None).state.clouds) == 1


def test_without_the_library_there_is_no_motion_and_a_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing() -> None:
        raise ModuleNotFoundError("kiss_icp")

    monkeypatch.setattr(registration, "_library", missing)
    registration.is_available.cache_clear()
    try:
        found = drive(STREET, 12.0)
    finally:
        registration.is_available.cache_clear()
    assert {each.motion for each in found} == {None}
    assert {each.note for each in found} == {
        "LiDAR odometry: not available, since kiss-icp has no package for this version of Python"
    }
