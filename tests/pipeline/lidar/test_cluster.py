"""The partition is exactly that of a KD-tree, and what it is made of is chosen as said."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pipeline.lidar.cluster import WIDEST_M, candidates, cluster
from pipeline.lidar.ground import Ground
from pipeline.params import ClusterParams
from pipeline.types import F32, I32
from tests.pipeline.lidar.scenes import scan

ALL = {"min_points": 1, "max_points": 50000, "max_range_m": 120.0, "front_only": False, "divide_m": 3.0}


def _kd_tree(points: F32, tolerance_m: float, z_weight: float) -> I32:
    """Components from a KD-tree, numbered by their first point."""
    scaled = points[:, :3].astype(np.float64) * [1.0, 1.0, z_weight]
    pairs = cKDTree(scaled).query_pairs(tolerance_m, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points),) * 2)
    raw = connected_components(graph, directed=False)[1]
    _, first = np.unique(raw, return_index=True)
    rank = np.empty(len(first), np.int32)
    rank[np.argsort(first)] = np.arange(len(first))
    return np.asarray(rank[raw], dtype=np.int32)


def _cluster(points: F32, **changes: float | bool) -> I32:
    return cluster(points, np.ones(len(points), np.bool_), ClusterParams(**{**ALL, **changes}))  # type: ignore[arg-type]


def _points(*xyz: tuple[float, float, float]) -> F32:
    return np.array([(*p, 0.0) for p in xyz], np.float32)


@settings(max_examples=150, deadline=None)
@given(
    arrays(np.float32, st.tuples(st.integers(0, 60), st.just(4)), elements=st.floats(-6, 6, width=32)),
    st.floats(0.1, 3.0),
    st.floats(0.05, 1.0),
)
def test_same_partition_as_a_kd_tree(points: F32, tolerance_m: float, z_weight: float) -> None:
    labels = _cluster(points, tolerance_m=tolerance_m, z_weight=z_weight)
    scaled = points[:, :3].astype(np.float64) * [1.0, 1.0, z_weight]
    distance = np.linalg.norm(scaled[:, None] - scaled, axis=2)
    if np.any(np.abs(distance - tolerance_m) < 1e-9):
        return  # exactly on the tolerance, rounding decides in either
    assert np.array_equal(labels, _kd_tree(points, tolerance_m, z_weight))


@pytest.mark.parametrize("tolerance_m", [0.3, 0.9, 2.0])
def test_same_partition_on_a_sweep_with_a_near_wall(tolerance_m: float) -> None:
    points = scan([(2.5, -30.0, -1.5, 3.0, 30.0, 4.0), (-20.0, 4.0, -1.5, 2.0, 5.0, 1.0)])
    points = points[points[:, 2] > -1.4]
    assert len(points) > 2000
    assert np.array_equal(_cluster(points, tolerance_m=tolerance_m, z_weight=0.4), _kd_tree(points, tolerance_m, 0.4))


def _along(start: tuple[float, float], end: tuple[float, float], step_m: float = 0.1) -> F32:
    """Two rings of points along a line in the plan."""
    count = int(np.hypot(end[0] - start[0], end[1] - start[1]) / step_m) + 1
    x, y = np.linspace(start[0], end[0], count), np.linspace(start[1], end[1], count)
    return np.concatenate([np.stack([x, y, np.full(count, z), np.zeros(count)], axis=1) for z in (0.0, 0.4)]).astype(
        np.float32
    )


def _divided(points: F32, tolerance_m: float, divide_m: float) -> I32:
    """Components at the tolerance; those wider than any vehicle, as components at the smaller one."""
    coarse, fine = _kd_tree(points, tolerance_m, 0.4), _kd_tree(points, min(divide_m, tolerance_m), 0.4)
    turn, range_m = np.arctan2(points[:, 1], points[:, 0]), np.hypot(points[:, 0], points[:, 1])
    for each in range(coarse.max(initial=-1) + 1):
        mine = coarse == each
        if np.ptp(turn[mine]) * range_m[mine].min() > WIDEST_M:
            coarse[mine] = len(points) + fine[mine]
    first, rank = {}, 0
    for label in coarse.tolist():
        if label not in first:
            first[label], rank = rank, rank + 1
    return np.array([first[label] for label in coarse.tolist()], dtype=np.int32)


@pytest.mark.parametrize("front_only", [True, False])
@pytest.mark.parametrize(
    ("tolerance_m", "divide_m"), [(0.9, 0.7), (0.9, 0.45), (0.6, 3.0), (1.8, 0.9), (2.5, 0.1), (3.0, 0.3)]
)
def test_what_is_wider_than_a_vehicle_is_divided_at_smaller_gaps(
    tolerance_m: float, divide_m: float, front_only: bool
) -> None:
    """Against a KD-tree, among 300 short walls on all sides."""
    rng = np.random.default_rng(7)
    start, change = rng.uniform((-40.0, -20.0), (40.0, 20.0), (300, 2)), rng.uniform(-2.0, 2.0, (300, 2))
    points = np.concatenate([_along(tuple(a), tuple(a + d)) for a, d in zip(start, change, strict=True)])
    points = points[(points[:, 0] > 0.0) | (not front_only)]
    found = _cluster(points, tolerance_m=tolerance_m, divide_m=divide_m, z_weight=0.4, front_only=front_only)
    wanted = _divided(points, tolerance_m, divide_m)
    if divide_m < tolerance_m:
        assert wanted.max() > _kd_tree(points, tolerance_m, 0.4).max()
    assert np.array_equal(found, wanted)


def test_two_rings_on_one_car_are_one_object_by_the_weight_on_height() -> None:
    rings = _points((30.0, 0.0, -0.8), (30.0, 0.4, -0.8), (30.0, 0.0, 0.25), (30.0, 0.4, 0.25))
    assert _cluster(rings, tolerance_m=0.7, z_weight=0.4).tolist() == [0, 0, 0, 0]
    assert _cluster(rings, tolerance_m=0.7, z_weight=1.0).tolist() == [0, 0, 1, 1]


def test_neighbours_in_the_next_lane_stay_two() -> None:
    assert _cluster(_points((20.0, 0.0, 0.0), (20.0, 1.2, 0.0)), tolerance_m=0.9).tolist() == [0, 1]


def test_a_lead_and_the_row_parked_beside_it_are_two() -> None:
    """They are 0.8 m apart, less than the tolerance; together they are wider than any vehicle."""
    lead, parked = _along((12.0, -1.0), (12.0, 1.0)), _along((10.5, -1.8), (15.0, -1.8))
    points = np.concatenate([lead, parked])
    assert set(_cluster(points, tolerance_m=0.9)) == {0}
    divided = _cluster(points, tolerance_m=0.9, divide_m=0.45)
    assert set(divided[: len(lead)]) == {0}
    assert set(divided[len(lead) :]) == {1}


@pytest.mark.parametrize(
    "points",
    [
        pytest.param(_along((12.0, -2.4), (12.0, 2.4)), id="broadside: one surface without a gap"),
        pytest.param(_along((12.0, -0.9), (12.0, 0.9), 0.6), id="a sparse rear, no wider than a vehicle"),
        pytest.param(_along((9.0, 2.0), (21.0, 2.0), 0.7), id="a long flank seen along it"),
    ],
)
def test_one_vehicle_stays_whole(points: F32) -> None:
    assert set(_cluster(points, tolerance_m=0.9, divide_m=0.45)) == {0}


def test_numbers_follow_the_first_point_and_small_clusters_take_none() -> None:
    points = _points((9, 0, 0), (5, 0, 0), (20, 0, 0), (5, 0.1, 0), (9, 0.1, 0))
    assert _cluster(points, min_points=2).tolist() == [0, 1, -1, 1, 0]
    crowd = np.tile(points[:1], (101, 1))
    assert _cluster(np.vstack([crowd, points[1:4]]), max_points=100).tolist() == [-1] * 101 + [0, 1, 0]


def test_range_and_side_limit_what_is_clustered() -> None:
    points = _points((30, 0, 0), (50, 40, 0), (-10, 0, 0))
    assert _cluster(points, max_range_m=60.0, front_only=True).tolist() == [0, -1, -1]
    assert _cluster(points, max_range_m=70.0, front_only=False).tolist() == [0, 1, 2]


def test_no_points_no_clusters() -> None:
    assert _cluster(np.zeros((0, 4), np.float32)).tolist() == []


def test_candidates_are_kept_points_between_the_road_and_the_height_limit() -> None:
    points = _points((5, 0, -1.5), (5, 0, -0.5), (5, 0, 1.4), (5, 0, 1.6), (5, 1, -0.5))
    planes = np.array([[0.0, 0.0, 1.0, 1.5]])
    ground = Ground(points[:, 2] < -1.4, planes, np.array([-50.0, 50.0]), np.ones(1, np.bool_))
    keep = np.array([True, True, True, True, False])
    assert candidates(points, ground, keep, ClusterParams(max_height_m=3.0)).tolist() == [
        False,
        True,
        True,
        False,
        False,
    ]
    nowhere = Ground(np.zeros(5, np.bool_), planes * np.nan, ground.edges, ground.fitted)
    assert candidates(points, nowhere, keep, ClusterParams()).tolist() == keep.tolist()
