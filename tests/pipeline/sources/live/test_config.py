"""The live config: what `cipv live init` writes, and one sentence for what is wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from pydantic import BaseModel

from pipeline.sources import is_live, open_live, open_source
from pipeline.sources.live import config as live_config
from pipeline.sources.live.config import CalibrationConfig, LiveConfig, load
from pipeline.sources.live.config_template import TEMPLATE
from pipeline.types.source import SourceError

SMALLEST = "lidar: {}\n"


def written(tmp_path: Path, text: str) -> str:
    path = tmp_path / "car.yaml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_the_written_file_is_one_that_can_be_read(tmp_path: Path) -> None:
    config = load(written(tmp_path, TEMPLATE))
    assert config.lidar is not None
    assert config.lidar.data_port == 2368
    assert config.lidar.position_port == 8308


def test_the_written_file_names_every_key() -> None:
    models = [m for m in vars(live_config).values() if isinstance(m, type) and issubclass(m, BaseModel)]
    keys = {name for model in models for name in model.model_fields}
    assert {key for key in keys if f"{key}:" not in TEMPLATE} == set()


def test_defaults_of_the_written_file_are_the_programs() -> None:
    written_out = LiveConfig.model_validate(yaml.safe_load(TEMPLATE)).lidar
    assert written_out == LiveConfig.model_validate({"lidar": {}}).lidar


@pytest.mark.parametrize(
    ("case", "text", "complaint"),
    [
        ("unknown key", "lidar: {colour: 1}", "lidar.colour: no such setting"),
        ("misspelt", "lidar: {data_prot: 1}", "lidar.data_prot: no such setting; did you mean data_port?"),
        ("misspelt below", "lidar: {mount: {yaw_dg: 1}}", "lidar.mount.yaw_dg: no such setting; did you mean yaw_deg?"),
        ("radians", "lidar: {mount: {yaw_deg: -1.5708}}", "lidar.mount.yaw_deg: -1.5708 is -90° in radians"),
        ("nothing to look with", "title: x", "neither lidar nor camera"),
        ("port out of range", "lidar: {data_port: 70000}", "lidar.data_port"),
        ("another model", "lidar: {model: HDL-32E}", "lidar.model"),
        ("two cameras in one", "camera: {device: 0, file: a.mp4}", "exactly one of device, url, file"),
        ("a port that does not exist", "gnss: {tcp: 'host:99999'}", "host:99999: ports are 1 to 65535"),
        ("no camera in it", "camera: {}", "exactly one of device, url, file"),
        ("not an address", "camera: {url: 'ftp://x'}", "camera.url"),
        ("speed from no receiver", "lidar: {}\nego: {source: gnss}", "there is no gnss"),
        ("CAN without its file", "lidar: {}\nego: {source: can}", "`can:` with its DBC file"),
        ("distortion of three", "camera: {device: 0, calibration: {fx_px: 900, fy_px: 900, cx_px: 640, cy_px: 360,"
         " width_px: 1280, height_px: 720, distortion: [1, 2, 3]}}", "0, 4, 5 or 8 numbers"),
        ("a camera that looks back", "camera: {device: 0, calibration: {fx_px: 900, fy_px: 900, cx_px: 640, cy_px: 360,"
         " width_px: 1280, height_px: 720, mount: {yaw_deg: 180}}}", "the camera does not look ahead"),
        ("a device out of range", "camera: {device: 64}", "camera.device: 0 to 63, or a path"),
        ("a device that is not a number", "camera: {device: true}", "camera.device: 0 to 63, or a path"),
        ("a path that is no device", "camera: {device: drive.mp4}", "camera.device: 0 to 63, or a path"),
        ("a list", "- 1", "expected sensors"),
        ("not YAML", "lidar: {", "not YAML"),
        ("not a number", "lidar: {time_offset_ms: .nan}", "lidar.time_offset_ms"),
    ],
)  # fmt: skip
def test_a_wrong_file_gives_one_sentence(tmp_path: Path, case: str, text: str, complaint: str) -> None:
    with pytest.raises(SourceError) as raised:
        load(written(tmp_path, text))
    assert complaint in str(raised.value)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("path", ["", "nowhere.yaml", "\0"])
def test_a_file_that_is_not_there_says_how_to_make_one(path: str) -> None:
    with pytest.raises(SourceError, match="cipv live init"):
        open_live(f"live:{path}")


def test_live_is_no_recording(tmp_path: Path) -> None:
    path = written(tmp_path, SMALLEST)
    assert is_live(f"live:{path}")
    with pytest.raises(SourceError, match="a recording is needed"):
        open_source(f"live:{path}")
    assert open_live(f"live:{path}").notes == (
        "no camera: the pipeline runs on LiDAR alone",
        "no ego speed: neither gnss nor can provides it",
    )


@pytest.mark.parametrize("device", [0, "/dev/v4l/by-id/usb-046d_C920_1A2B-video-index0"])
def test_a_plugged_in_camera_is_named_by_number_or_path(tmp_path: Path, device: int | str) -> None:
    camera = load(written(tmp_path, f"camera: {{device: {device}}}")).camera
    assert camera is not None
    assert camera.device == device


def test_files_are_found_beside_the_config(tmp_path: Path) -> None:
    text = "camera: {file: drive.mp4}"
    config = load(written(tmp_path, text))
    assert config.camera is not None
    assert config.camera.file == tmp_path.resolve() / "drive.mp4"


@pytest.mark.parametrize(
    ("mount", "seen_at"),
    [
        ({}, (640.0, 360.0)),
        ({"z_m": 1.0}, (640.0, 360.0 + 900.0 * 1.0 / 20.0)),
        ({"y_m": 0.5}, (640.0 + 900.0 * 0.5 / 20.0, 360.0)),
        ({"pitch_deg": 2.0}, (640.0, 360.0 - 900.0 * np.tan(np.radians(2.0)))),
        ({"yaw_deg": 3.0}, (640.0 + 900.0 * np.tan(np.radians(3.0)), 360.0)),
    ],
)
def test_a_camera_sits_where_its_mount_says(mount: dict[str, Any], seen_at: tuple[float, float]) -> None:
    """A point 20 m ahead at the LiDAR's height appears below the image centre of a higher camera, right of it for a
    camera mounted or turned to the left, and above it for one turned down."""
    calibration = CalibrationConfig.model_validate(
        {"fx_px": 900, "fy_px": 900, "cx_px": 640, "cy_px": 360, "width_px": 1280, "height_px": 720, "mount": mount}
    ).calibration()
    x, y, z = (calibration.T_camera_ego @ np.array([20.0, 0.0, 0.0, 1.0]))[:3]
    uv = 640.0 + 900.0 * x / z, 360.0 + 900.0 * y / z
    np.testing.assert_allclose(uv, seen_at, atol=1e-6)


@pytest.mark.parametrize("angle_deg", [0.0, 1.571, -2.618, 0.52, 3.0, 90.0, -180.0])
def test_angles_in_degrees_are_taken_as_they_are(angle_deg: float) -> None:
    assert live_config.Mount(yaw_deg=angle_deg).yaw_deg == angle_deg
