"""Where sweeps and images have borders."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.calibration.depth_edges import depth_edges, scene_of, upright_edges
from pipeline.types import Sweep


def ring(ranges_m: list[float], step_deg: float = 0.4) -> Sweep:
    """Returns of one ring ahead, from right to left; a range of 0 is lost."""
    azimuth = np.radians(step_deg) * (np.arange(len(ranges_m)) - len(ranges_m) / 2)
    kept = np.array(ranges_m) > 0
    r, a = np.array(ranges_m)[kept], azimuth[kept]
    points = np.column_stack([r * np.cos(a), r * np.sin(a), np.zeros(len(r)), np.zeros(len(r))]).astype(np.float32)
    return Sweep(0, points, np.zeros(len(points), np.uint8), 16)


@pytest.mark.parametrize(
    ("name", "ranges_m", "expected_m"),
    [
        ("a wall", [20.0] * 20, []),
        ("a slanted wall", [20.0 + 0.2 * n for n in range(20)], []),
        ("a car before a wall", [30.0] * 6 + [10.0] * 6 + [30.0] * 6, [10.0, 10.0]),
        ("a car before the sky", [0.0] * 6 + [10.0] * 6 + [0.0] * 6, []),
        ("two cars with sky between", [10.0] * 6 + [0.0] * 6 + [12.0] * 6, [10.0, 12.0]),
        ("too near", [1.0] * 6 + [30.0] * 6, []),
        ("too far", [60.0] * 6 + [90.0] * 6, []),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_borders_in_a_sweep(name: str, ranges_m: list[float], expected_m: list[float]):
    edges = depth_edges(ring(ranges_m))
    assert sorted(np.hypot(edges[:, 0], edges[:, 1]).round(3)) == pytest.approx(expected_m)


def test_an_upright_edge_is_felt_to_its_sides_and_fades():
    bgr = np.full((40, 400, 3), 60, np.uint8)
    bgr[:, 200:] = 180
    row = upright_edges(bgr)[20].astype(int)
    assert row[200] > 100
    assert np.all(np.diff(row[201:260]) <= 0)
    assert row[200 + 14] < row[200] / 2
    assert row[300] == 0


def test_a_lying_edge_is_none_along_a_ring():
    bgr = np.full((40, 400, 3), 60, np.uint8)
    bgr[20:] = 180
    assert not upright_edges(bgr).any()


def test_in_a_busy_place_an_edge_counts_less():
    bgr = np.full((64, 800, 3), 60, np.uint8)
    bgr[:, 200:400] = 180  # one bar alone, then a fence
    for column in range(500, 700, 16):
        bgr[:, column : column + 8] = 180
    strength = upright_edges(bgr)
    assert strength[32, 600:640].max() < 0.7 * strength[32, 198:203].max()


def test_a_scene_knows_what_is_usual_in_each_row():
    bgr = np.zeros((30, 90, 3), np.uint8)
    bgr[15:, 45:] = 200
    scene = scene_of(np.zeros((0, 3)), bgr)
    assert scene.usual == pytest.approx(scene.strength.mean(axis=1))
    assert scene.usual[25] > scene.usual[2] == 0
