"""A clip's points as one PLY file, laid over each other by Open3D where its libraries are there."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from app.clips.point_cloud import load_open3d, write_ply
from pipeline.common.errors import BadInput
from pipeline.sources import open_source

try:
    open3d = load_open3d()
except BadInput:
    open3d = None
needs_open3d = pytest.mark.skipif(open3d is None, reason="Open3D's system libraries are not installed")


def test_missing_libraries_are_said_in_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "open3d", None)
    with pytest.raises(BadInput, match=r"install the system packages libegl1 libgl1 libx11-6 libusb-1.0-0") as raised:
        write_ply([np.ones((5, 4), np.float32)], tmp_path / "cloud.ply")
    assert "\n" not in str(raised.value)


@needs_open3d
def test_one_sweep_is_written_as_it_is(tmp_path: Path) -> None:
    sweep = open_source("sim:straight").frame(0).sweep
    assert sweep is not None
    write_ply([None, sweep.points], tmp_path / "job")
    data = (tmp_path / "job").read_bytes()
    assert data.startswith(b"ply\n")
    assert f"element vertex {len(sweep.points)}".encode() in data
    assert b"intensity" in data


@needs_open3d
def test_sweeps_of_a_moving_car_lie_over_each_other(tmp_path: Path) -> None:
    """Seen from a car that moves 1 m a sweep between walls, a wall keeps its place in the first sweep's frame."""
    rng = np.random.default_rng(1)
    wall = np.array([30.0, 0.0, 1.0]) + rng.uniform((0, -8, -2), (0, 8, 2), (4000, 3))
    sides = np.concatenate([rng.uniform((-5, y, -1), (30, y + 0.01, 3), (4000, 3)) for y in (-8.0, 8.0)])
    posts = np.concatenate([np.array([x, 5.0, 0.0]) + rng.uniform(-0.2, 0.2, (300, 3)) for x in (6.0, 13.0, 21.0)])
    world = np.concatenate([wall, sides, posts])
    seen = [np.column_stack([world - (shift, 0.0, 0.0), np.full(len(world), 9.0)]) for shift in (0.0, 1.0, 2.0, 3.0)]
    write_ply([points.astype(np.float32) for points in seen], tmp_path / "cloud.ply")
    xyz = open3d.t.io.read_point_cloud(str(tmp_path / "cloud.ply")).point.positions.numpy()
    facing = xyz[(xyz[:, 0] > 29.0) & (np.abs(xyz[:, 1]) < 7.0)]
    assert np.abs(facing[:, 0] - 30.0).max() < 0.1


@needs_open3d
def test_a_clip_without_a_lidar_has_no_cloud(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="LiDAR points"):
        write_ply([None, None], tmp_path / "cloud.ply")
