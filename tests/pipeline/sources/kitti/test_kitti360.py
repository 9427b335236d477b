"""KITTI-360, built from its published documentation, with the numbers of its calibration; the sweeps are a test's.
No file of the data set may be passed on."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.common.geometry import inverse, rotation, transform
from pipeline.sources import SourceError, open_source
from tests.pipeline.sources.conftest import rings_file

DRIVE = "2013_05_28_drive_0000_sync"
CAM_TO_VELO = (
    "0.04307104361 -0.08829286498 0.995162929 0.8043914418 -0.999004371 0.007784614041 0.04392796942 0.2993489574 "
    "-0.01162548558 -0.9960641394 -0.08786966659 -0.1770225824"
)
PERSPECTIVE = """calib_time: 22-Jun-2020 12:13:17
S_rect_00: 1408 376
R_rect_00: 0.999974 -0.007141 -0.000089 0.007141 0.999969 -0.003247 0.000112 0.003247 0.999995
P_rect_00: 552.554261 0.0 682.049453 0.0 0.0 552.554261 238.769549 0.0 0.0 0.0 1.0 0.0
"""
FRAMES, STANDS_FROM, STANDS_TO = 12, 4, 8
SPEED_MPS, YAW_RATE_RADPS = 8.0, 0.1


def T_rect_ego() -> np.ndarray:
    T_ego_cam, rectify = np.eye(4), np.eye(4)
    T_ego_cam[:3] = np.array(CAM_TO_VELO.split(), dtype=float).reshape(3, 4)
    rectify[:3, :3] = np.array(PERSPECTIVE.splitlines()[2].split()[1:], dtype=float).reshape(3, 3)
    return rectify @ inverse(T_ego_cam)


def write_kitti360(root: Path, drive: str = DRIVE, frames: int = FRAMES) -> Path:
    """Frames at 10 Hz of a car on an arc, without poses while it stands."""
    velodyne, camera = root / "data_3d_raw" / drive / "velodyne_points", root / "data_2d_raw" / drive / "image_00"
    for folder in (velodyne / "data", camera / "data_rect", root / "data_poses" / drive):
        folder.mkdir(parents=True)
    (root / "calibration").mkdir(exist_ok=True)
    (root / "calibration" / "calib_cam_to_velo.txt").write_text(CAM_TO_VELO + "\n")
    (root / "calibration" / "perspective.txt").write_text(PERSPECTIVE)
    stamps = [f"2013-05-28 08:46:{k // 10:02d}.{k % 10}00000000\n" for k in range(frames)]
    poses, driven_s = [], 0.0
    for k in range(frames):
        (velodyne / "data" / f"{k:010d}.bin").write_bytes(rings_file())
        cv2.imwrite(str(camera / "data_rect" / f"{k:010d}.png"), np.full((376, 1408, 3), 20 * k, np.uint8))
        if k and not STANDS_FROM < k <= STANDS_TO:
            driven_s += 0.1
        heading, pose = 2.0 + YAW_RATE_RADPS * driven_s, np.eye(4)
        radius = SPEED_MPS / YAW_RATE_RADPS
        pose[:3, :3] = rotation(0.0, 0.0, heading)
        pose[:3, 3] = 1300.0 + radius * np.sin(heading), 3800.0 - radius * np.cos(heading), 110.0
        if not STANDS_FROM < k < STANDS_TO:
            poses.append(f"{k} " + " ".join(f"{v:.9f}" for v in (pose @ inverse(T_rect_ego())).ravel()) + " \n")
    (root / "data_poses" / drive / "cam0_to_world.txt").write_text("".join(poses))
    for folder in (velodyne, camera):
        (folder / "timestamps.txt").write_text("".join(stamps))
    return root


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return write_kitti360(tmp_path / "KITTI-360")


@pytest.mark.parametrize("inside", ["", f"data_3d_raw/{DRIVE}", f"data_2d_raw/{DRIVE}"])
def test_a_drive_opens_by_any_of_its_folders(inside: str, root: Path) -> None:
    source = open_source(str(root / inside))
    assert len(source) == FRAMES
    frame = source.frame(2)
    assert frame.sweep is not None
    assert frame.image is not None
    assert frame.image.bgr[0, 0, 0] == 40
    assert frame.t_ns - source.t_ns(0) == 200_000_000


def test_the_left_camera_sits_where_the_files_say(root: Path) -> None:
    camera = open_source(str(root)).frame(0).camera
    assert camera is not None
    assert camera.K[0].tolist() == [552.554261, 0.0, 682.049453]
    assert (camera.width, camera.height) == (1408, 376)
    assert inverse(camera.T_camera_ego)[:3, 3] == pytest.approx([0.8044, 0.2993, -0.1770], abs=1e-3)
    ahead = transform(camera.T_camera_ego, np.array([[30.0, 0.0, -1.7]]))[0]
    u, v = (camera.K @ ahead)[:2] / ahead[2]
    assert (u, v) == (pytest.approx(712, abs=20), pytest.approx(212, abs=20)), "on the road, near the middle"


def test_own_motion_is_that_of_the_poses_also_where_it_stands(root: Path) -> None:
    frames = [open_source(str(root)).frame(k).ego for k in range(FRAMES)]
    own = [(ego.speed_mps, ego.yaw_rate_radps) for ego in frames if ego is not None]
    assert len(own) == FRAMES
    for k in (1, 2, 10):
        assert own[k] == pytest.approx((SPEED_MPS, YAW_RATE_RADPS), abs=0.02)
    for k in (5, 6, 7):
        assert own[k] == pytest.approx((0.0, 0.0), abs=1e-4)


def test_the_inertial_unit_goes_before_poses(root: Path) -> None:
    data = root / "data_poses" / DRIVE / "oxts" / "data"
    data.mkdir(parents=True)
    record = [0.0] * 30
    record[0], record[8], record[22] = 49.0, 7.5, 0.03
    (data / "0000000003.txt").write_text(" ".join(map(str, record)))
    source = open_source(str(root))
    ego = source.frame(3).ego
    assert ego is not None
    assert (ego.speed_mps, ego.yaw_rate_radps) == (7.5, 0.03)


def test_of_several_drives_one_is_named(root: Path) -> None:
    write_kitti360(root, "2013_05_28_drive_0002_sync")
    with pytest.raises(SourceError, match=r"it holds drives; open one of them, for example kitti:.*drive_0000_sync"):
        open_source(str(root))
    assert len(open_source(str(root / "data_3d_raw" / "2013_05_28_drive_0002_sync"))) == FRAMES


WRONG = {
    "no calibration": ("calibration/calib_cam_to_velo.txt", None, r"calib_cam_to_velo\.txt: cannot be read: No such"),
    "a cut one": ("calibration/calib_cam_to_velo.txt", "0.04 -0.08", "not one line of 12 numbers"),
    "no cameras": ("calibration/perspective.txt", "R_rect_00: 1\n", r"perspective\.txt: no P_rect_00 of 3×4 numbers"),
    "cut poses": (f"data_poses/{DRIVE}/cam0_to_world.txt", "0 1.0 2.0", "not poses of 17 numbers a line"),
}


@pytest.mark.parametrize("what", WRONG)
def test_what_is_missing_or_cut_is_named_in_one_line(what: str, root: Path) -> None:
    name, text, says = WRONG[what]
    (root / name).unlink() if text is None else (root / name).write_text(text)
    with pytest.raises(SourceError, match=says) as error:
        open_source(str(root))
    assert "\n" not in str(error.value)


def test_without_poses_it_has_no_own_motion(root: Path) -> None:
    (root / "data_poses" / DRIVE / "cam0_to_world.txt").unlink()
    source = open_source(str(root))
    assert source.frame(0).ego is None
    assert "no ego speed recorded" in source.notes
