"""Calibrations written in every format come back as they were; what cannot be meant is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from pipeline.common.errors import BadInput
from pipeline.common.geometry import T_OPTICAL_BODY, inverse, rotation
from pipeline.formats.calibration_files import FORMATS, kalibr
from pipeline.formats.calibration_files.ros import INFO, TRANSFORM
from pipeline.sources.rig import load_rig
from pipeline.types import F64, CameraCalibration
from pipeline.types.source import SourceError
from tests.pipeline.calibration.alignment.made_drive import CAMERA

TURN = np.eye(4)
TURN[:3, :3] = rotation(*np.radians([1.5, -4.0, 7.0]))
STRAIGHT = replace(CAMERA, T_camera_ego=CAMERA.T_camera_ego @ TURN)
BENT = replace(STRAIGHT, distortion=np.array([-0.31, 0.12, 0.001, -0.002, 0.01]))


def written(name: str, camera: CameraCalibration, folder: Path) -> Path:
    folder.mkdir(exist_ok=True)
    path = folder / f"{name}.yaml"
    FORMATS[name].write(path, camera)
    return path


def same(a: CameraCalibration | None, b: CameraCalibration) -> None:
    assert a is not None
    np.testing.assert_allclose(a.T_camera_ego, b.T_camera_ego, atol=1e-7)
    np.testing.assert_allclose(a.K, b.K)
    np.testing.assert_allclose(a.distortion, b.distortion)
    assert (a.width, a.height) == (b.width, b.height)


@pytest.mark.parametrize("camera", [STRAIGHT, BENT], ids=["undistorted", "distorted"])
@pytest.mark.parametrize("name", ["kitti", "ros", "opencv", "kalibr"])
def test_what_is_written_is_read(name: str, camera: CameraCalibration, tmp_path: Path):
    refusals = {"kitti": "undistorted", "kalibr": "this camera has more"}
    if name in refusals and camera is BENT:
        with pytest.raises(SourceError, match=refusals[name]):
            written(name, camera, tmp_path)
        return
    read = FORMATS[name].read
    same(read(written(name, camera, tmp_path), (camera.width, camera.height)), camera)


@pytest.mark.parametrize("name", FORMATS)
def test_a_file_that_exists_is_never_overwritten(name: str, tmp_path: Path):
    path = written(name, STRAIGHT, tmp_path)
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    files[-1].write_text("measured by hand", encoding="utf-8")
    before = [file.read_bytes() for file in files]
    with pytest.raises(BadInput, match="file already exists"):
        written(name, STRAIGHT, tmp_path)
    assert [file.read_bytes() for file in files] == before


def test_a_rig_file_is_that_of_captures(tmp_path: Path):
    same(load_rig(written("rig", BENT, tmp_path)).camera_calibration(), BENT)


def test_kitti_needs_the_size(tmp_path: Path):
    with pytest.raises(SourceError, match="image size"):
        FORMATS["kitti"].read(written("kitti", STRAIGHT, tmp_path), None)


TO_BODY = np.linalg.inv(T_OPTICAL_BODY)
LEFT, BACK = np.eye(4), np.diag([-1.0, -1.0, 1.0, 1.0])
LEFT[:3, :3] = rotation(0.0, 0.0, np.pi / 2)


@pytest.mark.parametrize(
    ("T_camera_ego", "named"),
    [
        (inverse(STRAIGHT.T_camera_ego), "is its extrinsic inverted"),
        (TO_BODY @ STRAIGHT.T_camera_ego, "body axes"),
        (STRAIGHT.T_camera_ego @ LEFT, "axes are swapped"),
        (STRAIGHT.T_camera_ego @ BACK, "points backwards"),
    ],
    ids=["inverted", "body axes", "swapped axes", "backwards"],
)
@pytest.mark.parametrize("name", ["kitti", "ros", "opencv", "kalibr"])
def test_a_wrong_extrinsic_is_named_in_every_format(name: str, T_camera_ego: F64, named: str, tmp_path: Path):
    path, read = written(name, replace(STRAIGHT, T_camera_ego=T_camera_ego), tmp_path), FORMATS[name].read
    with pytest.raises(SourceError, match=named):
        read(path, (STRAIGHT.width, STRAIGHT.height))


@pytest.mark.parametrize(
    ("T_camera_ego", "named"),
    [(inverse(BENT.T_camera_ego), "is its extrinsic inverted"), (BENT.T_camera_ego @ LEFT, "axes are swapped")],
    ids=["inverted", "swapped axes"],
)
def test_a_wrong_extrinsic_of_a_rig_file_is_named(T_camera_ego: F64, named: str, tmp_path: Path):
    path = written("rig", replace(BENT, T_camera_ego=T_camera_ego), tmp_path)
    with pytest.raises(SourceError, match=named):
        load_rig(path)


def changed(path: Path, **values: object) -> Path:
    file = path / TRANSFORM
    file.write_text(yaml.safe_dump({**yaml.safe_load(file.read_text()), **values}))
    return path


def test_frames_say_which_way_a_transform_of_ros_goes(tmp_path: Path):
    folder = written("ros", replace(STRAIGHT, T_camera_ego=inverse(STRAIGHT.T_camera_ego)), tmp_path)
    read = FORMATS["ros"].read
    with pytest.raises(SourceError, match="is its extrinsic inverted"):
        read(folder, None)
    turned = changed(folder, header={"frame_id": "lidar"}, child_frame_id="camera_optical")
    same(read(turned, None), STRAIGHT)
    with pytest.raises(SourceError, match="the camera's frame is camera_optical"):
        read(changed(folder, header={"frame_id": "a"}, child_frame_id="b"), None)


@pytest.mark.parametrize(
    ("rotation_", "named"),
    [
        ({"roll": -90.0, "pitch": 0.0, "yaw": -90.0}, "look like degrees"),
        ({"x": 1.0, "y": 1.0, "z": 0.0, "w": 1.0}, "unit length"),
        ({"roll": 0.0}, "incomplete"),
    ],
)
def test_rotations_that_are_none_are_refused(rotation_: dict[str, float], named: str, tmp_path: Path):
    folder = written("ros", STRAIGHT, tmp_path)
    changed(folder, transform={"translation": {"x": 0.0, "y": 0.0, "z": 0.0}, "rotation": rotation_})
    with pytest.raises(SourceError, match=named):
        FORMATS["ros"].read(folder, None)


@pytest.mark.parametrize("data", [None, 0.5, [[0.0], [0.1]], [0.1, 0.0, 0.0, 0.0, float("nan")]])
def test_a_distortion_of_ros_that_is_no_list_of_numbers_is_refused(data: object, tmp_path: Path):
    folder = written("ros", STRAIGHT, tmp_path)
    info = yaml.safe_load((folder / INFO).read_text()) | {"distortion_coefficients": {"data": data}}
    (folder / INFO).write_text(yaml.safe_dump(info))
    with pytest.raises(SourceError, match="not a list of finite numbers"):
        FORMATS["ros"].read(folder, None)


FOUR = replace(STRAIGHT, distortion=BENT.distortion[:4])


def chain(folder: Path, **values: object) -> Path:
    """A Kalibr folder with a change in the camera's section."""
    file = written("kalibr", FOUR, folder) / kalibr.CHAIN
    loaded = yaml.safe_load(file.read_text())
    loaded["cam0"].update(values)
    file.write_text(yaml.safe_dump(loaded))
    return file.parent


