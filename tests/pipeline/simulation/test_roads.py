"""Roads of straights and arcs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.simulation.roads import Road, Segment

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


def test_lanes_are_counted_from_the_median() -> None:
    assert ROAD.lane_offset_m(-1) == pytest.approx(-2.0 - 1.8)
    assert ROAD.lane_offset_m(-3) == pytest.approx(-2.0 - 2.5 * 3.6)
    assert ROAD.lane_offset_m(2) == pytest.approx(2.0 + 1.5 * 3.6)
    for lane in (0, -4, 3):
        with pytest.raises(ValueError, match=f"no lane {lane}"):
            ROAD.lane_offset_m(lane)


def test_curvature_by_place() -> None:
    assert [ROAD.curvature_per_m(s) for s in (-10.0, 50.0, 150.0, 320.0, 9999.0)] == [0.0, 0.0, 0.01, 0.0, 0.0]
