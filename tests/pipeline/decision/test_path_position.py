"""How far an object reaches into the path, how surely, and when it crosses its edge."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from pipeline.common.geometry import Cuboid
from pipeline.decision import path_position
from pipeline.decision.object_motion import describe
from pipeline.decision.path_position import place
from pipeline.decision.place import Place
from pipeline.params import CipvParams, MotionParams, PathParams
from pipeline.path.corridor import corridor
from pipeline.path.estimates import arc, corner_m, samples
from pipeline.types import EgoState, FusedObject, Path
from tests.pipeline.build import fused

STRAIGHT = corridor(None, PathParams(half_width_m=1.5))
EGO = EgoState(0, 20.0, 0.0)


def placed(
    item: FusedObject, path: Path = STRAIGHT, ego: EgoState | None = EGO, params: CipvParams | None = None
) -> tuple[Place, float | None]:
    (found,) = place(describe([item], ego, MotionParams()), path, ego, params or CipvParams())
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("width", "limit_m"),
    [
        pytest.param(1.8, 1.5, id="a car: the middle of its rear between the edges"),
        pytest.param(0.8, 1.5, id="a motorcycle: half of it"),
        pytest.param(2.5, 1.85, id="a truck leaves no room earlier"),
    ],
)
def test_how_far_aside_it_is_still_in_the_path(width: float, limit_m: float) -> None:
    for side in (1.0, -1.0):
        inside, outside = (placed(fused(1, 20.0, side * (limit_m + step), width=width))[0] for step in (-0.05, 0.05))
        assert inside.margin_m() == pytest.approx(0.05, abs=0.01)
        assert outside.margin_m() == pytest.approx(-0.05, abs=0.01)
        assert inside.log_odds(0.0, 0.0) > 0.0 > outside.log_odds(0.0, 0.0)


def test_lines_need_not_be_parallel_to_the_centre() -> None:
    """A lane that widens to the left: an offset outside it at 20 m is inside at 60 m."""
    center = STRAIGHT.center
    left = center + np.column_stack([np.zeros(len(center)), 1.5 + 0.03 * center[:, 0]])
    path = dataclasses.replace(STRAIGHT, left=left)
    assert placed(fused(1, 20.0, 2.8), path)[0].margin_m() < 0.0
    assert placed(fused(1, 60.0, 2.8), path)[0].margin_m() > 0.0


def test_a_finer_path_is_looked_up_by_path_length(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a point every half metre, the edges at 20 m are those of the fortieth point."""
    monkeypatch.setattr(path_position, "STEP_M", 0.5)
    center, _ = arc(0.0, samples(100.0) / 2)
    aside = np.column_stack([np.zeros(len(center)), 1.5 + 0.03 * center[:, 0]])
    left, right = center + aside, center - aside
    fine = dataclasses.replace(STRAIGHT, center=center, left=left, right=right, profile_m=np.zeros(0))
    found, _ = placed(fused(1, 20.0, 0.0), fine)
    assert found.ahead_m == pytest.approx(20.0, abs=3.0)
    assert found.left_m == pytest.approx(1.5 + 0.03 * found.ahead_m, abs=0.02)


def test_what_stands_across_the_path_is_in_it_while_any_of_it_reaches_in() -> None:
    """A car turns out of the path: its front is 2.5 m to the side, its tail still in the middle."""
    turned = Cuboid((20.0, 1.2, 0.2), (4.5, 1.8, 1.5), 0.75)
    corners = tuple((float(x), float(y)) for x, y in turned.footprint())
    item = dataclasses.replace(fused(1, 20.0, 1.2), cuboid=turned, bev=corners)
    across, _ = placed(item)
    assert across.low_m < 0.0 < 2.5 < across.high_m
    assert across.margin_m() > 0.0


def test_a_wrong_distance_matters_where_the_path_turns_away_from_the_line_of_sight() -> None:
    """60 m ahead on an arc of 125 m radius the path leads 0.24 rad away from the line of sight."""
    seen = dataclasses.replace(fused(1, 60.0, 0.0, source="V"), distance_sigma_m=6.0)
    center, _ = arc(1 / 125.0, samples(100.0))
    x, y = center[60]
    there = dataclasses.replace(fused(1, float(x), float(y), source="V"), distance_sigma_m=6.0)
    bent = Path("gnss", center, center, center, 1.5, {}, {})
    assert placed(seen)[0].sigma_m < 5.0
    straight_on = dataclasses.replace(STRAIGHT, profile_m=np.zeros(0))
    assert placed(seen, straight_on)[0].sigma_m == pytest.approx(0.3, abs=0.01)
    assert placed(there, bent)[0].sigma_m == pytest.approx(6.0 * math.sin(0.24), rel=0.1)


