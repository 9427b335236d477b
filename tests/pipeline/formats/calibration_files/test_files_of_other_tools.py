"""Calibrations as other tools write them: names, headers and lenses that are not as in the files written here."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from pipeline.common.geometry import inverse
from pipeline.formats.calibration_files.recognise import parse_any
from pipeline.types import F64, CameraCalibration
from pipeline.types.source import SourceError
from tests.pipeline.formats.calibration_files.test_calibration_files import BENT, FOUR, STRAIGHT, same, written
from tests.pipeline.formats.calibration_files.test_recognise import SIZE, contents

FIVE = BENT.distortion.tolist()


def read(*texts: str) -> CameraCalibration:
    return parse_any({f"file {number}": text.encode() for number, text in enumerate(texts)}, SIZE)[1]


def text(name: str, camera: CameraCalibration, folder: Path, *, replaced: dict[str, str]) -> str:
    """A file as it is written here, with other words in it."""
    (data,) = contents(name, camera, folder).values()
    said = data.decode()
    for old, new in replaced.items():
        assert old in said, old
        said = said.replace(old, new)
    return said


def without(said: str, *names: str) -> str:
    return "".join(line for line in said.splitlines(keepends=True) if not line.startswith(names))


TRACKING = {"R0_rect:": "R_rect", "Tr_velo_to_cam:": "Tr_velo_cam"}


@pytest.mark.parametrize(
    ("replaced", "left_out"),
    [
        (TRACKING, ()),
        ({name: f"{new}:" for name, new in TRACKING.items()}, ()),
        ({"Tr_velo_to_cam:": "Tr:"}, ("R0_rect",)),
    ],
    ids=["tracking", "tracking with colons", "odometry"],
)
def test_all_benchmarks_of_kitti_are_read(replaced: dict[str, str], left_out: tuple[str, ...], tmp_path: Path) -> None:
    same(read(without(text("kitti", STRAIGHT, tmp_path, replaced=replaced), *left_out)), STRAIGHT)


def ros(camera: CameraCalibration, folder: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """The values of the camera info and of the transform; frames ``camera_optical`` and ``lidar``."""
    info, transform = (yaml.safe_load(each) for each in contents("ros", camera, folder).values())
    return info, transform


def dumped(*values: object) -> list[str]:
    return [yaml.safe_dump(each) for each in values]


@pytest.mark.parametrize(
    ("camera_name", "camera", "lidar"),
    [
        ("narrow_stereo", "camera_optical_frame", "velodyne"),
        ("", "front/optical", "os_sensor"),
        ("front", "front", "top"),
        ("front", "cam0", "front_lidar"),
    ],
)
@pytest.mark.parametrize("is_parent", [True, False])
def test_the_frame_of_a_camera_without_a_header_is_found(
    camera_name: str, camera: str, lidar: str, is_parent: bool, tmp_path: Path
) -> None:
    given = STRAIGHT if is_parent else replace(STRAIGHT, T_camera_ego=inverse(STRAIGHT.T_camera_ego))
    info, transform = ros(given, tmp_path)
    parent, child = (camera, lidar) if is_parent else (lidar, camera)
    del info["header"]
    info["camera_name"] = camera_name
    same(read(*dumped(info, {**transform, "header": {"frame_id": parent}, "child_frame_id": child})), STRAIGHT)


def test_a_camera_whose_frame_is_not_known_is_refused_with_both_frames(tmp_path: Path) -> None:
    info, transform = ros(STRAIGHT, tmp_path)
    del info["header"]
    with pytest.raises(SourceError, match="no header with the camera's frame_id; add it: a or b"):
        read(*dumped(info, {**transform, "header": {"frame_id": "a"}, "child_frame_id": "b"}))


@pytest.mark.parametrize("names", ["kd", "KD"], ids=["ROS 2", "ROS 1"])
def test_printed_messages_of_ros_are_read(names: str, tmp_path: Path) -> None:
    _, transform = ros(BENT, tmp_path)
    echo = {
        "header": {"frame_id": "camera_optical"},
        "height": BENT.height,
        "width": BENT.width,
        "distortion_model": "plumb_bob",
        names[0]: BENT.K.ravel().tolist(),
        names[1]: FIVE,
    }
    printed = [f"{each}---\n" for each in dumped(echo, {"transforms": [transform]})]
    same(read(*printed), BENT)
    with pytest.raises(SourceError, match="several transforms or none"):
        read(printed[0], *dumped({"transforms": [transform, transform]}))


@pytest.mark.parametrize(
    ("model", "coefficients", "lens"),
    [
        ("rational_polynomial", FIVE, FIVE),
        ("plumb_bob", [*FIVE, 0.1, 0.2, 0.3], [*FIVE, 0.1, 0.2, 0.3]),
        ("rational_polynomial", [*FIVE, 0.1, 0.2, 0.3, *[0.0] * 6], [*FIVE, 0.1, 0.2, 0.3]),
        ("", [], []),
    ],
)
def test_lenses_that_are_polynomials_are_read(
    model: str, coefficients: list[float], lens: list[float], tmp_path: Path
) -> None:
    info, transform = ros(BENT, tmp_path)
    info |= {"distortion_model": model, "distortion_coefficients": {"data": coefficients}}
    same(read(*dumped(info, transform)), replace(BENT, distortion=np.array(lens)))


@pytest.mark.parametrize(
    ("model", "coefficients", "said"),
    [
        ("equidistant", [0.1, 0.0, 0.0, 0.0], "equidistant is not supported"),
        ("equidistant", [0.0] * 4, "equidistant is not supported"),
        ("rational_polynomial", [*FIVE, *[0.1] * 9], "a thin prism or a tilted sensor is not supported"),
        ("plumb_bob", [0.1, 0.2], "2 distortion coefficients; 4, 5 or 8 are supported"),
        ("division", [0.1], "division is not supported"),
    ],
)
def test_other_lenses_are_refused(model: str, coefficients: list[float], said: str, tmp_path: Path) -> None:
    info, transform = ros(BENT, tmp_path)
    info |= {"distortion_model": model, "distortion_coefficients": {"data": coefficients}}
    with pytest.raises(SourceError, match=said):
        read(*dumped(info, transform))


@pytest.mark.parametrize(("width", "said"), [(0, "invalid image_width"), (float("inf"), "incomplete camera info")])
def test_a_size_that_is_none_is_refused(width: float, said: str, tmp_path: Path) -> None:
    info, transform = ros(BENT, tmp_path)
    with pytest.raises(SourceError, match=said):
        read(*dumped(info | {"image_width": width}, transform))


OPENCV_2 = {"camera_matrix": "Camera_Matrix", "distortion_coefficients": "Distortion_Coefficients"}
OPENCV_2_SIZE = {"image_width": "image_Width", "image_height": "image_Height"}
AUTOWARE = {
    "camera_matrix": "CameraMat",
    "distortion_coefficients": "DistCoeff",
    "T_camera_lidar": "CameraExtrinsicMat",
}


def autoware(camera: CameraCalibration, T: F64, folder: Path) -> str:
    """As Autoware.AI's calibrator writes it. T: (4, 4), its extrinsic."""
    said = text("opencv", replace(camera, T_camera_ego=T), folder, replaced=AUTOWARE)
    size = f"ImageSize: [ {camera.width}, {camera.height} ]\nReprojectionError: 0.\n"
    return without(said, "image_") + size


