"""Kalibr: a folder with ``camchain.yaml``, of which the first camera is read, and ``transform.yaml`` with
``T_cam_lidar`` (4, 4), since Kalibr itself knows no LiDAR. ``T_lidar_cam``, the inverse, is read too, and both also
from the camera's part of the chain. Names as in Kalibr's documentation of its YAML formats."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from pipeline.common.files.output_files import write_new_files
from pipeline.common.geometry import inverse
from pipeline.formats.calibration_files.contents import CalibrationFiles, file_of, yaml_mapping
from pipeline.formats.calibration_files.lens import polynomial_lens
from pipeline.formats.file_reading import camera_matrix, check_looks_ahead, rigid_transform
from pipeline.types import F64, CameraCalibration
from pipeline.types.source import SourceError

CHAIN, TRANSFORM = "camchain.yaml", "transform.yaml"
_CAMERA = "cam0"
_FORWARD, _BACKWARD = ("T_cam_lidar", "T_camera_lidar"), ("T_lidar_cam", "T_lidar_camera")


def parse(files: CalibrationFiles, size: tuple[int, int] | None, T_ego_lidar: F64 | None = None) -> CameraCalibration:
    file = file_of(files, CHAIN)
    chain = yaml_mapping(file)
    camera = chain.get(_CAMERA)
    if not isinstance(camera, dict):
        raise SourceError(f"{file.name}: no {_CAMERA}")
    model, distortion_model = (str(camera.get(name, "none")) for name in ("camera_model", "distortion_model"))
    if model != "pinhole":
        raise SourceError(f"{file.name}: camera_model {model} is not supported; calibrate as pinhole")
    try:
        fu, fv, pu, pv = (float(each) for each in camera["intrinsics"])
        width, height = (int(each) for each in camera["resolution"])
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise SourceError(f"{file.name}: {_CAMERA} is incomplete: {error}") from None
    if distortion_model not in ("radtan", "none"):
        raise SourceError(f"{file.name}: {distortion_model} distortion; only radtan is supported")
    lens = polynomial_lens(camera.get("distortion_coeffs", []), distortion_model, f"{file.name}: distortion_coeffs")
    if min(width, height) < 16:
        raise SourceError(f"{file.name}: invalid resolution")
    K = camera_matrix([[fu, 0.0, pu], [0.0, fv, pv], [0.0, 0.0, 1.0]], f"{file.name}: intrinsics")
    found = CameraCalibration(K, lens, _transform(files, camera), width, height)
    check_looks_ahead(found, files.get(TRANSFORM, file).name, T_ego_lidar)
    return found


def write(path: Path, camera: CameraCalibration) -> None:
    """SourceError for a lens that radtan's four numbers cannot represent."""
    if camera.distortion.size > 4 and np.any(camera.distortion[4:]):
        raise SourceError("Kalibr's radtan has four distortion coefficients; this camera has more")
    K, lens = camera.K, np.zeros(4)
    lens[: min(4, camera.distortion.size)] = camera.distortion[:4]
    chain = {
        _CAMERA: {
            "camera_model": "pinhole",
            "intrinsics": [float(each) for each in (K[0, 0], K[1, 1], K[0, 2], K[1, 2])],
            "distortion_model": "radtan",
            "distortion_coeffs": lens.tolist(),
            "resolution": [camera.width, camera.height],
            "rostopic": "/camera/image_raw",
        }
    }
    files = {CHAIN: chain, TRANSFORM: {_FORWARD[0]: camera.T_camera_ego.tolist()}}
    texts = {name: yaml.safe_dump(content, sort_keys=False, default_flow_style=None) for name, content in files.items()}
    write_new_files(path, texts)


def _transform(files: CalibrationFiles, camera: Mapping[str, Any]) -> F64:
    """T_camera_lidar of the chain, else of the file beside it."""
    places = [(files[CHAIN].name, camera)]
    if TRANSFORM in files:
        places.append((files[TRANSFORM].name, yaml_mapping(files[TRANSFORM])))
    for file, given in places:
        for name in (*_FORWARD, *_BACKWARD):
            if name in given:
                T = rigid_transform(given[name], f"{file}: {name}")
                return T if name in _FORWARD else inverse(T)
    names = " or ".join([files[CHAIN].name, files[TRANSFORM].name if TRANSFORM in files else TRANSFORM])
    raise SourceError(f"no {_FORWARD[0]} in {names}")