def test_a_path_known_less_says_less() -> None:
    sure = dataclasses.replace(STRAIGHT, profile_m=np.full(101, 0.05))
    vague = dataclasses.replace(STRAIGHT, profile_m=np.full(101, 3.0))
    stands = fused(1, 30.0, velocity=(-EGO.speed_mps, 0.0))
    assert placed(stands, sure)[0].log_odds(0.0, 0.0) == 4.0
    assert 0.0 < placed(stands, vague)[0].log_odds(0.0, 0.0) < 0.3


@pytest.mark.parametrize(
    ("y", "low", "high"),
    [
        pytest.param(0.0, 0.7, 0.8, id="in our lane, unless the road bends"),
        pytest.param(3.5, 0.02, 0.1, id="in the next lane, unless the road bends"),
    ],
)
def test_what_drives_ahead_shows_where_the_road_goes(y: float, low: float, high: float) -> None:
    """Where the course of the road is guessed, most roads go on as they begin: a car that drives ahead is where it
    seems to be. What stands may be parked where the road bends away from it, and oncoming traffic likewise."""
    guessed = dataclasses.replace(STRAIGHT, profile_m=np.full(101, 3.0))
    along, standing, oncoming = (
        placed(fused(1, 30.0, y, velocity=(over_ground - EGO.speed_mps, 0.0)), guessed)[0]
        for over_ground in (15.0, 0.0, -15.0)
    )
    assert low < along.probability() < high
    assert standing.probability() == oncoming.probability()
    assert 0.2 < standing.probability() < 0.4
    assert abs(along.log_odds(0.0, 0.0)) > 3.0 * abs(standing.log_odds(0.0, 0.0))
    assert along.sigma_m == pytest.approx(standing.sigma_m, rel=0.01)
    assert standing.margin_of(0.5) == pytest.approx(standing.sigma_m)
    assert along.margin_of(-0.5) == pytest.approx(-along.usual_m), "as far outside as the usual error says"
    alike, *_ = place(describe([fused(1, 30.0, y)], EGO, MotionParams()), guessed, EGO, CipvParams(road_goes_on=0.0))
    assert alike is not None
    assert alike[0].probability() == pytest.approx(standing.probability(), abs=0.01)


def test_an_error_beyond_all_sigmas_is_as_sure_as_can_be() -> None:
    """The density of such an error is zero in floating point."""
    sure = dataclasses.replace(STRAIGHT, profile_m=np.full(101, 0.05))
    assert placed(fused(1, 30.0, 25.0), sure)[0].log_odds(0.0, 0.0) == -4.0
    assert placed(fused(1, 30.0, 25.0), sure)[0].probability() == 0.0


@pytest.mark.parametrize(
    ("item", "seconds"),
    [
        pytest.param(
            fused(1, 30.0, 4.4, velocity=(-5.0, -1.5)), 1.7, id="its nose 1.7 m from the line at 1 m/s believed"
        ),
        pytest.param(fused(1, 30.0, -4.4, velocity=(-5.0, 1.5)), 1.7, id="from the right"),
        pytest.param(fused(1, 30.0, 2.0, velocity=(-5.0, -1.5)), 0.0, id="its side is over the line"),
        pytest.param(fused(1, 30.0, 4.4, velocity=(-5.0, -0.4)), None, id="noise"),
        pytest.param(fused(1, 30.0, 4.4, velocity=(-5.0, 1.5)), None, id="moves away"),
        pytest.param(fused(1, 30.0, 4.4, velocity=(-20.0, -1.4)), None, id="a post does not cut in"),
        pytest.param(fused(1, 30.0, 0.5, velocity=(-5.0, 1.5)), 1.0, id="cuts out"),
        pytest.param(fused(1, 30.0, 0.5, velocity=(-5.0, -1.5)), None, id="comes to the middle"),
        pytest.param(fused(1, 30.0, 0.5, velocity=None), None, id="velocity not known"),
    ],
)
def test_time_to_the_crossing(item: FusedObject, seconds: float | None) -> None:
    _, crossing_s = placed(item)
    assert crossing_s == (pytest.approx(seconds, abs=0.05) if seconds is not None else None)


def test_a_car_that_follows_the_bend_does_not_move_sideways() -> None:
    """20 m/s on a 200 m radius, the lead 40 m ahead on the same arc at the same speed: seen from the turning car it
    stands still; over ground and against the path it goes straight along it."""
    ego = EgoState(0, 20.0, 0.1)
    bent = corridor(ego, PathParams(half_width_m=1.5))
    x, y = bent.center[40]
    there, crossing_s = placed(fused(1, float(x), float(y), velocity=(0.0, 0.0)), bent, ego)
    assert there.sideways_mps == pytest.approx(0.0, abs=0.1)
    assert crossing_s is None