@pytest.mark.parametrize(
    "replaced",
    [OPENCV_2 | OPENCV_2_SIZE, {"camera_matrix": "K", "distortion_coefficients": "D", "T_camera_lidar": "T_cam_lidar"}],
)
def test_other_names_of_opencv_are_read(replaced: dict[str, str], tmp_path: Path) -> None:
    same(read(text("opencv", BENT, tmp_path, replaced=replaced)), BENT)


def test_the_extrinsic_of_autoware_is_the_pose_of_the_camera(tmp_path: Path) -> None:
    same(read(autoware(BENT, inverse(BENT.T_camera_ego), tmp_path)), BENT)
    with pytest.raises(SourceError, match="is its extrinsic inverted"):
        read(autoware(BENT, BENT.T_camera_ego, tmp_path))


@pytest.mark.parametrize("more", ["fisheye_model: 1\n", "DistModel: equidistant\n"])
def test_a_fisheye_of_opencv_is_refused(more: str, tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="equidistant is not supported"):
        read(text("opencv", FOUR, tmp_path, replaced={}) + more)


def test_a_chain_with_the_header_of_opencv_is_read(tmp_path: Path) -> None:
    folder = written("kalibr", FOUR, tmp_path)
    same(read(*(f"%YAML:1.0\n\n{file.read_text()}" for file in folder.iterdir())), FOUR)


def test_a_sensor_kit_of_autoware_is_refused_with_what_to_give_instead() -> None:
    mount = dict.fromkeys(("x", "y", "z", "roll", "pitch", "yaw"), 0.0)
    with pytest.raises(SourceError, match="the transform between the camera's optical frame and the LiDAR"):
        read(*dumped({"sensor_kit_base_link": {"camera0/camera_link": mount, "velodyne_top_base_link": mount}}))
