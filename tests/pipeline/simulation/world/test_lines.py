"""The numbers of lines on the ground, in the fast form for single positions."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.simulation.world.lines import RoadLine

ARCS = [(100.0, 0.0), (200.0, 0.004), (80.0, -0.01), (300.0, 0.0)]
LENGTHS_M = [length for length, _ in ARCS]


@pytest.mark.parametrize("d_m", [0.0, 1.75, -5.0])
def test_a_way_along_the_line_is_numpys_interpolation_to_the_last_bit(d_m: float) -> None:
    """Of the ways at the ends of its arcs: inside the first, on an end, and beyond the last."""
    line = RoadLine(ARCS)
    ends = np.concatenate([[-1e5], np.cumsum(LENGTHS_M)[:-1], [sum(LENGTHS_M) + 1e5]])
    ways = np.concatenate([[0.0], np.cumsum(np.diff(ends) * [1.0 - curvature * d_m for _, curvature in ARCS])])
    for s_m in (-40.0, 0.0, 33.3, 100.0, 299.9, 380.0, 5000.0):
        for way_m in (-250.0, 0.0, 17.1, 900.0):
            expected = float(np.interp(np.interp(s_m, ends, ways) + way_m, ways, ends))
            assert line.advance(s_m, way_m, d_m) == expected
        assert line.driven_m(12.5, s_m, d_m) == np.diff(np.interp([12.5, s_m], ends, ways))[0]