def test_what_has_no_place_has_none() -> None:
    assert place((fused(1, None, source="V"),), STRAIGHT, EGO, CipvParams()) == [None]
    assert place((), STRAIGHT, EGO, CipvParams()) == []


@pytest.mark.parametrize("y", [-6.0, -2.4, -1.0, 0.0, 1.7, 3.5])
def test_a_thin_slice_of_a_rear_is_placed_by_its_long_side(y: float) -> None:
    """A LiDAR that sees a rear alone gives a box of 0.1 m by 1.7 m, whose two nearest corners are those of a short
    side."""
    there, _ = placed(fused(1, 19.0, y, length=0.1, width=1.7))
    assert (there.offset_m, there.middle_m) == (pytest.approx(y, abs=0.02), pytest.approx(y, abs=0.02))
    assert there.high_m - there.low_m == pytest.approx(1.7, abs=0.01)


@pytest.mark.parametrize("x", [4.0, 8.0, 30.0])
@pytest.mark.parametrize("y", [-3.5, 0.0, 3.5])
def test_a_whole_car_is_placed_by_its_rear(x: float, y: float) -> None:
    there, _ = placed(fused(1, x, y, length=4.5))
    assert there.middle_m == pytest.approx(y, abs=0.02)


def crossing_car(x: float, from_m: float, to_m: float) -> FusedObject:
    """A car perpendicular to the path; the LiDAR sees only the first 1.5 m of its side."""
    item = fused(1, x, from_m + 0.75, length=0.1, width=1.5, velocity=(-EGO.speed_mps, 0.0))
    return dataclasses.replace(item, box_sides=((x, to_m), (x, from_m)))


def test_of_one_that_stands_across_the_box_says_how_far_it_reaches() -> None:
    alone, _ = placed(dataclasses.replace(crossing_car(30.0, -4.4, 0.1), box_sides=None))
    both, _ = placed(crossing_car(30.0, -4.4, 0.1))
    assert alone.margin_m() < 0.0 < both.margin_m()
    assert (both.low_m, both.high_m) == (pytest.approx(-4.4, abs=0.02), pytest.approx(0.1, abs=0.02))


@pytest.mark.parametrize("edge", [(math.nan, math.nan), (30.0, math.nan), (math.inf, -4.0)])
def test_a_box_of_which_one_edge_is_nowhere_says_nothing(edge: tuple[float, float]) -> None:
    item = crossing_car(30.0, -4.4, 0.1)
    alone = placed(dataclasses.replace(item, box_sides=None))
    assert placed(dataclasses.replace(item, box_sides=(edge, (30.0, -8.0)))) == alone
    assert placed(dataclasses.replace(item, box_sides=((30.0, -8.0), edge))) == alone


def test_the_flank_of_a_car_in_the_next_lane_does_not_widen_it() -> None:
    """Its box covers rear and side: from 4.4 m to the side at its rear to 2.6 m at its front, which is farther away."""
    item = fused(1, 15.0, 3.5, length=4.5)
    beside = dataclasses.replace(item, box_sides=((15.0, 4.4), (15.0, 2.0)))
    assert placed(beside)[0].middle_m == pytest.approx(3.5, abs=0.02)


@pytest.mark.parametrize(("label", "reaches"), [("truck", False), ("bus", False), ("car", True)])
def test_the_flank_of_a_truck_in_a_bend_does_not_widen_it(label: str, reaches: bool) -> None:
    """Seen from a bend, its box covers 7 m at the distance of its front: its flank is 12 m long. A car's is not."""
    item = fused(1, 37.0, 8.0, length=4.5, width=2.5, label=label, velocity=(-EGO.speed_mps, 0.0))
    found, _ = placed(dataclasses.replace(item, box_sides=((37.0, 9.3), (37.0, 2.3))))
    assert (found.low_m < 3.0) == reaches


@pytest.mark.parametrize(
    ("over_ground", "reaches"),
    [
        pytest.param((9.0, 1.0), False, id="drives ahead"),
        pytest.param((-9.0, -1.0), False, id="oncoming"),
        pytest.param((4.0, -6.0), True, id="turns across"),
        pytest.param((0.0, 0.0), True, id="stands, perhaps across"),
    ],
)
def test_a_box_over_several_vehicles_does_not_widen_what_drives_along(
    over_ground: tuple[float, float], reaches: bool
) -> None:
    vx, vy = over_ground
    item = fused(1, 10.0, 3.5, length=4.5, velocity=(vx - EGO.speed_mps, vy))
    seen = dataclasses.replace(item, box_sides=((10.0, 5.2), (10.0, -1.6)))
    assert (placed(seen)[0].low_m < 0.0) == reaches
    assert placed(seen, params=CipvParams(narrow_along=False))[0].low_m < 0.0


