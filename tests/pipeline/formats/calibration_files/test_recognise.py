"""Files of a calibration are recognised by their content, whatever they are called."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from pipeline.common.geometry import inverse, rotation
from pipeline.formats.calibration_files import FORMATS
from pipeline.formats.calibration_files.recognise import parse_any
from pipeline.sources import open_source
from pipeline.types import CameraCalibration
from pipeline.types.source import SourceError
from tests.pipeline.formats.calibration_files.test_calibration_files import BENT, FOUR, STRAIGHT, same, written

SIZE = STRAIGHT.width, STRAIGHT.height


def contents(name: str, camera: CameraCalibration, folder: Path) -> dict[str, bytes]:
    """The files of a format, under names that say nothing."""
    path = written(name, camera, Path(tempfile.mkdtemp(dir=folder)))
    files = [path] if path.is_file() else sorted(path.iterdir())
    return {f"{name} {number}": file.read_bytes() for number, file in enumerate(files)}


@pytest.mark.parametrize("name", ["kitti", "ros", "opencv", "kalibr"])
def test_every_format_is_recognised(name: str, tmp_path: Path):
    found, camera = parse_any(contents(name, STRAIGHT, tmp_path), SIZE)
    assert found is FORMATS[name]
    same(camera, STRAIGHT)


def day(data_dir: Path) -> dict[str, bytes]:
    """The calibration of a day of KITTI's raw data, under names that say nothing."""
    folder = data_dir / "kitti_0009/2011_09_26"
    names = ("calib_velo_to_cam.txt", "calib_imu_to_velo.txt", "calib_cam_to_cam.txt")
    return {f"{number}.txt": (folder / name).read_bytes() for number, name in enumerate(names)}


def test_a_day_of_kittis_raw_data_is_recognised_with_and_without_the_imus_file(data_dir: Path):
    raw = open_source(f"kitti:{data_dir}/kitti_0009/2011_09_26/2011_09_26_drive_0009_sync").frame(0).camera
    assert raw is not None
    found, camera = parse_any(day(data_dir), None)
    assert found is FORMATS["kitti"]
    same(camera, raw)
    velo, imu, cameras = day(data_dir).items()
    same(parse_any(dict([velo, cameras]), (1, 1))[1], raw)
    same(FORMATS["kitti"].read(data_dir / "kitti_0009/2011_09_26", None), raw)
    for files, named in (
        (dict([velo, imu]), "calib_cam_to_cam.txt is missing: KITTI needs two files"),
        (dict([cameras, imu]), "calib_velo_to_cam.txt is missing"),
        (dict([imu]), "calib_cam_to_cam.txt is missing"),
        ({**dict([velo, cameras]), "again": velo[1]}, "again: calib_velo_to_cam.txt is given twice"),
        (dict([velo, ("c", cameras[1].replace(b"S_rect_02: ", b"S_rect_02: -"))]), "S_rect_02 is not an image size"),
        (dict([velo, ("c", cameras[1].replace(b"S_rect_02", b"S_rect"))]), "no S_rect_02 of 2 numbers"),
    ):
        with pytest.raises(SourceError, match=named):
            parse_any(files, None)


@pytest.mark.parametrize(
    ("name", "part", "old", "new", "said"),
    [
        ("ros", "camera_info.yaml", "image_width: ", "image_width: -", "invalid image_width"),
        ("ros", "camera_info.yaml", "plumb_bob", "fisheye", "distortion: fisheye is not supported"),
        ("ros", "camera_info.yaml", "camera_optical", "elsewhere", "goes from lidar to camera_optical"),
        ("ros", "static_transform.yaml", "w: ", "w: 7", "the quaternion is not of unit length"),
        ("kalibr", "camchain.yaml", "pinhole", "omni", "camera_model omni is not supported"),
        ("kalibr", "transform.yaml", "- [", "- [7", "T_cam_lidar"),
        ("kalibr", "camchain.yaml", "cam0:", "cam0: [", "not YAML"),
    ],
)
def test_an_error_names_the_file_that_was_given(
    name: str, part: str, old: str, new: str, said: str, tmp_path: Path
) -> None:
    folder = written(name, FOUR if name == "kalibr" else BENT, tmp_path)
    texts = {file.name: file.read_text() for file in folder.iterdir()}
    assert old in texts[part]
    texts[part] = texts[part].replace(old, new, 1)
    files = {f"my {called}": text.encode() for called, text in texts.items()}
    with pytest.raises(SourceError, match=said) as refused:
        parse_any(files, SIZE)
    assert str(refused.value).startswith("my "), refused.value


def test_one_file_of_two_says_what_is_needed(tmp_path: Path):
    folder = written("ros", BENT, tmp_path)
    with pytest.raises(SourceError, match=r"static_transform\.yaml: no such file"):
        FORMATS["ros"].read(folder / "camera_info.yaml", SIZE)
    (folder / "camera_info.yaml").rename(folder / "left.yaml")
    with pytest.raises(SourceError, match=r"left\.yaml: ROS needs two files: a folder with camera_info\.yaml"):
        FORMATS["ros"].read(folder / "left.yaml", SIZE)


def test_a_chain_with_the_lidar_may_be_called_anything(tmp_path: Path):
    folder = written("kalibr", FOUR, tmp_path)
    chain, transform = (yaml.safe_load((folder / name).read_text()) for name in ("camchain.yaml", "transform.yaml"))
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump({"cam0": chain["cam0"] | transform}))
    same(FORMATS["kalibr"].read(tmp_path / "mine.yaml", None), FOUR)


@pytest.mark.parametrize("name", ["kitti", "ros", "opencv", "kalibr"])
def test_a_lidar_whose_own_x_axis_does_not_point_ahead_is_read_with_its_mount(name: str, tmp_path: Path):
    mount = np.eye(4)
    mount[:3, :3] = rotation(0.0, 0.0, -np.pi / 2)
    own = replace(STRAIGHT, T_camera_ego=STRAIGHT.T_camera_ego @ mount)
    files = contents(name, own, tmp_path)
    same(parse_any(files, SIZE, mount)[1], own)
    with pytest.raises(SourceError, match="axes are swapped"):
        parse_any(files, SIZE)
    inverted = replace(own, T_camera_ego=inverse(own.T_camera_ego))
    with pytest.raises(SourceError, match="inverted"):
        parse_any(contents(name, inverted, tmp_path), SIZE, mount)


def test_what_is_missing_or_mixed_up_is_named(tmp_path: Path):
    kitti, ros, rig = (contents(name, STRAIGHT, tmp_path) for name in ("kitti", "ros", "rig"))
    info, transform = ({name: data} for name, data in ros.items())
    for files, named in (
        (info, "the static transform is missing: ROS needs two files"),
        (transform, "the camera info is missing"),
        ({**transform, "again": next(iter(transform.values()))}, "again: the static transform is given twice"),
        ({**kitti, **ros}, "files of KITTI and ROS: give those of one"),
        ({**kitti, "b": next(iter(kitti.values()))}, "2 files of KITTI: give one"),
        (rig, "rig 0: a rig file describes a recording"),
        ({"notes.txt": b"hello"}, "notes.txt: not a calibration of KITTI, ROS, OpenCV or Kalibr"),
        ({}, "no file is given"),
    ):
        with pytest.raises(SourceError, match=named):
            parse_any(files, SIZE)
