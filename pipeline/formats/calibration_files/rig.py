"""The rig file of recordings of bare sensors, which says the mount as places and angles. It is read by
``pipeline.sources.rig``."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yaml

from pipeline.common.geometry import inverse
from pipeline.formats.extrinsic_mistakes import T_OPTICAL_BODY
from pipeline.types import CameraCalibration


def write(path: Path, camera: CameraCalibration) -> None:
    T_ego_body = inverse(camera.T_camera_ego) @ T_OPTICAL_BODY
    R = T_ego_body[:3, :3]
    angles = np.degrees(
        [np.arctan2(R[2, 1], R[2, 2]), np.arcsin(np.clip(-R[2, 0], -1.0, 1.0)), np.arctan2(R[1, 0], R[0, 0])]
    )
    place = zip(("x_m", "y_m", "z_m"), T_ego_body[:3, 3], strict=True)
    turn = zip(("roll_deg", "pitch_deg", "yaw_deg"), angles, strict=True)
    calibration = {
        "fx_px": float(camera.K[0, 0]),
        "fy_px": float(camera.K[1, 1]),
        "cx_px": float(camera.K[0, 2]),
        "cy_px": float(camera.K[1, 2]),
        "width_px": camera.width,
        "height_px": camera.height,
        "distortion": [float(each) for each in camera.distortion],
        "mount": {name: round(float(value), 7) for name, value in (*place, *turn)},
    }
    path.write_text(yaml.safe_dump({"camera": {"calibration": calibration}}, sort_keys=False), encoding="utf-8")
