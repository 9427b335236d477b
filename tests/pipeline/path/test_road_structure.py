"""What stands beside the road: kerbs in the rings, cells of earlier sweeps, and without what drives."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.path import road_structure
from pipeline.path.road_structure import Cells
from pipeline.simulation.sensors.lidar.sensor import Lidar
from pipeline.types import F64, GROUND, EgoState, Ground, Sweep

HEIGHT_M, KERB_M, KERB_HIGH_M = 0.5, 3.0, 0.12
FLAT = Ground(
    np.zeros(0, np.bool_), np.array([[0.0, 0.0, 1.0, HEIGHT_M]]), np.array([-50.0, 50.0]), np.ones(1, np.bool_)
)


def swept(boxes: F64, tilt: float = 0.0) -> Sweep:
    return Lidar().sweep_of(boxes, np.array([-HEIGHT_M, 0.0, tilt, 0.0]), np.random.default_rng(0), 0)


def box(x: float, y: float, length: float, width: float, high: float) -> list[float]:
    return [x, y, high / 2 - HEIGHT_M, length / 2, width / 2, high / 2, 1.0, 0.0, 6.0, 0.0, 0.0, 0.0, 1.0]


def cells_of(sweep: Sweep) -> Cells:
    kind = np.where(FLAT.above(sweep.points) < 0.25, GROUND, 0).astype(np.int32)
    return road_structure.seen(sweep.points, kind, sweep.ring, FLAT, (), HEIGHT_M)


def test_a_kerb_is_seen_along_its_line() -> None:
    pavement = np.array([box(20.0, -KERB_M - 1.0, 60.0, 2.0, KERB_HIGH_M)])
    xy = cells_of(swept(pavement)).xy
    along = xy[(xy[:, 0] > 3.0) & (xy[:, 0] < 10.0)]
    assert len(along) > 10
    assert np.median(along[:, 1]) == pytest.approx(-KERB_M, abs=0.15)


def test_the_fall_of_a_road_to_its_side_is_no_kerb() -> None:
    assert len(cells_of(swept(np.zeros((0, 13)), tilt=0.025)).xy) == 0


def test_what_stands_counts_and_walls_block_more_than_cars() -> None:
    wall = swept(np.array([box(15.0, 5.0, 20.0, 0.4, 1.5)]))
    kind = np.where(FLAT.above(wall.points) < 0.25, GROUND, 7).astype(np.int32)
    as_car = road_structure.seen(wall.points, kind, wall.ring, FLAT, (), HEIGHT_M)
    as_wall = road_structure.seen(wall.points, kind, wall.ring, FLAT, (7,), HEIGHT_M)
    assert len(as_car.xy) == len(as_wall.xy) > 20
    assert as_wall.blocks.max() > as_car.blocks.max()


def test_cells_move_with_the_car_and_are_forgotten() -> None:
    cells = Cells(np.array([[10.0, 2.0], [-7.5, 0.0]]), np.ones(2), np.zeros(2), np.ones(2, np.bool_), np.zeros(2))
    moved = road_structure.moved(cells, EgoState(0, 10.0, 0.0), 0.1)
    assert moved.xy == pytest.approx(np.array([[9.0, 2.0]])), "the other is too far behind"
    assert len(road_structure.moved(cells, EgoState(0, 0.0, 0.0), 3.0).xy) == 0


def test_one_cell_of_the_grid_is_one_vote() -> None:
    before = Cells(
        np.array([[10.1, 2.1], [20.0, 2.0]]), np.ones(2), np.array([0.5, 0.5]), np.ones(2, np.bool_), np.zeros(2)
    )
    fresh = Cells(np.array([[10.2, 2.2], [10.3, 2.3]]), np.ones(2), np.zeros(2), np.ones(2, np.bool_), np.zeros(2))
    merged = road_structure.merged(before, fresh)
    assert sorted(merged.age_s.tolist()) == [0.0, 0.5]


def grid(x: tuple[float, float], y: tuple[float, float]) -> Cells:
    """A cell in every square of the grid in a rectangle."""
    xy = np.stack(np.meshgrid(np.arange(*x, 0.5), np.arange(*y, 0.5)), axis=-1).reshape(-1, 2) + 0.25
    count = len(xy)
    return Cells(xy, np.ones(count), np.zeros(count), np.ones(count, np.bool_), np.zeros(count))


@pytest.mark.parametrize(
    ("x", "y", "kept"),
    [
        pytest.param((10.0, 30.0), (4.0, 4.5), 40, id="all of a wall"),
        pytest.param((10.0, 30.0), (4.0, 5.0), 40, id="half of a hedge that is two cells thick"),
        pytest.param((10.0, 13.0), (4.0, 7.0), 8, id="eight of the 36 cells of a bush"),
        pytest.param((10.0, 10.5), (4.0, 4.5), 1, id="a post"),
    ],
)
def test_what_stands_counts_by_its_length(x: tuple[float, float], y: tuple[float, float], kept: int) -> None:
    found = road_structure.thinned(grid(x, y))
    assert len(found.xy) == kept
    assert np.ptp(found.xy[:, 0]) >= 0.7 * (x[1] - x[0] - 0.5), "evenly over its length"


def test_objects_are_thinned_apart_from_each_other() -> None:
    bush, post = grid((10.0, 13.0), (4.0, 7.0)), grid((20.0, 20.5), (-5.0, -4.5))
    both = Cells(*(np.concatenate(pair) for pair in zip(bush, post, strict=True)))
    found = road_structure.thinned(both)
    assert [int((found.xy[:, 0] < 15.0).sum()), int((found.xy[:, 0] > 15.0).sum())] == [8, 1]
    assert len(road_structure.thinned(road_structure.NONE).xy) == 0
