"""A track between and beyond its keyframes."""

from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.common.errors import BadInput
from pipeline.common.geometry import Cuboid
from pipeline.labels.interpolate import drop_keyframe, put_keyframe, resized
from pipeline.labels.model import Sighting

T_NS = tuple(index * 100_000_000 for index in range(40))
SIZE = (4.0, 1.8, 1.5)


def at(
    frame: int, x: float, *, yaw: float = 0.0, size: tuple[float, float, float] = SIZE, key: bool = True
) -> Sighting:
    return Sighting(frame, Cuboid((x, 0.0, 0.7), size, yaw), None, key)


def track(*sightings: Sighting) -> dict[int, Sighting]:
    return {each.frame: each for each in sightings}


def xs(found: dict[int, Sighting]) -> dict[int, float]:
    return {frame: round(each.cuboid.center[0], 6) for frame, each in found.items() if each.cuboid is not None}


def cuboid(found: dict[int, Sighting], frame: int) -> Cuboid:
    placed = found[frame].cuboid
    assert placed is not None
    return placed


SEEN = track(*(at(frame, 20.0 + frame, key=False) for frame in range(10)))
"""The pipeline's track: one metre per frame."""


# ------------------------------------------------------------ between


def test_over_a_step_back_of_the_clock_nothing_is_put_between() -> None:
    ticks = (*T_NS[:5], *T_NS[:5])
    with pytest.raises(BadInput, match="clock steps back"):
        put_keyframe(track(at(2, 9.0)), at(6, 9.0), ticks)
    with pytest.raises(BadInput, match="clock steps back"):
        drop_keyframe(track(at(2, 9.0), at(4, 9.0), at(6, 9.0)), 4, ticks)
    assert xs(put_keyframe(track(at(2, 9.0)), at(6, 9.0), ticks, interpolate=False)) == {2: 9.0, 6: 9.0}


def test_between_two_keyframes_it_moves_evenly_in_time_not_by_frame_number() -> None:
    late = [0, 1, 2, 9]
    ticks = tuple(t * 100_000_000 for t in late)
    found = put_keyframe(track(*(at(f, 0.0, key=f in (0,)) for f in range(4))), at(3, 9.0), ticks)
    assert xs(found) == {0: 0.0, 1: 1.0, 2: 2.0, 3: 9.0}


def test_through_several_keyframes_the_way_is_smooth_and_never_swings_beyond_them() -> None:
    found = dict(SEEN)
    for frame, x in ((0, 0.0), (3, 3.0), (6, 12.0), (9, 12.0)):
        found = put_keyframe(found, at(frame, x), T_NS)
    places = [xs(found)[frame] for frame in range(10)]
    assert places == sorted(places)
    assert (places[0], places[3], places[6], places[9]) == (0.0, 3.0, 12.0, 12.0)
    assert max(places) == 12.0
    steps = [b - a for a, b in itertools.pairwise(places)]
    assert steps[3] < steps[4] > steps[5]  # it speeds up and slows down instead of turning at a corner


@pytest.mark.parametrize(
    ("first", "last", "middle"),
    [(3.0, -3.0, math.pi), (-3.0, 3.0, math.pi), (0.2, -0.2, 0.0), (0.0, math.pi / 2, math.pi / 4)],
)
def test_yaw_turns_the_short_way(first: float, last: float, middle: float) -> None:
    found = put_keyframe({**SEEN, 0: at(0, 20.0, yaw=first)}, at(8, 28.0, yaw=last), T_NS)
    assert math.remainder(cuboid(found, 4).yaw_rad - middle, math.tau) == pytest.approx(0.0, abs=1e-9)
    assert -math.pi < cuboid(found, 4).yaw_rad <= math.pi


def test_a_size_between_is_one_of_the_keyframes_never_a_mixture() -> None:
    long = (6.0, 2.0, 2.0)
    found = put_keyframe({**SEEN, 0: at(0, 20.0)}, at(8, 28.0, size=long), T_NS)
    assert [cuboid(found, frame).size for frame in (1, 3, 5, 7)] == [SIZE, SIZE, long, long]


def test_frames_in_which_it_is_not_stay_empty() -> None:
    hidden = {frame: each for frame, each in SEEN.items() if frame not in (4, 5)}
    found = put_keyframe(put_keyframe(hidden, at(0, 20.0), T_NS), at(9, 38.0), T_NS)
    assert sorted(found) == sorted(hidden)


def test_a_keyframe_where_it_was_not_seen_is_joined_to_where_it_was() -> None:
    found = put_keyframe(SEEN, at(14, 39.0), T_NS)
    assert xs(found) == {**{f: 20.0 + f for f in range(10)}, **{9 + n: 29.0 + 2.0 * n for n in range(1, 6)}}
    assert [frame for frame, each in found.items() if each.keyframe] == [14]


def test_a_keyframe_of_the_image_alone_ends_what_is_followed() -> None:
    boxed = Sighting(5, None, (1.0, 1.0, 9.0, 9.0))
    found = put_keyframe({**SEEN, 5: boxed, 0: at(0, 99.0)}, at(9, 50.0), T_NS)
    assert xs(found)[3] == 23.0
    assert found[5] == boxed


# ------------------------------------------------------------ beyond


def test_beyond_the_outermost_keyframe_the_pipeline_is_kept_and_shifted() -> None:
    found = put_keyframe(SEEN, at(5, 27.0, yaw=0.1), T_NS)
    assert xs(found) == {frame: 22.0 + frame for frame in range(10)}
    assert {cuboid(found, frame).yaw_rad for frame in (0, 9)} == {0.1}
    further = put_keyframe(found, at(8, 31.0, yaw=0.1), T_NS)
    assert (xs(further)[2], xs(further)[5], xs(further)[9]) == (24.0, 27.0, 32.0)


