"""The path by the road's edges: frame by frame, and only where neither paint nor a route shows the road."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.common.fast_replace import evolve
from pipeline.params import PathParams
from pipeline.path import road_edges
from pipeline.path.corridor import Evidence, PathState, predict
from pipeline.path.estimates import PathEstimate, arc, samples
from pipeline.path.road_edges import EdgeState, Surroundings
from pipeline.types import EgoState, Ground, Moment
from pipeline.types.lane import EgoLane
from tests.pipeline.build import fused
from tests.pipeline.path.lines import straight_lane

PARAMS = PathParams(use_edges=True)
EGO = EgoState(0, 8.0, 0.0)
NOW = Moment(0, 0.1, EGO, EGO)
FLAT = Ground(np.zeros(0, np.bool_), np.array([[0.0, 0.0, 1.0, 0.5]]), np.array([-50.0, 50.0]), np.ones(1, np.bool_))


def between_hedges() -> Surroundings:
    """Points a metre apart on two hedges, 4 m to the left and 3 m to the right."""
    x = np.arange(3.0, 40.0, 0.5)
    sides = [np.column_stack([x, np.full_like(x, y), np.full_like(x, 0.5), np.zeros_like(x)]) for y in (4.0, -3.0)]
    points = np.vstack(sides).astype(np.float32)
    return Surroundings(points, np.zeros(len(points), np.int32), np.zeros(len(points), np.uint8), FLAT, (), (), 0.5)


def with_rear_at_20_m() -> Surroundings:
    """The same with eight points on the rear of a vehicle ahead."""
    rear = np.column_stack([np.full(8, 20.1), np.linspace(-0.8, 0.8, 8), np.full(8, 0.5), np.zeros(8)])
    hedges = between_hedges()
    count = len(hedges.points) + 8
    return hedges._replace(
        points=np.vstack([hedges.points, rear]).astype(np.float32),
        kind=np.zeros(count, np.int32),
        ring=np.zeros(count, np.uint8),
    )


def test_the_path_runs_along_what_stands_beside_it_in_every_frame() -> None:
    state = EdgeState()
    for _ in range(5):
        state, edges = road_edges.follow(state, between_hedges(), NOW, PARAMS)
        assert edges is not None
        assert edges.path.center[30] == pytest.approx([30.0, 0.0], abs=0.3)
        assert len(edges.cells) > 100


def test_without_own_motion_or_switched_off_there_are_no_edges() -> None:
    state, _ = road_edges.follow(EdgeState(), between_hedges(), NOW, PARAMS)
    assert road_edges.follow(state, between_hedges(), Moment(0, 0.1, None, None), PARAMS)[1] is None
    off = PARAMS.model_copy(update={"use_edges": False})
    assert road_edges.follow(state, between_hedges(), NOW, off)[1] is None


def test_where_paint_shows_the_road_its_edges_are_only_collected() -> None:
    state = EdgeState()
    for _ in range(3):
        state, edges = road_edges.follow(state, between_hedges(), NOW, PARAMS, is_shown=True)
        assert edges is None
        assert state.shape is None
    assert len(state.cells.xy) > 100, "for when the paint ends"


@pytest.mark.parametrize(("lane", "shown"), [(straight_lane(), True), (None, False)])
def test_the_path_tells_whether_paint_shows_the_road(lane: EgoLane | None, shown: bool) -> None:
    state, _ = predict(PathState(), Evidence(lane=lane), NOW, PARAMS)
    assert state.is_shown is shown


def test_with_nothing_beside_the_road_there_are_no_edges() -> None:
    bare = between_hedges()._replace(points=np.zeros((0, 4), np.float32), kind=np.zeros(0, np.int32), ring=None)
    assert road_edges.follow(EdgeState(), bare, NOW, PARAMS)[1] is None


def test_paint_outweighs_edges_that_go_another_way() -> None:
    s = samples(PARAMS.length_m)
    edges = PathEstimate("edges", arc(0.02, s)[0], np.full(len(s), 0.3))
    _, alone = predict(PathState(), Evidence(edges=edges), NOW, PARAMS)
    assert alone.source == "edges"
    assert alone.center[30, 1] > 5.0
    _, painted = predict(PathState(), Evidence(lane=straight_lane(), edges=edges), NOW, PARAMS)
    assert "edges" not in painted.weights
    assert abs(painted.center[30, 1]) < 0.2


def test_edges_have_a_say_where_paint_ends_early() -> None:
    s = samples(PARAMS.length_m)
    edges = PathEstimate("edges", arc(0.002, s)[0], np.full(len(s), 0.3))
    vague = straight_lane(sigma_m=3.0)
    _, path = predict(PathState(), Evidence(lane=vague, edges=edges), NOW, PARAMS)
    assert path.carried_by["30"]["edges"] > 0.5


def test_a_standing_car_keeps_the_road_that_it_saw() -> None:
    """Cross traffic stops on both sides of the lane and hides the hedges."""
    state, edges = EdgeState(), None
    for _ in range(3):
        state, edges = road_edges.follow(state, between_hedges(), NOW, PARAMS)
    stands = EgoState(0, 0.0, 0.0)
    row = np.column_stack([np.full(60, 12.0), np.linspace(-15, 15, 60), np.full(60, 0.5), np.zeros(60)])
    crossing = between_hedges()._replace(
        points=row.astype(np.float32), kind=np.zeros(60, np.int32), ring=np.zeros(60, np.uint8)
    )
    for _ in range(30):
        state, now = road_edges.follow(state, crossing, Moment(0, 0.1, stands, stands), PARAMS)
    assert edges is not None
    assert now is not None
    np.testing.assert_array_equal(now.path.center, edges.path.center)


@pytest.mark.parametrize(("label", "is_left"), [("car", 0), (None, 8)])
def test_a_lead_that_has_stopped_is_no_roadside(label: str | None, is_left: int) -> None:
    """Provided that the camera saw it drive too; a hedge seems to drive while more of it comes into view."""
    stopped = fused(3, 20.0, 0.0, source="VL" if label else "L", label=label)
    drove = evolve(stopped, surely_moving=True, speed_over_ground_mps=8.0)
    seen = with_rear_at_20_m()
    state = EdgeState()
    for item in (drove,) * 6 + (stopped,) * 3:
        state, _ = road_edges.follow(state, seen._replace(objects=(item,)), NOW, PARAMS)
    in_lane = np.abs(state.cells.xy - (20.1, 0.0)).max(axis=1) < 1.2
    assert in_lane.sum() <= is_left
    assert bool(in_lane.any()) is bool(is_left)


@pytest.mark.parametrize(("frames", "is_left"), [(4, False), (12, True)], ids=["just now", "for long"])
def test_a_lead_that_the_lidar_takes_over_is_no_roadside(frames: int, is_left: bool) -> None:
    """The LiDAR takes half a second to know that what the camera saw drive does."""
    by_camera = evolve(fused(3, 20.0, source="V"), surely_moving=True, speed_over_ground_mps=8.0)
    by_both = evolve(fused(3, 20.0), surely_moving=False, speed_over_ground_mps=8.0)
    seen = with_rear_at_20_m()
    state = EdgeState()
    for item in (by_camera,) * 6 + (by_both,) * frames:
        state, _ = road_edges.follow(state, seen._replace(objects=(item,)), NOW, PARAMS)
    assert bool((np.abs(state.cells.xy - (20.1, 0.0)).max(axis=1) < 1.2).any()) is is_left


@pytest.mark.parametrize(
    ("label", "oncoming", "is_left"),
    [("bus", True, False), ("bus", False, True), (None, True, True)],
    ids=["comes", "may stand", "a hedge may seem to come"],
)
def test_what_comes_towards_the_car_is_no_roadside(label: str | None, oncoming: bool, is_left: bool) -> None:
    """Long before it is certain that it moves."""
    item = fused(3, 20.0, 2.0, source="VL" if label else "L", label=label)
    item = evolve(item, oncoming=oncoming, surely_moving=False, speed_over_ground_mps=8.0)
    front = np.column_stack([np.full(8, 20.1), np.linspace(1.2, 2.8, 8), np.full(8, 0.5), np.zeros(8)])
    hedges = between_hedges()
    seen = hedges._replace(
        points=np.vstack([hedges.points, front]).astype(np.float32),
        kind=np.zeros(len(hedges.points) + 8, np.int32),
        ring=np.zeros(len(hedges.points) + 8, np.uint8),
        objects=(item,),
    )
    state, _ = road_edges.follow(EdgeState(), seen, NOW, PARAMS)
    assert bool((np.abs(state.cells.xy - (20.1, 2.0)).max(axis=1) < 1.2).any()) is is_left
