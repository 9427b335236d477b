"""The rig file of recordings of bare sensors, which gives mounts as positions and angles. ``pipeline.sources.rig``
reads it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yaml

from pipeline.common.files.output_files import write_new
from pipeline.common.geometry import T_OPTICAL_BODY, inverse
from pipeline.types import F64, CameraCalibration


def write(path: Path, camera: CameraCalibration) -> None:
    """The camera alone; the LiDAR is at the ego origin."""
    write_rig(path, camera, None)


def write_rig(path: Path, camera: CameraCalibration | None, T_ego_lidar: F64 | None) -> None:
    """A file with what is given of camera and LiDAR. T_ego_lidar: (4, 4), axes x forward, y left, z up."""
    rig: dict[str, object] = {}
    if T_ego_lidar is not None:
        rig["lidar"] = {"mount": _mount(T_ego_lidar)}
    if camera is not None:
        rig["camera"] = {"calibration": _calibration(camera)}
    write_new(path, yaml.safe_dump(rig, sort_keys=False))


def _calibration(camera: CameraCalibration) -> dict[str, object]:
    return {
        "fx_px": float(camera.K[0, 0]),
        "fy_px": float(camera.K[1, 1]),
        "cx_px": float(camera.K[0, 2]),
        "cy_px": float(camera.K[1, 2]),
        "width_px": camera.width,
        "height_px": camera.height,
        "distortion": [float(each) for each in camera.distortion],
        "mount": _mount(inverse(camera.T_camera_ego) @ T_OPTICAL_BODY),
    }


def _mount(T_ego_sensor: F64) -> dict[str, float]:
    """Place and angles of a sensor with its x axis ahead."""
    R = T_ego_sensor[:3, :3]
    angles = np.degrees(
        [np.arctan2(R[2, 1], R[2, 2]), np.arcsin(np.clip(-R[2, 0], -1.0, 1.0)), np.arctan2(R[1, 0], R[0, 0])]
    )
    place = zip(("x_m", "y_m", "z_m"), T_ego_sensor[:3, 3], strict=True)
    turn = zip(("roll_deg", "pitch_deg", "yaw_deg"), angles, strict=True)
    return {name: round(float(value), 7) for name, value in (*place, *turn)}
