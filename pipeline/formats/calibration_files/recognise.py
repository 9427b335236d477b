"""Which format the files of a calibration have, by their content; people name them as they like."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.formats.calibration_files import FORMATS, Format, kalibr, kitti, ros
from pipeline.formats.calibration_files.contents import GivenFile
from pipeline.types import F64, CameraCalibration
from pipeline.types.source import SourceError

_SIGNS: tuple[tuple[tuple[bytes, ...], str, str | None], ...] = (
    ((b"opencv-matrix",), "opencv", None),
    ((b"cam0:",), "kalibr", kalibr.CHAIN),
    ((b"T_cam_lidar", b"T_camera_lidar", b"T_lidar_cam"), "kalibr", kalibr.TRANSFORM),
    ((b"child_frame_id",), "ros", ros.TRANSFORM),
    ((b"camera_matrix", b"distortion_model"), "ros", ros.INFO),
    ((b"Tr_velo_to_cam", b"Tr_velo_cam", b"P2:"), "kitti", None),
    ((b"P_rect_02",), "kitti", kitti.CAMERAS),
    ((b"delta_f:",), "kitti", kitti.VELODYNE),
    ((b"calib_time:",), "kitti", kitti.IMU),
)
"""Any of these words in a file says of which format it is, and which of its files; the first line that applies."""
_RIG = b"fx_px"
_SENSOR_KIT = b"sensor_kit_base_link"
_PARTS = {
    ros.INFO: "the camera info",
    ros.TRANSFORM: "the static transform",
    kalibr.CHAIN: "the camera chain",
    kalibr.TRANSFORM: "the file with T_cam_lidar",
    kitti.CAMERAS: "calib_cam_to_cam.txt",
    kitti.VELODYNE: "calib_velo_to_cam.txt",
    kitti.IMU: "calib_imu_to_velo.txt",
}
_UNUSED = (kitti.IMU,)
"""Parts without camera and LiDAR, which people give because they are in the same folder."""


def parse_any(
    files: Mapping[str, bytes], size: tuple[int, int] | None, T_ego_lidar: F64 | None = None
) -> tuple[Format, CameraCalibration]:
    """The format and the calibration. files: content by name. size: width and height of the images, for formats that do
    not store them. T_ego_lidar: as for ``Format.parse``. SourceError names what is missing, mixed up or cannot be
    meant."""
    kinds: dict[str, dict[str, GivenFile]] = {}
    for name, data in files.items():
        kind, part = _sign(name, data)
        if (part or name) in kinds.setdefault(kind, {}):
            raise SourceError(f"{name}: {_PARTS.get(part or '', 'a calibration')} is given twice")
        kinds[kind][part or name] = GivenFile(name, data)
    if len(kinds) != 1:
        titles = " and ".join(FORMATS[kind].title for kind in kinds)
        raise SourceError(f"files of {titles}: give those of one calibration" if kinds else "no file is given")
    ((kind, parts),) = kinds.items()
    chosen = FORMATS[kind]
    assert chosen.parse is not None
    parts = {part: file for part, file in parts.items() if part not in _UNUSED}
    whole = parts.keys() - set(chosen.names)
    if whole and len(parts) > 1:
        raise SourceError(f"{len(parts)} files of {chosen.title}: give one")
    missing = [name for name in chosen.names if name not in parts]
    if missing and chosen.needs_all and not whole:
        raise SourceError(f"{_PARTS[missing[0]]} is missing: {chosen.title} needs two files, give both")
    return chosen, chosen.parse(parts, size, T_ego_lidar)


def _sign(name: str, data: bytes) -> tuple[str, str | None]:
    for words, kind, part in _SIGNS:
        if any(word in data for word in words):
            return kind, part
    if _RIG in data:
        raise SourceError(f"{name}: a rig file describes a recording; put it beside the recording")
    if _SENSOR_KIT in data:
        raise SourceError(
            f"{name}: Autoware's sensor kit has the mounts of many sensors; give the transform between the camera's "
            "optical frame and the LiDAR as a TransformStamped"
        )
    readable = [each.title for each in FORMATS.values() if each.parse is not None]
    raise SourceError(f"{name}: not a calibration of {', '.join(readable[:-1])} or {readable[-1]}")
