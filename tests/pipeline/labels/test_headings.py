"""Which end of a proposed vehicle is its front."""

from __future__ import annotations

import math

import pytest

from pipeline.common.geometry import Cuboid
from pipeline.labels.headings import Moment, faced, guessed, half_turned, oncoming_side, own_poses
from pipeline.labels.model import Sighting

PERIOD_NS = 100_000_000


def moments(speed_mps: float | None, yaw_rate_radps: float = 0.0, count: int = 10) -> dict[int, Moment]:
    return {n: Moment(n * PERIOD_NS, speed_mps, yaw_rate_radps, 80.0) for n in range(count)}


def track(*places: tuple[float, float], yaw_rad: float = 0.0) -> tuple[Sighting, ...]:
    return tuple(
        Sighting(n, Cuboid((x, y, 0.7), (4.5, 1.8, 1.5), yaw_rad), keyframe=False) for n, (x, y) in enumerate(places)
    )


def yaws(sightings: tuple[Sighting, ...]) -> list[float]:
    return [each.cuboid.yaw_rad for each in sightings if each.cuboid is not None]


@pytest.mark.parametrize(
    ("relative_mps", "own_mps", "faces_us", "how"),
    [
        (-20.0, 10.0, True, "motion"),
        (0.0, 10.0, False, "motion"),
        (-5.0, 15.0, False, "motion"),
        (-10.0, 10.0, False, "unknown"),
        (-20.0, None, False, "unknown"),
    ],
    ids=["oncoming", "at our speed", "slower than we", "parked", "own speed is not known"],
)
def test_a_vehicle_faces_where_it_drives(relative_mps: float, own_mps: float | None, faces_us: bool, how: str) -> None:
    seen = track(*((40.0 + relative_mps * n / 10, 3.5) for n in range(10)))
    found, heading = faced(seen, (), own_poses(moments(own_mps)))
    assert heading == how
    assert all((math.cos(yaw) < 0) == faces_us for yaw in yaws(found))


def test_one_step_may_be_from_one_vehicle_to_the_next() -> None:
    seen = track((6.0, 4.0), (11.0, 4.0))
    assert faced(seen, (), own_poses(moments(13.0)))[1] == "unknown"


def test_what_stands_still_while_we_turn_drives_nowhere() -> None:
    """At 10 m/s on a curve of 20 m radius, a parked car moves sideways by metres in the ego frame."""
    turn = own_poses(moments(10.0, 0.5))
    seen = []
    for n, pose in turn.items():
        dx, dy = 25.0 - pose.x, 8.0 - pose.y
        c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        cuboid = Cuboid((c * dx + s * dy, c * dy - s * dx, 0.7), (4.5, 1.8, 1.5), -pose.yaw_rad)
        seen.append(Sighting(n, cuboid, keyframe=False))
    assert faced(tuple(seen), (), turn)[1] == "unknown"
    assert faced(tuple(seen), (), own_poses(moments(10.0)))[1] != "unknown", "the turn is what explains it"


def test_a_car_that_stands_in_our_lane_faces_our_way() -> None:
    seen = track(*((30.0 - n, 0.0) for n in range(10)), yaw_rad=math.pi - 0.1)
    found, heading = faced(seen, range(10), own_poses(moments(10.0)))
    assert heading == "lane"
    assert yaws(found) == pytest.approx([-0.1] * 10)


def test_nothing_turns_round_between_two_frames() -> None:
    seen = list(track(*((20.0, 0.0) for _ in range(4)), yaw_rad=1.5))
    seen[2] = Sighting(2, Cuboid((20.0, 0.0, 0.7), (4.5, 1.8, 1.5), -1.5), keyframe=False)
    found, _ = faced(tuple(seen), (), {})
    assert yaws(found) == pytest.approx([1.5, 1.5, math.pi - 1.5, 1.5])


@pytest.mark.parametrize(("side", "faces_us"), [(1, [True, False, False, False]), (-1, [False, True, False, False])])
def test_what_parks_along_the_road_is_guessed_to_face_as_its_side_drives(side: int, faces_us: list[bool]) -> None:
    parked = [track((20.0, 5.0)), track((20.0, -5.0)), track((20.0, 0.5)), track((20.0, 8.0), yaw_rad=1.5)]
    found = [guessed(each, side)[0].cuboid for each in parked]
    assert [each is not None and math.cos(each.yaw_rad) < 0 for each in found] == faces_us


def test_the_side_of_oncoming_traffic_is_that_on_which_somebody_came() -> None:
    left = track((20.0, 3.5), (15.0, 3.5), yaw_rad=math.pi)
    right = track((20.0, -3.5), yaw_rad=math.pi)
    assert oncoming_side([]) == 1
    assert oncoming_side([(left, "motion"), (right, "motion")]) == 1
    assert oncoming_side([(right, "motion"), (left, "unknown")]) == -1


def test_own_motion_is_not_carried_over_a_gap() -> None:
    """A clip that begins 10 s later is unrelated to the previous one."""
    here = moments(10.0, count=4)
    later = {n + 4: Moment(int(10e9) + n * PERIOD_NS, 10.0, 0.0, 80.0) for n in range(4)}
    poses = own_poses(here | later)
    assert [poses[n].stretch for n in range(8)] == [1] * 4 + [2] * 4
    assert poses[3].x == pytest.approx(3.0)
    assert poses[7].x == pytest.approx(3.0)


def test_own_speed_stands_in_for_a_second() -> None:
    known = moments(None, count=30)
    known[15] = Moment(15 * PERIOD_NS, 8.0, 0.0, 80.0)
    assert sorted(own_poses(known)) == list(range(5, 26))


@pytest.mark.parametrize("yaw_rad", [0.0, 1.0, -1.0, math.pi, 3.0, -3.0])
def test_half_a_turn_twice_is_none(yaw_rad: float) -> None:
    cuboid = Cuboid((1.0, 2.0, 3.0), (4.0, 2.0, 1.5), yaw_rad)
    once = half_turned(cuboid)
    assert -math.pi < once.yaw_rad <= math.pi
    assert math.cos(once.yaw_rad - yaw_rad) == pytest.approx(-1.0)
    assert half_turned(once).yaw_rad == pytest.approx(yaw_rad)
