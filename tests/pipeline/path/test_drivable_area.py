"""The path along the edges of the drivable area."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.common.geometry import F64
from pipeline.params import Params, PathParams, with_changes
from pipeline.path import drivable_area
from pipeline.path.corridor import Evidence, PathState, offset, predict
from pipeline.path.drivable_area import DrivableArea, DrivableState, follow
from pipeline.path.estimates import arc
from pipeline.types import EgoState, Moment
from tests.pipeline.path.lines import straight_lane

PARAMS = PathParams()
DT_S = 0.1
SPEED_MPS = 8.0


def at(t_s: float = 0.0, speed_mps: float | None = SPEED_MPS, rate: float = 0.0) -> Moment:
    ego = EgoState(round(t_s * 1e9), speed_mps, rate) if speed_mps is not None else None
    return Moment(round(t_s * 1e9), DT_S, ego, ego)


def bend(radius_m: float, from_m: float = 0.0, left_m: float = 6.0, right_m: float = 2.0, seed: int = 0) -> F64:
    """Edges to the left and right of a way that bends to the left after ``from_m``, seen to 40 m, with 0.1 m of
    noise."""
    s = np.arange(1.0, 40.0, 0.3)
    way, heading = arc(1.0 / radius_m, np.maximum(s - from_m, 0.0))
    way[:, 0] += np.minimum(s, from_m)
    normal = np.column_stack([-np.sin(heading), np.cos(heading)])
    edges = np.concatenate([way + left_m * normal, way - right_m * normal])
    return edges + np.random.default_rng(seed).normal(0.0, 0.1, edges.shape)


def y_at(area: DrivableArea | None, s: int) -> float:
    assert area is not None
    return float(area.path.center[s, 1])


@pytest.mark.parametrize("speed_mps", [SPEED_MPS, 0.5, None], ids=["8 m/s", "walking", "unknown speed"])
def test_the_path_follows_a_bend_that_begins_ahead(speed_mps: float | None) -> None:
    _, area = follow(DrivableState(), bend(60.0, from_m=10.0), at(speed_mps=speed_mps), PARAMS)
    assert y_at(area, 30) == pytest.approx(60.0 * (1.0 - np.cos(20.0 / 60.0)), abs=0.7)
    assert area is not None
    assert area.path.sigma_m[30] < 1.5
    assert (np.diff(area.path.sigma_m) >= -1e-9).all()


def test_a_straight_street_gives_a_straight_path_wherever_in_it_the_car_is() -> None:
    for left_m, right_m in ((6.0, 2.0), (2.0, 6.0), (1.5, 1.5)):
        _, area = follow(DrivableState(), bend(1e6, left_m=left_m, right_m=right_m), at(), PARAMS)
        assert y_at(area, 0) == 0.0
        assert y_at(area, 30) == pytest.approx(0.0, abs=0.3)


def test_one_edge_suffices_but_a_few_metres_do_not() -> None:
    edges = bend(60.0, from_m=10.0)
    _, area = follow(DrivableState(), edges[: len(edges) // 2], at(), PARAMS)
    assert y_at(area, 30) > 1.5
    _, area = follow(DrivableState(), edges[:20], at(), PARAMS)
    assert area is None


def test_between_images_the_path_moves_with_the_car_and_is_dropped_in_the_end() -> None:
    state, first = follow(DrivableState(), bend(60.0, from_m=20.0), at(), PARAMS)
    for n in range(1, 6):
        state, area = follow(state, None, at(n * DT_S), PARAMS)
    assert first is not None
    assert area is not None
    assert y_at(area, 26) == pytest.approx(y_at(first, 30), abs=0.1), "4 m further on"
    assert area.edges[:, 0].min() < -2.0
    assert area.path.sigma_m[26] > first.path.sigma_m[26]
    _, area = follow(state, None, at(0.6), PARAMS)
    assert area is None


def test_without_own_motion_it_is_kept_in_place() -> None:
    state, first = follow(DrivableState(), bend(60.0), at(speed_mps=None), PARAMS)
    _, area = follow(state, None, at(DT_S, None), PARAMS)
    assert y_at(area, 30) == y_at(first, 30)


def test_lane_lines_or_the_switch_leave_it_out() -> None:
    assert follow(DrivableState(), bend(60.0), at(), PARAMS, is_shown=True)[1] is None
    off = with_changes(Params(), {"path.use_drivable": False}).path
    assert follow(DrivableState(), bend(60.0), at(), off)[1] is None


def test_it_takes_its_part_in_the_path_and_is_named() -> None:
    _, area = follow(DrivableState(), bend(60.0, from_m=10.0), at(), PARAMS)
    assert area is not None
    _, without = predict(PathState(), Evidence(), at(), PARAMS)
    _, path = predict(PathState(), Evidence(drivable=area.path), at(), PARAMS)
    place = np.array([[29.6, 3.3]])
    assert abs(offset(path, place)[0]) < 0.8 < abs(offset(without, place)[0])
    assert path.carried_by["30"]["drivable_area"] > 0.7
    assert path.sigma_m["30"] < without.sigma_m["30"]
    _, path = predict(PathState(), Evidence(straight_lane(), drivable=area.path), at(), PARAMS)
    assert "drivable_area" not in path.weights, "lane lines show more"


def test_an_empty_area_says_nothing() -> None:
    state, _ = follow(DrivableState(), bend(60.0), at(), PARAMS)
    state, area = follow(state, np.zeros((0, 2)), at(DT_S), PARAMS)
    assert (state.area, area) == (None, None)


def test_points_are_thinned_by_side_and_metre() -> None:
    edges = np.array([[5.1, 2.0], [5.4, 2.2], [5.6, -2.0], [6.2, 2.0], [-1.0, 2.0], [80.0, 2.0]])
    assert drivable_area._thinned(edges).tolist() == [[5.6, -2.0], [5.25, 2.1], [6.2, 2.0]]
