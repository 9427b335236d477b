"""Arrows of regions point to where the points belong; regions without evidence show none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.alignment.projection import resolve
from pipeline.calibration.depth_edges import EdgeScene, upright_edges
from pipeline.calibration.edge_match import Seen
from pipeline.calibration.local_match import BANDS_M, COLUMNS, FEWEST, NO_MATCH, ROWS, Region, local_match
from pipeline.params import AlignmentParams
from tests.pipeline.calibration.alignment.made_drive import CAMERA, SIZE
from tests.pipeline.calibration.test_edge_match import looked_at

PX_PER_DEG = CAMERA.K[0, 0] * np.pi / 180.0


def poles(seed: int, borders: int = 400) -> Seen:
    """A frame full of posts: each is a bright bar in the image, with depth edges at its sides."""
    rng = np.random.default_rng(seed)
    range_m, bearing = rng.uniform(5.0, 45.0, borders // 5), np.radians(rng.uniform(-35.0, 35.0, borders // 5))
    x, y = range_m * np.cos(bearing), range_m * np.sin(bearing)
    low = rng.uniform(-4.0, 8.0, len(x))
    points = np.array([(x[k], y[k], low[k] + 0.3 * i) for k in range(len(x)) for i in range(5)])
    aligned = resolve(AlignmentParams(), CAMERA)
    assert aligned is not None
    image = np.full((SIZE[1], SIZE[0], 3), 90, np.uint8)
    uv = aligned.project(points)
    for column, row in uv[np.isfinite(uv[:, 0])].astype(int).tolist():
        image[max(row - 5, 0) : max(row + 6, 0), max(column, 0) : max(column + 8, 0)] = 240
    strength = upright_edges(image)
    return EdgeScene(points, strength, strength.mean(axis=1, dtype=np.float32)), CAMERA


SCENES = [poles(seed) for seed in range(6)]


def told(regions: tuple[Region, ...]) -> list[tuple[float, float]]:
    return [each.shift_px for each in regions if each.shift_px is not None]


def test_what_is_right_needs_no_arrow():
    match = local_match(SCENES, AlignmentParams())
    assert len(match.grid) == COLUMNS * ROWS
    assert len(match.bands) == len(BANDS_M) - 1
    assert len(told(match.grid)) >= 0.8 * len(match.grid)
    assert set(told(match.grid)) == {(0.0, 0.0)}
    assert all((each.score or 0.0) > 0.9 for each in match.bands)


@pytest.mark.parametrize("yaw_deg", [1.5, -1.0])
def test_a_turned_mount_gives_all_regions_one_arrow(yaw_deg: float):
    match = local_match(SCENES, AlignmentParams(yaw_deg=yaw_deg))
    shifts = np.array(told(match.grid))
    assert len(shifts) >= 0.6 * len(match.grid)
    assert np.median(shifts, axis=0) == pytest.approx((-yaw_deg * PX_PER_DEG, 0.0), abs=8.0)
    assert all((each.score or 0.0) < 0.6 for each in match.bands)


def test_a_rolled_mount_moves_left_and_right_against_each_other():
    match = local_match(SCENES, AlignmentParams(roll_deg=3.0))
    rows = np.array([[(each.shift_px or (np.nan, np.nan))[1] for each in match.grid]]).reshape(ROWS, COLUMNS)
    left, right = np.nanmedian(rows[:, :2]), np.nanmedian(rows[:, -2:])
    assert left * right < 0.0
    assert abs(left - right) > 20.0


def test_a_camera_that_sits_elsewhere_moves_what_is_near():
    near, _, far = local_match(SCENES, AlignmentParams(left_m=0.3)).bands
    assert near.shift_px is not None
    assert abs(near.shift_px[0]) > 12.0
    assert far.shift_px is None or abs(far.shift_px[0]) < abs(near.shift_px[0]) / 2


def test_few_borders_and_images_of_other_frames_cannot_tell():
    few = [(replace(scene, points=scene.points[: FEWEST - 1]), camera) for scene, camera in SCENES[:1]]
    assert told(local_match(few, AlignmentParams()).grid) == []
    others = [
        (replace(a, strength=b.strength, usual=b.usual), camera)
        for (a, camera), (b, _) in zip(SCENES, SCENES[3:] + SCENES[:3], strict=True)
    ]
    assert len(told(local_match(others, AlignmentParams()).grid)) <= 2
    assert local_match([], AlignmentParams()) == NO_MATCH
    without = [(scene, None) for scene, _ in SCENES]
    assert told(local_match(without, AlignmentParams()).grid) == [], "nothing aligns them"


def test_a_real_drive_tells_by_regions_which_way_it_is_turned(data_dir: Path):
    uri = f"kitti:{data_dir / 'kitti_0009' / '2011_09_26' / '2011_09_26_drive_0009_sync'}"
    seen = looked_at(uri, range(0, 51, 3))
    right = local_match(seen, AlignmentParams())
    assert all(each.score is not None and each.score > 0.5 for each in right.bands)
    turned = told(local_match(seen, AlignmentParams(yaw_deg=1.0)).grid)
    assert len(turned) >= 5
    assert np.median(turned, axis=0)[0] == pytest.approx(-12.6, abs=6.0)