def test_kalibr_takes_the_transform_from_either_place_and_either_way(tmp_path: Path):
    same(FORMATS["kalibr"].read(written("kalibr", FOUR, tmp_path), None), FOUR)
    inside = chain(tmp_path / "a", T_lidar_cam=inverse(FOUR.T_camera_ego).tolist())
    (inside / kalibr.TRANSFORM).unlink()
    same(FORMATS["kalibr"].read(inside, None), FOUR)
    beside = written("kalibr", FOUR, tmp_path / "b")
    (beside / kalibr.TRANSFORM).write_text(yaml.safe_dump({"T_cam_lidar": inverse(FOUR.T_camera_ego).tolist()}))
    with pytest.raises(SourceError, match="is its extrinsic inverted"):
        FORMATS["kalibr"].read(beside, None)
    (beside / kalibr.TRANSFORM).unlink()
    with pytest.raises(SourceError, match="no T_cam_lidar"):
        FORMATS["kalibr"].read(beside, None)


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ({"camera_model": "omni"}, "omni is not supported"),
        ({"camera_model": "ds", "intrinsics": [-0.2, 0.6, 800.0, 800.0, 1.0, 1.0]}, "ds is not supported"),
        ({"distortion_model": "equidistant", "distortion_coeffs": [0.0] * 4}, "only radtan"),
        ({"distortion_model": "equidistant"}, "equidistant distortion; only radtan"),
        ({"intrinsics": [800.0, 800.0]}, "incomplete"),
        ({"resolution": [0, 0]}, "invalid resolution"),
        ({"resolution": [float("inf"), 720]}, "incomplete"),
        ({"intrinsics": [-800.0, 800.0, 1.0, 1.0]}, "not a camera matrix"),
        ({"T_cam_lidar": [[2.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}, "not a rigid transform"),
    ],
)
def test_what_kalibr_says_and_cannot_be_meant_is_named(values: dict[str, object], named: str, tmp_path: Path):
    with pytest.raises(SourceError, match=named):
        FORMATS["kalibr"].read(chain(tmp_path, **values), None)


def test_a_file_of_something_else_is_refused(tmp_path: Path):
    file = tmp_path / "other.yaml"
    file.write_text("%YAML:1.0\n---\nimage_width: 640\n")
    with pytest.raises(SourceError, match="no camera_matrix"):
        FORMATS["opencv"].read(file, None)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("camera_matrix: !!opencv-matrix\n  rows: 3000000\n  cols: 3\n  dt: d\n  data: [1]\n", "not a matrix"),
        ("camera_matrix: !!opencv-matrix\n  rows: 3\n  cols: 3\n  dt: d\n  data: [1, 2]\n", "not a matrix"),
        ("camera_matrix: !!opencv-matrix\n  rows: .inf\n  cols: 3\n  dt: d\n  data: [1, 2]\n", "not a matrix"),
        ("camera_matrix: 5\n", "not a matrix"),
        ("- a\n", "not an OpenCV FileStorage file"),
        ("a: [\n", "not YAML"),
    ],
)
def test_a_damaged_file_of_opencv_is_said_in_a_sentence(text: str, said: str, tmp_path: Path):
    file = tmp_path / "a.yaml"
    file.write_text("%YAML:1.0\n---\n" + text)
    with pytest.raises(SourceError, match=said):
        FORMATS["opencv"].read(file, None)


def test_no_file_is_given_to_opencvs_own_parser(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """It writes out of bounds: 300 damaged calibrations were enough to crash the process."""
    path, made = written("opencv", BENT, tmp_path), cv2.FileStorage

    def only_written(name: str, flags: int) -> cv2.FileStorage:
        assert flags & cv2.FILE_STORAGE_WRITE
        return made(name, flags)

    monkeypatch.setattr(cv2, "FileStorage", only_written)
    read = FORMATS["opencv"].read
    same(read(path, None), BENT)
