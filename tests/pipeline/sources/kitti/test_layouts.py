"""KITTI's odometry sequences, made of real sweeps, calibration and positions of a raw drive."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from pipeline.formats.kitti_calibration import parse_raw_calibration
from pipeline.sources import SourceError, open_source

COUNT = 6


@pytest.fixture
def sequence(data_dir: Path, tmp_path: Path) -> Path:
    """``sequences/04`` and ``poses/04.txt`` in the published format, of a car that drives at 10.6 m/s in a left
    bend."""
    raw = data_dir / "kitti_0009/2011_09_26"
    folder = tmp_path / "sequences" / "04"
    for ours, theirs, suffix in (("velodyne", "velodyne_points", ".bin"), ("image_2", "image_02", None)):
        (folder / ours).mkdir(parents=True)
        for k, file in enumerate(sorted((raw / "2011_09_26_drive_0009_sync" / theirs / "data").iterdir())[:COUNT]):
            shutil.copy(file, folder / ours / f"{k:06d}{suffix or file.suffix}")
    files = ("calib_cam_to_cam.txt", "calib_velo_to_cam.txt")
    calibration = parse_raw_calibration(*((raw / name).read_bytes() for name in files), files, (1242, 375))
    to_camera = calibration.T_rect_ego
    P2 = calibration.camera.K @ (calibration.camera.T_camera_ego @ np.linalg.inv(to_camera))[:3]
    rows = [
        f"{name}: {' '.join(f'{v:.9e}' for v in matrix.ravel())}"
        for name, matrix in (("P2", P2), ("Tr", to_camera[:3]))
    ]
    (folder / "calib.txt").write_text("\n".join(rows) + "\n")
    (folder / "times.txt").write_text("".join(f"{0.1 * k:e}\n" for k in range(COUNT)))
    lines = []
    for k in range(COUNT):
        heading = 0.02 * k  # of the car, whose way is the arc of a circle
        pose = np.eye(4)
        pose[:2, :2] = [[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]]
        pose[:2, 3] = 53.0 * np.sin(heading), 53.0 * (1.0 - np.cos(heading))
        lines.append(" ".join(f"{v:e}" for v in (to_camera @ pose @ np.linalg.inv(to_camera))[:3].ravel()))
    (tmp_path / "poses").mkdir()
    (tmp_path / "poses" / "04.txt").write_text("\n".join(lines) + "\n")
    return folder


def test_a_sequence_opens_by_its_bare_path_with_own_motion_from_its_poses(sequence: Path) -> None:
    source = open_source(str(sequence))
    assert len(source) == COUNT
    frame = source.frame(3)
    assert frame.ego is not None
    assert frame.ego.speed_mps == pytest.approx(10.6, abs=0.05)
    assert frame.ego.yaw_rate_radps == pytest.approx(0.2, abs=1e-3)
    assert frame.ego.source == "ins"
    assert frame.sweep is not None
    assert frame.image is not None
    assert frame.camera is not None
    assert frame.camera.K[0, 0] == pytest.approx(721.5, abs=0.1)
    assert source.t_ns(4) - source.t_ns(0) == 400_000_000


def test_without_poses_it_has_no_own_motion_and_damaged_ones_are_said(sequence: Path) -> None:
    poses = sequence.parent.parent / "poses" / "04.txt"
    for damaged in ("1 2 3\n", "1e308 " * 12 + "\n", "inf 0 0 " * 4 + "\n", "nan 0 0 " * 4 + "\n"):
        poses.write_text(damaged)
        with pytest.raises(SourceError, match=r"04\.txt: expected poses of 12 numbers per line"):
            open_source(str(sequence))
    poses.unlink()
    source = open_source(str(sequence))
    assert source.frame(0).ego is None
    assert "no ego speed recorded" in source.notes