@pytest.mark.parametrize(
    ("speed_mps", "label", "doubtful"),
    [
        pytest.param(0.0, "car", True, id="a parked car: we may turn off before it"),
        pytest.param(4.0, "car", False, id="one that drives ahead is where the road goes"),
        pytest.param(-6.0, "car", True, id="an oncoming one may come around the corner"),
        pytest.param(4.0, None, True, id="a hedge that seems to move"),
    ],
)
def test_at_a_creep_what_stands_ahead_may_be_beyond_a_corner(
    speed_mps: float, label: str | None, doubtful: bool
) -> None:
    slow = EgoState(0, 4.2, 0.0)
    path = dataclasses.replace(STRAIGHT, corner_m=corner_m(slow, PathParams()))
    item = fused(1, 18.0, source="VL" if label else "L", velocity=(speed_mps - 4.2, 0.0), label=label)
    aware, unaware = placed(item, path, slow)[0], placed(item, STRAIGHT, slow)[0]
    assert (aware.sigma_m > 2.0) == doubtful
    assert (aware.sigma_m == unaware.sigma_m) != doubtful


@pytest.mark.parametrize("way", [-1.0, 1.0])
def test_the_nose_of_one_that_moves_over_is_farther_that_way(way: float) -> None:
    """2 m/s sideways at 15 m/s, of which 1.5 m/s count: 0.45 m over a car's length."""
    steady, _ = placed(fused(1, 20.0, 3.0, velocity=(-5.0, 0.0)))
    moving, _ = placed(fused(1, 20.0, 3.0, velocity=(-5.0, 2.0 * way)))
    gained = moving.high_m - steady.high_m if way > 0.0 else steady.low_m - moving.low_m
    assert gained == pytest.approx(0.45, abs=0.02)
    assert moving.high_m - moving.low_m == pytest.approx(steady.high_m - steady.low_m + 0.45, abs=0.02)


# ------------------------------------------------------------ what a box shows beside a rear


def by_its_box(x: float, y: float, yaw_rad: float = 0.0) -> FusedObject:
    """A car with the centre of its rear at (x, y), as seen by the camera: at its range, on the bearing of the centre of
    its box, which encloses all its corners."""
    car = Cuboid((x + 2.15 * math.cos(yaw_rad), y + 2.15 * math.sin(yaw_rad), 0.75), (4.3, 1.8, 1.5), yaw_rad)
    bearings = [math.atan2(b, a) for a, b in car.footprint()]
    middle, range_m = (max(bearings) + min(bearings)) / 2, math.hypot(x, y)
    return fused(1, range_m * math.cos(middle), range_m * math.sin(middle), source="V", length=4.3)


@pytest.mark.parametrize(
    ("x", "y"), [(12.0, 3.5), (20.0, -3.5), (30.0, 3.5), (20.0, -7.0), (45.0, 7.0), (25.0, 0.0), (60.0, -3.5)]
)
def test_the_rear_counts_though_the_box_shows_a_flank_too(x: float, y: float) -> None:
    found, _ = placed(by_its_box(x, y))
    assert found.offset_m == pytest.approx(y, abs=0.08)
    unaware, *_ = place([by_its_box(x, y)], STRAIGHT, EGO, CipvParams(use_flank=False))
    assert unaware is not None
    assert abs(unaware[0].offset_m) <= abs(found.offset_m) + 1e-9, "a flank shows towards the path"
    if y and x <= 30.0:
        assert abs(unaware[0].offset_m - y) > 0.1
        assert found.sigma_m > unaware[0].sigma_m


def test_in_a_bend_a_flank_is_as_wide_as_a_rear() -> None:
    """A car parked beside a bend, turned along it by half a right angle: its box is 1.3 m off its rear."""
    s = samples(60.0)
    center, headings = arc(1.0 / 40.0, s)
    path = dataclasses.replace(STRAIGHT, center=center, left=center, right=center)
    (x, y), yaw = center[25], float(headings[25])
    rear = (float(x) + 3.2 * math.sin(yaw), float(y) - 3.2 * math.cos(yaw))  # 3.2 m to the right of the path
    found, _ = placed(by_its_box(*rear, yaw), path)
    assert found.offset_m == pytest.approx(-3.2, abs=0.35)
    unaware, *_ = place([by_its_box(*rear, yaw)], path, EGO, CipvParams(use_flank=False))
    assert unaware is not None
    assert unaware[0].offset_m > -2.6


def test_what_the_lidar_ranges_is_where_its_points_are() -> None:
    item = fused(1, 20.0, 3.5)
    (seen,) = describe([item], EGO, MotionParams())
    assert placed(item)[0] == place([seen], STRAIGHT, EGO, CipvParams(use_flank=False))[0][0]  # type: ignore[index]
