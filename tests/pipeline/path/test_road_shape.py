"""A road's shape is found from what lies beside it."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.params import PathParams
from pipeline.path import road_shape
from pipeline.path.corridor import nearest
from pipeline.path.estimates import arc, samples
from pipeline.types import F64, EgoState

PARAMS = PathParams()
S = samples(PARAMS.length_m)


def beside(curvature: float, seed: int = 0) -> F64:
    """A hedge 6 m to the left, parked cars to the right with rears and gaps, and clutter all around."""
    rng = np.random.default_rng(seed)
    line, heading = arc(curvature, S)
    normal = np.column_stack([-np.sin(heading), np.cos(heading)])
    places = []
    for k in range(2, 40):
        if rng.random() < 0.8:
            places.append(line[k] + normal[k] * (6.0 + rng.normal(0.0, 0.1)))
        if k % 6 < 4:
            places.append(line[k] - normal[k] * (1.8 + rng.normal(0.0, 0.1)))
        if k % 6 == 0:
            places.extend(line[k] - normal[k] * d for d in (2.3, 2.8, 3.3))
        if rng.random() < 0.3:
            places.append(line[k] + normal[k] * rng.uniform(-14.0, 14.0))
    return np.array(places)


def found(cells: F64, ego: EgoState, blocks: F64 | None = None) -> tuple[F64, F64]:
    starts = road_shape.begin(None, ego, None, True, PARAMS)
    return road_shape.fitted(cells, np.zeros(len(cells)) if blocks is None else blocks, starts, ego, PARAMS)


@pytest.mark.parametrize("radius_m", [30.0, -50.0, 150.0, 1e9], ids=lambda r: f"R {r:g} m")
def test_the_shape_is_that_of_the_bend(radius_m: float) -> None:
    center, sigma = found(beside(1.0 / radius_m), EgoState(0, 7.0, 7.0 / radius_m))
    off, _ = nearest(arc(1.0 / radius_m, S)[0], center[[10, 20, 30]])
    assert np.abs(off) == pytest.approx(0.0, abs=0.7)
    assert (np.abs(off) < 3.0 * sigma[[10, 20, 30]]).all()
    assert sigma[30] < 1.2


def test_of_a_road_with_nothing_beside_it_little_is_known() -> None:
    clutter = np.random.default_rng(1).uniform((2.0, -14.0), (45.0, 14.0), (40, 2))
    _, sigma = found(clutter, EgoState(0, 7.0, 0.0))
    _, known = found(beside(0.0), EgoState(0, 7.0, 0.0))
    assert sigma[30] > 2.0 * known[30]


def test_a_shape_that_is_followed_moves_with_the_car() -> None:
    """After one metre along a bend, the rest of the bend lies ahead, starting at the car."""
    ego = EgoState(0, 10.0, 0.2)
    moved = road_shape.moved_on(arc(0.02, S)[0], ego, 0.1, S)
    assert moved[0] == pytest.approx([0.0, 0.0])
    assert moved[:40] == pytest.approx(arc(0.02, S)[0][:40], abs=0.05)


@pytest.mark.parametrize("speed_mps", [14.0, 20.0])
def test_with_little_beside_it_a_road_goes_on_as_it_went(speed_mps: float) -> None:
    """At speed, a bend cannot end at once. With only clutter, the shape is the arc just driven, although 3 m/s² of
    lateral acceleration is more than usual; without a yaw rate, it is straight."""
    curvature = 3.0 / speed_mps**2
    clutter = np.random.default_rng(1).uniform((2.0, -14.0), (45.0, 14.0), (30, 2))
    center, sigma = found(clutter, EgoState(0, speed_mps, speed_mps * curvature))
    off, _ = nearest(arc(curvature, S)[0], center[[20, 30]])
    straight, _ = found(clutter, EgoState(0, speed_mps, None))
    missed, _ = nearest(arc(curvature, S)[0], straight[[20, 30]])
    assert (np.abs(off) < 2.0 * sigma[[20, 30]]).all()
    assert abs(missed[1]) > 3.0 * abs(off[1])
