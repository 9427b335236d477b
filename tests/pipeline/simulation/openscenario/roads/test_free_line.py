"""Polylines, clothoids and NURBS as lines of arcs, against their definitions."""

from __future__ import annotations

from math import cos, hypot, pi, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.simulation.openscenario.roads.free_line import (
    CORNER_M,
    FreeLine,
    clothoid,
    nurbs,
    overlaps,
    polyline,
    straight,
    through_poses,
)
from pipeline.types import F64


def distance_m(line: FreeLine, x: float, y: float) -> float:
    px, py, _ = line.pose(line.project(x, y))
    return hypot(px - x, py - y)


def test_a_polyline_is_straight_between_its_points_and_rounds_its_corners() -> None:
    line, s_m = polyline([(0.0, 0.0), (10.0, 0.0), (10.0, 8.0), (10.0, 20.0)])
    assert line.pose(5.0) == pytest.approx((5.0, 0.0, 0.0))
    assert line.pose(line.length_m) == pytest.approx((10.0, 20.0, pi / 2))
    assert distance_m(line, 10.0, 0.0) == pytest.approx(CORNER_M, abs=1e-6)
    assert distance_m(line, 10.0, 8.0) == pytest.approx(0.0, abs=1e-9)
    assert s_m == sorted(s_m)
    assert [line.pose(s)[:2] for s in s_m] == [
        pytest.approx(place, abs=CORNER_M) for place in ((0, 0), (10, 0), (10, 8), (10, 20))
    ]


def test_points_of_a_sampled_curve_become_a_smooth_one() -> None:
    at = np.linspace(0.0, 1.5, 16)
    line, _ = polyline([(20.0 * sin(a), 20.0 * (1.0 - cos(a))) for a in at.tolist()])
    assert line.length_m == pytest.approx(30.0, abs=0.1)
    assert max(abs(bend) for _, bend in line.arcs) < 0.06
    middle = line.pose(15.0)
    assert middle[2] == pytest.approx(0.75, abs=0.06)


@pytest.mark.parametrize(
    ("points", "says"),
    [([(1.0, 1.0), (1.0, 1.0)], "all its points coincide"), ([(0.0, 0.0), (5.0, 0.0), (1.0, 0.0)], "turns back")],
)
def test_polylines_that_lead_nowhere(points: list[tuple[float, float]], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        polyline(points)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.floats(1.0, 30.0), st.floats(-1.5, 1.5)), min_size=1, max_size=8), st.floats(0.0, 1.0))
def test_a_polyline_passes_all_its_points_and_can_be_cut(legs: list[tuple[float, float]], share: float) -> None:
    points, heading = [(3.0, -2.0)], 0.3
    for length, turn in legs:
        heading += turn
        points.append((points[-1][0] + length * cos(heading), points[-1][1] + length * sin(heading)))
    line, s_m = polyline(points)
    for (x, y), s in zip(points, s_m, strict=True):
        px, py, _ = line.pose(s)
        assert hypot(px - x, py - y) < CORNER_M + 1e-4
    cut = share * line.length_m
    both = line.until_m(cut).then(line.from_m(cut))
    for s in np.linspace(0.0, line.length_m, 7).tolist():
        np.testing.assert_allclose(both.pose(s), line.pose(s), atol=1e-5)


def integrated(start_bend: float, end_bend: float, length: float) -> F64:
    """x, y and heading at the end of a clothoid, by its definition."""
    s = np.linspace(0.0, length, 20_001)
    heading = start_bend * s + (end_bend - start_bend) / length * s * s / 2
    return np.array([np.trapezoid(np.cos(heading), s), np.trapezoid(np.sin(heading), s), heading[-1]])


@pytest.mark.parametrize(("bends", "length"), [((1 / 1500, 1 / 9), 6.4), ((-0.05, 0.05), 30.0), ((0.02, 0.02), 50.0)])
def test_a_clothoid_is_the_integral_of_its_curvature(bends: tuple[float, float], length: float) -> None:
    line = clothoid((0.0, 0.0, 0.0), length, *bends)
    assert line.length_m == pytest.approx(length)
    np.testing.assert_allclose(line.pose(length), integrated(*bends, length), atol=4e-3)


def test_a_nurbs_of_degree_two_is_an_exact_quarter_of_a_circle() -> None:
    points = np.array([[10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
    line, s_m = nurbs(points, np.array([1.0, np.sqrt(0.5), 1.0]), np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]), 3)
    assert line.length_m == pytest.approx(5.0 * pi, abs=0.01)
    for s in np.linspace(0.0, line.length_m, 9).tolist():
        assert hypot(*line.pose(s)[:2]) == pytest.approx(10.0, abs=0.011)
    assert s_m == pytest.approx([0.0, 2.5 * pi, 5.0 * pi], abs=0.02)


@pytest.mark.parametrize(
    ("weights", "knots", "order", "says"),
    [
        ([1, 1, 1], [0, 0, 1, 1], 3, "need 6 knots"),
        ([1, 1, 1], [0, 0, 0, 1, 1, 1], 9, "order 9"),
        ([1, 0, 1], [0, 0, 0, 1, 1, 1], 3, "weights be positive"),
        ([1, 1, 1], [0, 0, 2, 1, 1, 1], 3, "knots must ascend"),
    ],
)
def test_wrong_nurbs(weights: list[float], knots: list[float], order: int, says: str) -> None:
    points = np.array([[0.0, 0.0], [5.0, 5.0], [9.0, 0.0]])
    with pytest.raises(ValueError, match=says):
        nurbs(points, np.array(weights, dtype=float), np.array(knots, dtype=float), order)


def test_the_nearest_place_is_found_beyond_the_ends_and_far_outside_a_bend() -> None:
    line = straight((0.0, 0.0, 0.0), 50.0).then(clothoid((50.0, 0.0, 0.0), 7.0 * pi / 2, 1 / 7, 1 / 7))
    line = line.then(straight(line.pose(line.length_m), 60.0))
    for x, y in ((-20.0, 3.0), (57.0, 200.0), (150.0, 30.0), (48.0, -5.0), (30.0, 15.0)):
        s = line.project(x, y)
        px, py, heading = line.pose(s)
        assert (x - px) * cos(heading) + (y - py) * sin(heading) == pytest.approx(0.0, abs=1e-6)
    assert line.project(-20.0, 3.0) == pytest.approx(-20.0)


def test_samples_of_a_place_are_a_line_there() -> None:
    assert through_poses(np.array([[4.0, 5.0, 1.0], [4.0, 5.0, 1.0]])).pose(0.0) == pytest.approx((4.0, 5.0, 1.0))


def test_turned_rectangles_overlap_only_where_they_touch() -> None:
    square = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0]])
    turned = square @ np.array([[cos(pi / 4), -sin(pi / 4)], [sin(pi / 4), cos(pi / 4)]])
    assert overlaps(square, turned + np.array([2.3, 0.0]))
    assert not overlaps(square, turned + np.array([2.3, 2.3]) / 1.05), "their bounding boxes do"
