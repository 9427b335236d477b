"""The alignment score falls when LiDAR and pictures are moved apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.alignment import resolve
from pipeline.calibration.edges import FEWEST, EdgeScene, EdgeScore, depth_edges, edge_distances, edge_scene, edge_score
from pipeline.params import Params, with_changes
from pipeline.sources import open_source
from pipeline.types import CameraCalibration, Sweep

Looked = list[tuple[EdgeScene, CameraCalibration | None]]


def looked_at(uri: str, frames: list[int]) -> Looked:
    source = open_source(uri)
    found: Looked = []
    for index in frames:
        frame = source.frame(index)
        assert frame.sweep is not None
        assert frame.picture is not None
        found.append((edge_scene(frame.sweep, frame.picture.bgr), frame.camera))
    return found


def score(scenes: Looked, **corrections: float) -> EdgeScore:
    params = with_changes(Params(), {f"alignment.{name}": value for name, value in corrections.items()}).alignment
    resolved = [(scene, resolve(params, camera)) for scene, camera in scenes]
    return edge_score((scene, aligned) for scene, aligned in resolved if aligned is not None)


@pytest.fixture(scope="module")
def kitti(data_dir: Path) -> Looked:
    return looked_at(f"kitti:{data_dir / 'kitti_0052'}", [0, 7, 14, 21])


@pytest.fixture(scope="module")
def astyx(data_dir: Path) -> Looked:
    return looked_at(f"astyx:{data_dir / 'astyx'}", list(range(0, 39, 4)))


@pytest.mark.parametrize("name", ["yaw_deg", "pitch_deg"])
@pytest.mark.parametrize("off_deg", [-2.0, 2.0])
def test_a_real_mount_scores_better_than_a_turned_one(kitti: Looked, name: str, off_deg: float):
    right, turned = score(kitti), score(kitti, **{name: off_deg})
    assert right.score is not None
    assert turned.score is not None
    assert right.score > turned.score + 0.05
    assert right.median_px is not None
    assert turned.median_px is not None
    assert right.median_px < turned.median_px


@pytest.mark.parametrize("off_deg", [2.0, 4.0])
def test_a_real_vlp16_tells_a_turned_mount_too(astyx: Looked, off_deg: float):
    right, turned = score(astyx), score(astyx, yaw_deg=off_deg)
    assert right.score is not None
    assert turned.score is not None
    assert right.score > turned.score


def test_a_picture_of_something_else_scores_next_to_nothing(kitti: Looked):
    """A patchwork has edges everywhere, and what lies on one lies there by chance."""
    height, width = kitti[0][0].away_px.shape
    patches = np.random.default_rng(0).integers(0, 255, (height // 32 + 1, width // 32 + 1, 3)).astype(np.uint8)
    away = edge_distances(np.ascontiguousarray(patches.repeat(32, axis=0).repeat(32, axis=1)[:height, :width]))
    found, right = score([(EdgeScene(scene.points, away), camera) for scene, camera in kitti]), score(kitti)
    assert found.score is not None
    assert right.score is not None
    assert found.score < 0.3 * right.score


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


def test_too_few_borders_say_nothing(kitti: Looked):
    few = [(EdgeScene(scene.points[:2], scene.away_px), camera) for scene, camera in kitti]
    found = score(few)
    assert (found.score, found.median_px) == (None, None)
    assert found.pairs < FEWEST
    assert edge_score([]) == EdgeScore(None, None, 0)
