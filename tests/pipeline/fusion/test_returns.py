"""Single LiDAR returns as the range of a far vehicle: what is taken for one, and what is not."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from pipeline.alignment.projection import Alignment, resolve
from pipeline.fusion.returns import SIGMA_M, range_boxes
from pipeline.params import AlignmentParams, FusionParams
from pipeline.types import F32, I32, CameraCalibration, Detection, Ground, Point3, VisionMeasurement

AT_M = 50.0
BOX = (980.0, 270.0, 1044.0, 330.0)
"""Box of a car 50 m ahead: 1.8 m wide, 1.7 m high, its wheels 0.8 m below the camera."""


def aligned() -> Alignment:
    K = np.array([[1800.0, 0.0, 1012.0], [0.0, 1800.0, 300.0], [0.0, 0.0, 1.0]])
    T_camera_ego = np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]], dtype=np.float64)
    found = resolve(AlignmentParams(), CameraCalibration(K, np.zeros(5), T_camera_ego, 2048, 618))
    assert found is not None
    return found


ROAD = Ground(np.zeros(0, bool), np.array([[0.0, 0.0, 1.0, 0.8]]), np.array([0.0, 100.0]), np.ones(1, bool))
"""Flat, 0.8 m under the sensor."""


@dataclass
class Sweep:
    points: F32
    kind: I32
    ground: Ground | None = field(default_factory=lambda: ROAD)
    origin: Point3 = (0.0, 0.0, 0.0)


@dataclass
class Scene:
    """Points, each (x, y, z, kind)."""

    rows: list[tuple[float, float, float, int]] = field(default_factory=list)

    def sweep(self) -> Sweep:
        table = np.array(self.rows, dtype=np.float64).reshape(-1, 4)
        points = np.column_stack([table[:, :3], np.full(len(table), 50.0)]).astype(np.float32)
        return Sweep(points, table[:, 3].astype(np.int32))


def box(label: str = "car", distance_m: float = AT_M) -> VisionMeasurement:
    return VisionMeasurement(Detection(BOX, label, 0.8), distance_m, 0.2 * distance_m, (distance_m, 0.0), 0.05, 0.2)


LOOSE, GROUND, CLUSTER = -2, -1, 3
ON_IT = (46.0, 0.2, 0.0, LOOSE)


@pytest.mark.parametrize(
    ("case", "rows", "expected_m"),
    [
        ("one return", [ON_IT], 46.0),
        ("two of one range, and the road under it", [ON_IT, (46.2, -0.3, 0.0, LOOSE), (46.0, 0.0, -0.8, GROUND)], 46.0),
        ("nothing", [], None),
        ("the road", [(46.0, 0.0, -0.7, LOOSE)], None),
        ("a bridge", [(46.0, 0.0, 3.0, LOOSE)], None),
        ("what is seen over its roof", [(54.0, 0.2, 0.7, LOOSE)], None),
        ("its roof", [(46.0, 0.2, 0.6, LOOSE)], 46.0),
        ("below its roof", [(54.0, 0.2, 0.5, LOOSE)], 54.0),
        ("beside the box", [(46.0, 1.5, 0.0, LOOSE)], None),
        ("far nearer than any vehicle of that height", [(25.0, 0.1, 0.0, LOOSE)], None),
        ("a post in front of it, so near that a car would have a cluster", [(29.5, 0.1, 0.0, LOOSE)], None),
        ("far beyond it", [(95.0, 0.1, 0.0, LOOSE)], None),
        ("a cluster's point", [(46.0, 0.2, 0.0, CLUSTER)], None),
        ("a wall that goes on to both sides", [ON_IT, (46.0, 1.2, 0.0, LOOSE), (46.0, -1.2, 0.0, LOOSE)], None),
        ("a rail that ends behind it", [ON_IT, (46.0, 1.2, 0.0, LOOSE)], 46.0),
        ("another car at another range beside it", [ON_IT, (70.0, 1.7, 0.0, LOOSE), (30.0, -0.8, 0.0, LOOSE)], 46.0),
        ("two things fit as well", [(46.0, 0.2, 0.0, LOOSE), (54.0, -0.2, 0.0, LOOSE)], None),
    ],
)
def test_which_returns_are_a_vehicles(
    case: str, rows: list[tuple[float, float, float, int]], expected_m: float | None
) -> None:
    (found,) = range_boxes((box(),), Scene(rows).sweep(), aligned(), FusionParams()) or ()
    assert (found.ranged_m and round(found.ranged_m, 1)) == expected_m, case
    assert found.distance_m == AT_M, "the law's own distance stays what it was"
    assert (found.returns > 0) == (expected_m is not None)
    assert expected_m is None or found.ranged_sigma_m == SIGMA_M


def test_how_much_of_a_box_is_seen_over_the_roof_is_a_parameter() -> None:
    sweep = Scene([(54.0, 0.2, 0.7, LOOSE)]).sweep()
    ranged = [
        range_boxes((box(),), sweep, aligned(), FusionParams(roof_share=share))[0].ranged_m  # type: ignore[index]
        for share in (0.12, 0.0)
    ]
    assert ranged == [None, pytest.approx(54.0, abs=0.1)]


@pytest.mark.parametrize(
    ("case", "other", "at_m", "expected_m"),
    [
        ("a nearer vehicle covers the point", (900.0, 220.0, 1010.0, 370.0), 35.0, None),
        ("a nearer vehicle at an unknown distance", (900.0, 220.0, 1010.0, 370.0), None, None),
        ("a nearer vehicle covers only the other side", (900.0, 220.0, 990.0, 370.0), 35.0, 46.0),
        ("a nearer one ends just beside the point", (890.0, 220.0, 1002.0, 370.0), 35.0, None),
        ("it is seen through the windows of a much nearer one", (900.0, 220.0, 1010.0, 370.0), 15.0, 46.0),
        ("one behind it", (985.0, 240.0, 1039.0, 320.0), 55.0, 46.0),
        ("another box of the same vehicle", (978.0, 268.0, 1046.0, 334.0), 48.0, 46.0),
    ],
)
def test_a_point_inside_a_nearer_box_is_that_vehicles(
    case: str, other: tuple[float, float, float, float], at_m: float | None, expected_m: float | None
) -> None:
    place = (at_m, 0.0) if at_m is not None else None
    covering = VisionMeasurement(Detection(other, "car", 0.8), at_m, at_m and 0.2 * at_m, place, 0.05, 0.2)
    found, _ = range_boxes((box(), covering), Scene([ON_IT]).sweep(), aligned(), FusionParams()) or ()
    assert (found.ranged_m and round(found.ranged_m, 1)) == expected_m, case


def test_who_is_not_asked() -> None:
    seen = (box("person"), box(distance_m=15.0))
    sweep = Scene([ON_IT, (15.0, 0.1, 0.0, LOOSE)]).sweep()
    assert range_boxes(seen, sweep, aligned(), FusionParams()) == seen
    assert range_boxes((box(),), sweep, aligned(), FusionParams(single_returns=False)) == (box(),)
    assert range_boxes((box(),), sweep, None, FusionParams()) == (box(),)
    assert range_boxes(None, sweep, aligned(), FusionParams()) is None


def row(z: float, ys: list[float], x: float = 46.0) -> list[tuple[float, float, float, int]]:
    return [(x, y, z, GROUND) for y in ys]


REAR = [0.2 * n for n in range(-4, 5)]


@pytest.mark.parametrize(
    ("case", "rows", "expected_m"),
    [
        ("a rear beyond a crest", row(-0.4, REAR), 46.0),
        ("the road under the vehicle", row(-0.8, REAR), None),
        ("the road, which goes on to the left", row(-0.4, [*REAR, 1.8, 2.0]), None),
        ("the road, which goes on to the right", row(-0.4, [*REAR, -1.8, -2.0]), None),
        ("a calibration off by half a degree", row(-0.4, [y + 0.4 for y in REAR]), 46.0),
        ("a car in the next lane at another range", [*row(-0.4, REAR), *row(-0.4, [2.0, 2.2], x=40.0)], 46.0),
        ("narrower than half of the box", row(-0.4, [0.0, 0.2, 0.4]), None),
        ("two points", row(-0.4, [-0.8, 0.8]), None),
        ("a sixth farther than the camera says: the road behind", row(-0.4, [1.2 * y for y in REAR], x=58.0), None),
        ("half as far again as the camera says", row(-0.4, [1.6 * y for y in REAR], x=75.0), None),
        ("returns above the road count first", [ON_IT, *row(-0.4, REAR, x=52.0)], 46.0),
    ],
)
def test_which_rows_of_road_are_a_vehicles(
    case: str, rows: list[tuple[float, float, float, int]], expected_m: float | None
) -> None:
    (found,) = range_boxes((box(),), Scene(rows).sweep(), aligned(), FusionParams()) or ()
    assert (found.ranged_m and round(found.ranged_m, 1)) == expected_m, case
