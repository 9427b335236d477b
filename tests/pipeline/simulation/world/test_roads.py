"""Roads of straights and arcs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.simulation.world.roads import Road, Segment

ROAD = Road(segments=(Segment(length_m=100.0), Segment(length_m=200.0, curvature_per_m=0.01), Segment(length_m=50.0)))


def test_a_straight_runs_along_x() -> None:
    np.testing.assert_allclose(ROAD.to_world([0.0, 40.0, -5.0], 0.0), [[0, 0, 0], [40, 0, 0], [-5, 0, 0]], atol=1e-9)


@pytest.mark.parametrize(("s", "d"), [(150.0, 0.0), (200.0, 3.0), (299.0, -7.0)])
def test_an_arc_keeps_its_radius(s: float, d: float) -> None:
    x, y, heading = ROAD.to_world(s, d)[0]
    turned = (s - 100.0) / 100.0
    assert heading == pytest.approx(turned)
    radius = 100.0 - d  # to the left is nearer to the centre of a left curve
    assert (x, y) == (pytest.approx(100.0 + radius * np.sin(turned)), pytest.approx(100.0 - radius * np.cos(turned)))


def test_an_arcs_offset_is_not_twice_as_curved() -> None:
    """20 m along an arc of 200 m radius lies r(1 − cos(s/r)) = 1.00 m beside the tangent, not 2 m."""
    road = Road(segments=(Segment(length_m=500.0, curvature_per_m=1 / 200.0),))
    assert road.to_world(20.0, 0.0)[0, 1] == pytest.approx(200.0 * (1 - np.cos(0.1)))
    assert road.to_world(20.0, 0.0)[0, 1] == pytest.approx(1.0, abs=0.01)


@given(st.lists(st.tuples(st.floats(5, 300), st.floats(-0.05, 0.05)), min_size=1, max_size=5), st.floats(0, 900))
def test_roads_have_no_steps_or_kinks(parts: list[tuple[float, float]], s: float) -> None:
    road = Road(segments=tuple(Segment(length_m=length, curvature_per_m=bend) for length, bend in parts))
    here, there = road.to_world([s, s + 0.01], 0.0)
    assert np.hypot(*(there - here)[:2]) == pytest.approx(0.01, rel=1e-3)
    assert abs(there[2] - here[2]) <= 0.0501 * 0.01
    across = road.to_world(s, [0.0, 2.0])
    assert np.hypot(*(across[1] - across[0])[:2]) == pytest.approx(2.0)


@given(
    st.lists(st.tuples(st.floats(5, 300), st.sampled_from([0.0, 1e-9, 0.01, -0.05])), min_size=1, max_size=5),
    st.lists(st.tuples(st.floats(-100, 900), st.floats(-9, 9)), min_size=1),
)
def test_a_place_is_the_same_alone_and_among_others(
    parts: list[tuple[float, float]], places: list[tuple[float, float]]
):
    road = Road(segments=tuple(Segment(length_m=length, curvature_per_m=bend) for length, bend in parts))
    places += [(0.0, -0.0), *((end_m, 0.0) for end_m in road.segment_ends_m)]
    among = road.to_world(*np.array(places).T)
    alone = np.concatenate([road.to_world(s, d) for s, d in places])
    assert alone.tobytes() == among.tobytes()


def test_lanes_are_counted_from_the_median() -> None:
    assert ROAD.lane_offset_m(-1) == pytest.approx(-2.0 - 1.8)
    assert ROAD.lane_offset_m(-3) == pytest.approx(-2.0 - 2.5 * 3.6)
    assert ROAD.lane_offset_m(2) == pytest.approx(2.0 + 1.5 * 3.6)
    for lane in (0, -4, 3):
        with pytest.raises(ValueError, match=f"no lane {lane}"):
            ROAD.lane_offset_m(lane)


def test_curvature_by_place() -> None:
    assert [ROAD.curvature_per_m(s) for s in (-10.0, 50.0, 150.0, 320.0, 9999.0)] == [0.0, 0.0, 0.01, 0.0, 0.0]


def test_a_radius_stands_for_a_curvature() -> None:
    assert Segment.model_validate({"length_m": 10, "radius_m": -250}).curvature_per_m == pytest.approx(-0.004)
    for wrong in ({"radius_m": 3}, {"radius_m": "wide"}, {"radius_m": 50, "curvature_per_m": 0.02}):
        with pytest.raises(ValueError, match="radius_m"):
            Segment.model_validate({"length_m": 10, **wrong})


def test_a_transition_bends_evenly() -> None:
    """A clothoid: heading κ₁s²/2L, and its end against the integral."""
    road = Road(
        segments=(Segment(length_m=50.0, end_curvature_per_m=0.02), Segment(length_m=9.0, curvature_per_m=0.02))
    )
    assert road.curvature_per_m(25.0) == pytest.approx(0.01)
    assert road.curvature_per_m(50.0) == pytest.approx(0.02)
    s = np.linspace(0.0, 50.0, 200_001)
    heading = 0.02 * s**2 / 100.0
    x, y, turned = road.to_world(50.0, 0.0)[0]
    assert turned == pytest.approx(heading[-1])
    assert (x, y) == (
        pytest.approx(np.trapezoid(np.cos(heading), s), abs=1e-3),
        pytest.approx(np.trapezoid(np.sin(heading), s), abs=1e-3),
    )


def test_a_road_too_wide_for_its_bend_is_refused() -> None:
    with pytest.raises(ValueError, match="too tight"):
        Road.model_validate({"segments": [{"length_m": 10, "radius_m": 12}]})


@pytest.mark.parametrize("d", [-6.0, 0.0, 6.0])
def test_a_way_driven_is_as_long_as_the_line_beside_the_road(d: float) -> None:
    end = ROAD.line.advance(10.0, 300.0, d)
    course = ROAD.to_world(np.linspace(10.0, end, 20_001), d)
    assert np.hypot(*np.diff(course[:, :2], axis=0).T).sum() == pytest.approx(300.0, rel=1e-6)
    assert ROAD.line.advance(end, -300.0, d) == pytest.approx(10.0)


def test_a_changed_copy_forgets_the_old_course_and_is_checked() -> None:
    assert ROAD.line.advance(0.0, 10.0, 0.0) == 10.0
    straight = ROAD.model_copy(update={"segments": ({"length_m": 500.0},)})
    assert straight.to_world(300.0, 0.0)[0, 1] == 0.0
    with pytest.raises(ValueError, match="lanes_forward"):
        ROAD.model_copy(update={"lanes_forward": 0})


EDGES = {"forward_edges_m": (0.5, -3.0, -7.0), "oncoming_edges_m": (2.5, 6.5)}


def test_lanes_of_unequal_width() -> None:
    road = Road(segments=(Segment(length_m=100),), **EDGES)
    assert road.lanes() == (-2, -1, 1)
    assert [road.lane_offset_m(lane) for lane in road.lanes()] == [-5.0, -1.25, 4.5]
    assert road.edges_m() == ((-7.0, 0.5), (2.5, 6.5))
    assert (road.lane_width_m, road.median_m) == (3.75, 2.0)
    equal = Road(segments=road.segments, lanes_forward=2, lanes_oncoming=1, median_m=1.0, lane_width_m=3.0)
    assert equal.lane_lines_m() == ((-0.5, -3.5, -6.5), (0.5, 3.5))


@pytest.mark.parametrize(
    ("edges", "says"),
    [
        ({"forward_edges_m": (-1.0,)}, "a lane has two edges"),
        ({"forward_edges_m": (-4.0, -1.0)}, "must lead outwards"),
        ({"forward_edges_m": (0.0, -3.0), "oncoming_edges_m": (4.0, 1.0)}, "must lead outwards"),
        ({"forward_edges_m": (0.0, -3.0), "oncoming_edges_m": (-1.0, 3.0)}, "the directions overlap"),
        ({"oncoming_edges_m": (0.0, 3.0)}, "oncoming_edges_m needs forward_edges_m"),
        ({"forward_edges_m": ("left", "right")}, "valid number"),
    ],
)
def test_edges_of_lanes_that_are_refused(edges: dict[str, tuple[float, ...]], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        Road(segments=(Segment(length_m=100),), **edges)


def test_humps_are_linear_between_their_places() -> None:
    road = Road(segments=(Segment(length_m=100),), humps_per_m=((10.0, 0.0), (30.0, 0.002), (40.0, -0.001)))
    assert [road.hump_per_m(s) for s in (0.0, 20.0, 30.0, 35.0, 90.0)] == pytest.approx(
        [0.0, 0.001, 0.002, 0.0005, -0.001]
    )


@given(d=st.floats(-6.0, 6.0), start=st.floats(0.0, 80.0), way=st.floats(-60.0, 60.0))
def test_the_way_between_two_places_is_what_leads_from_one_to_the_other(d: float, start: float, way: float) -> None:
    line = Road(segments=(Segment(length_m=40), Segment(length_m=60, radius_m=50))).line
    assert line.driven_m(start, line.advance(start, way, d), d) == pytest.approx(way, abs=1e-6)
