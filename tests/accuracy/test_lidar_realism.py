"""The simulated VLP-16 against real sweeps of the same cars, with a table and an image in build/."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.accuracy.lidar_image import draw
from tests.accuracy.lidar_realism import BIN_M, CarSeen, Pair, cars_seen, ground_plane, pairs
from tests.conftest import ROOT

ON_THE_ROAD_M = 8.0
"""Parked cars farther to the side stand behind an unlabelled hedge."""
SHOWN = "000417"


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


def medians(cars: list[CarSeen], what: str) -> tuple[float, float]:
    """Of the real and of the simulated cars."""
    real, simulated = (float(np.median([getattr(car, f"{w}_{what}") for car in cars])) for w in ("real", "simulated"))
    return real, simulated


def agree(cars: list[CarSeen], what: str) -> bool:
    """Whether the simulated median lies between the real quartiles."""
    lowest, highest = np.percentile([getattr(car, f"real_{what}") for car in cars], [25, 75])
    return bool(lowest <= medians(cars, what)[1] <= highest)


@pytest.mark.parametrize("low_m", [10.0, 20.0, 30.0])
@pytest.mark.parametrize("what", ["points", "rings"])
def test_from_10_to_40_m_points_and_rings_on_cars_agree_within_their_spread(
    cars: list[CarSeen], what: str, low_m: float
) -> None:
    """The simulated median lies between the real quartiles, and is no more than 1.6 times off."""
    near = within(cars, low_m)
    assert agree(near, what)
    real, simulated = medians(near, what)
    assert (simulated + 1) / (real + 1) == pytest.approx(1.0, abs=0.6)


def test_nearer_than_10_m_a_simulated_car_has_a_sixth_more_points(cars: list[CarSeen]) -> None:
    """Three sightings of one car, on the same number of rings."""
    near = within(cars, 0.0)
    real, simulated = medians(near, "points")
    assert 1.0 < simulated / real < 1.25
    assert medians(near, "rings")[0] == medians(near, "rings")[1]


@pytest.mark.parametrize(("low_m", "at_most"), [(40.0, 2.0), (50.0, 9.0), (60.0, 5.0)])
def test_beyond_40_m_a_simulated_car_lacks_the_last_points(cars: list[CarSeen], low_m: float, at_most: float) -> None:
    """Real cars keep a few points on one ring, simulated ones none: the simulated sensor is the worse one there."""
    near = within(cars, low_m)
    real, simulated = medians(near, "points")
    assert not agree(near, "points")
    assert 0.0 < real - simulated <= at_most
    assert medians(near, "rings")[1] <= 1


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


def test_table_and_image_are_written(twins: list[Pair], cars: list[CarSeen]) -> None:
    lines = [
        "Medians and quartiles. They agree where the simulated median lies between the real quartiles.",
        "",
        "| distance | cars | points, real | points, simulated | rings, real | rings, simulated | agree |",
        "|---|---|---|---|---|---|---|",
    ]
    for low_m in np.arange(0.0, 80.0, BIN_M):
        near = within(cars, float(low_m))
        if near:
            cells = [
                _quartiles(near, f"{whose}_{what}") for what in ("points", "rings") for whose in ("real", "simulated")
            ]
            agreeing = [what for what in ("points", "rings") if agree(near, what)]
            cells.append(" and ".join(agreeing) or "no")
            lines.append(f"| {low_m:g}–{low_m + BIN_M:g} m | {len(near)} | {' | '.join(cells)} |")
    build = ROOT / "build"
    build.mkdir(exist_ok=True)
    (build / "lidar_realism.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    image = draw(next(pair for pair in twins if pair.name == SHOWN), cars)
    assert image.shape == (1200, 1280, 3)
    assert len(np.unique(image.reshape(-1, 3), axis=0)) > 5, "not empty"
    assert cv2.imwrite(str(build / "lidar_real_and_simulated.png"), image)
    print("\n" + "\n".join(lines))


def _quartiles(cars: list[CarSeen], what: str) -> str:
    low, middle, high = np.percentile([getattr(car, what) for car in cars], [25, 50, 75])
    return f"{middle:g} ({low:g}–{high:g})"