def test_beyond_it_the_size_is_taken_over_and_the_near_side_held() -> None:
    rear = track(*(at(frame, 20.0 + frame, size=(0.4, 1.8, 1.5), key=False) for frame in range(4)))
    whole = put_keyframe(rear, at(2, 22.0 - 0.2 + 2.0), T_NS)
    for frame in range(4):
        assert cuboid(whole, frame).size == SIZE
        assert cuboid(whole, frame).center[0] - 2.0 == pytest.approx(20.0 + frame - 0.2)


def test_without_interpolation_one_frame_changes() -> None:
    found = put_keyframe(SEEN, at(5, 99.0), T_NS, interpolate=False)
    assert {frame for frame in SEEN if found[frame] != SEEN[frame]} == {5}


# ------------------------------------------------------------ boxes, dropping


def test_a_box_is_corrected_less_and_less_towards_the_next_keyframe() -> None:
    boxed = {f: Sighting(f, None, (0.0, 0.0, 10.0, 10.0), f in (0, 8)) for f in range(12)}
    found = put_keyframe(boxed, Sighting(4, None, (4.0, 0.0, 14.0, 10.0)), T_NS)
    assert [found[f].bbox[0] for f in (0, 2, 4, 6, 8, 11)] == [0.0, 2.0, 4.0, 2.0, 0.0, 0.0]  # type: ignore[index]


def test_a_box_that_nobody_touched_stays_though_the_cuboid_moves() -> None:
    boxed = {f: Sighting(f, each.cuboid, (1.0, 2.0, 3.0, 4.0), False) for f, each in SEEN.items()}
    found = put_keyframe(boxed, Sighting(4, Cuboid((99.0, 0.0, 0.7), SIZE, 0.0), (1.0, 2.0, 3.0, 4.0)), T_NS)
    assert {each.bbox for each in found.values()} == {(1.0, 2.0, 3.0, 4.0)}


def test_a_dropped_keyframe_follows_its_neighbours_and_the_last_one_stays() -> None:
    found = track(at(0, 0.0), at(1, 9.0), at(2, 2.0))
    assert xs(drop_keyframe(found, 1, T_NS)) == {0: 0.0, 1: 1.0, 2: 2.0}
    assert xs(drop_keyframe(found, 2, T_NS)) == {0: 0.0, 1: 9.0, 2: 2.0}


# ------------------------------------------------------------ properties

PLACES = st.floats(-60.0, 60.0, allow_nan=False).map(lambda v: round(v, 3))
SIDES = st.floats(0.2, 15.0, allow_nan=False).map(lambda v: round(v, 3))
CUBOIDS = st.builds(
    Cuboid, st.tuples(PLACES, PLACES, PLACES), st.tuples(SIDES, SIDES, SIDES), st.floats(-3.1, 3.1, allow_nan=False)
)


@given(st.dictionaries(st.integers(0, 39), CUBOIDS, min_size=1, max_size=8), st.permutations(range(8)))
def test_keyframes_are_where_they_were_put_whatever_the_order(keys: dict[int, Cuboid], order: list[int]) -> None:
    found: dict[int, Sighting] = {}
    frames = list(keys)
    for place in (each for each in order if each < len(frames)):
        found = put_keyframe(found, Sighting(frames[place], keys[frames[place]]), T_NS)
    assert {frame: each.cuboid for frame, each in found.items() if each.keyframe} == keys
    assert list(found) == list(range(min(keys), max(keys) + 1))
    low, high = (f([c.center for c in keys.values()], key=lambda p: p[0])[0] for f in (min, max))
    assert all(low - 1e-6 <= cuboid(found, frame).center[0] <= high + 1e-6 for frame in found)


@given(CUBOIDS, st.tuples(SIDES, SIDES, SIDES))
def test_a_resized_cuboid_keeps_its_bottom_and_the_corner_turned_to_us(
    box: Cuboid, size: tuple[float, float, float]
) -> None:
    other = resized(box, size)
    assert (other.size, other.yaw_rad) == (size, box.yaw_rad)
    assert other.center[2] - size[2] / 2 == pytest.approx(box.center[2] - box.size[2] / 2, abs=1e-6)
    along, across = _offset(box)
    if abs(along) >= box.size[0] / 2 and abs(across) >= box.size[1] / 2:  # we see two sides, and the corner between
        assert _nearest(other) == pytest.approx(_nearest(box), abs=1e-6)


def test_a_wider_car_straight_ahead_stays_straight_ahead() -> None:
    assert resized(Cuboid((20.0, 0.0, 0.7), SIZE, 0.0), (5.0, 3.0, 1.5)).center == (20.5, 0.0, 0.7)
    left = resized(Cuboid((20.0, 6.0, 0.7), SIZE, 0.0), (4.0, 2.8, 1.5))
    assert left.center[1] - 1.4 == pytest.approx(6.0 - 0.9)


def _offset(box: Cuboid) -> tuple[float, float]:
    """Position of the ego origin in the cuboid's frame."""
    c, s = math.cos(box.yaw_rad), math.sin(box.yaw_rad)
    x, y, _ = box.center
    return -(x * c + y * s), x * s - y * c


def _nearest(box: Cuboid) -> tuple[float, float]:
    along, across = _offset(box)
    u = min(max(along, -box.size[0] / 2), box.size[0] / 2)
    v = min(max(across, -box.size[1] / 2), box.size[1] / 2)
    c, s = math.cos(box.yaw_rad), math.sin(box.yaw_rad)
    return box.center[0] + u * c - v * s, box.center[1] + u * s + v * c
