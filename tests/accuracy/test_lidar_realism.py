"""The simulated VLP-16 against real sweeps of the same cars, with a table and a picture in build/."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.evaluation.lidar_picture import draw
from pipeline.evaluation.lidar_realism import BIN_M, CarSeen, Pair, cars_seen, ground_plane, pairs
from tests.conftest import ROOT

ON_THE_ROAD_M = 8.0
"""Parked cars farther to the side stand behind a hedge that nobody labelled."""
PICTURED = "000417"


@pytest.fixture(scope="module")
def twins(data_dir: Path) -> list[Pair]:
    return list(pairs(data_dir / "astyx"))


@pytest.fixture(scope="module")
def cars(twins: list[Pair]) -> list[CarSeen]:
    seen = [car for pair in twins for car in cars_seen(pair) if abs(car.left_m) < ON_THE_ROAD_M]
    assert len(seen) > 80
    return seen


def within(cars: list[CarSeen], low_m: float) -> list[CarSeen]:
    return [car for car in cars if low_m <= car.distance_m < low_m + BIN_M]


@pytest.mark.parametrize("low_m", [0.0, 10.0, 20.0, 30.0])
def test_points_and_rings_on_cars_agree_within_their_spread(cars: list[CarSeen], low_m: float) -> None:
    """The simulated median lies where eight of ten real cars do, and is no more than 1.6 times off."""
    near = within(cars, low_m)
    for what in ("points", "rings"):
        real, simulated = (
            np.array([getattr(car, f"{whose}_{what}") for car in near]) for whose in ("real", "simulated")
        )
        lowest, highest = np.percentile(real, [10, 90])
        # a sweep closer than 10 m has only three cars: their spread is no spread
        slack = 0.35 * np.median(real) if low_m == 0.0 else 0.0
        assert lowest - slack <= np.median(simulated) <= highest + slack, what
        assert (np.median(simulated) + 1) / (np.median(real) + 1) == pytest.approx(1.0, abs=0.6), what


@pytest.mark.parametrize("low_m", [40.0, 50.0, 60.0])
def test_far_away_the_simulated_sensor_is_not_the_better_one(cars: list[CarSeen], low_m: float) -> None:
    """Beyond 40 m real cars keep a few points on one ring, simulated ones hardly any."""
    near = within(cars, low_m)
    assert np.median([car.simulated_points for car in near]) <= np.median([car.real_points for car in near])
    assert np.median([car.simulated_rings for car in near]) <= 1


def test_cars_fade_together(cars: list[CarSeen]) -> None:
    """The share of cars with five points or more."""
    for low_m, off in ((10.0, 0.1), (20.0, 0.15), (30.0, 0.2), (40.0, 0.25)):
        near = within(cars, low_m)
        real, simulated = (
            np.mean([getattr(car, f"{whose}_points") >= 5 for car in near]) for whose in ("real", "simulated")
        )
        assert simulated == pytest.approx(real, abs=off), f"{low_m:g} m"


def test_the_road_is_seen_as_far(twins: list[Pair]) -> None:
    """Returns of the seven lowest rings within 15° ahead; nothing labelled hides the lowest."""
    for ring in range(7):
        real, simulated = (np.mean([_ahead(pair, whose, ring) for pair in twins]) for whose in ("real", "simulated"))
        assert simulated == pytest.approx(real, rel=0.1)


def _ahead(pair: Pair, whose: str, ring: int) -> int:
    sweep = pair.real if whose == "real" else pair.simulated
    x, y = sweep.points[sweep.ring == ring, :2].T
    return int(np.count_nonzero((x > 0) & (np.abs(y) < x * np.tan(np.radians(15.0)))))


def test_the_ground_plane_is_found(twins: list[Pair]) -> None:
    """The Astyx ego frame looks down by about 3°, 1.6 m above the road."""
    planes = np.array([ground_plane(pair.real) for pair in twins])
    assert np.median(planes, axis=0) == pytest.approx([-1.59, 0.053, -0.08], abs=0.04)
    assert planes[:, 0].std() < 0.1


def test_table_and_picture_are_written(twins: list[Pair], cars: list[CarSeen]) -> None:
    lines = [
        "| distance | cars | points, real | points, simulated | rings, real | rings, simulated |",
        "|---|---|---|---|---|---|",
    ]
    for low_m in np.arange(0.0, 80.0, BIN_M):
        near = within(cars, float(low_m))
        if near:
            cells = [
                _quartiles(near, f"{whose}_{what}") for what in ("points", "rings") for whose in ("real", "simulated")
            ]
            lines.append(f"| {low_m:g}–{low_m + BIN_M:g} m | {len(near)} | {' | '.join(cells)} |")
    build = ROOT / "build"
    build.mkdir(exist_ok=True)
    (build / "lidar_realism.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    picture = draw(next(pair for pair in twins if pair.name == PICTURED), cars)
    assert picture.shape == (1200, 1280, 3)
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 5, "not empty"
    assert cv2.imwrite(str(build / "lidar_real_and_simulated.png"), picture)
    print("\n" + "\n".join(lines))


def _quartiles(cars: list[CarSeen], what: str) -> str:
    low, middle, high = np.percentile([getattr(car, what) for car in cars], [25, 50, 75])
    return f"{middle:g} ({low:g}–{high:g})"
