"""Which format the files of a calibration have, by their content; people name them as they like."""

from __future__ import annotations

from pipeline.formats.calibration_files import FORMATS, Format, kalibr, ros
from pipeline.formats.calibration_files.contents import CalibrationFiles
from pipeline.types import CameraCalibration
from pipeline.types.source import SourceError

_SIGNS: tuple[tuple[tuple[bytes, ...], str, str | None], ...] = (
    ((b"opencv-matrix",), "opencv", None),
    ((b"cam0:",), "kalibr", kalibr.CHAIN),
    ((b"T_cam_lidar", b"T_camera_lidar", b"T_lidar_cam"), "kalibr", kalibr.TRANSFORM),
    ((b"child_frame_id",), "ros", ros.TRANSFORM),
    ((b"camera_matrix", b"distortion_model"), "ros", ros.INFO),
    ((b"Tr_velo_to_cam", b"P2:"), "kitti", None),
)
"""Any of these words in a file says of which format it is, and which of its files; the first line that applies."""
_RIG = b"fx_px"
_PARTS = {
    ros.INFO: "the camera info",
    ros.TRANSFORM: "the static transform",
    kalibr.CHAIN: "the camera chain",
    kalibr.TRANSFORM: "the file with T_cam_lidar",
}


def parse_any(files: CalibrationFiles, size: tuple[int, int] | None) -> tuple[Format, CameraCalibration]:
    """The format and the calibration. size: width and height of the images, for formats that do not store them.
    SourceError names what is missing, mixed up or cannot be meant."""
    kinds: dict[str, dict[str, bytes]] = {}
    for name, data in files.items():
        kind, part = _sign(name, data)
        if (part or name) in kinds.setdefault(kind, {}):
            raise SourceError(f"{name}: {_PARTS.get(part or '', 'a calibration')} is given twice")
        kinds[kind][part or name] = data
    if len(kinds) != 1:
        titles = " and ".join(FORMATS[kind].title for kind in kinds)
        raise SourceError(f"files of {titles}: give those of one calibration" if kinds else "no file is given")
    ((kind, parts),) = kinds.items()
    chosen = FORMATS[kind]
    assert chosen.parse is not None
    if not chosen.names and len(parts) > 1:
        raise SourceError(f"{len(parts)} files of {chosen.title}: give one")
    if kind == "ros" and (missing := set(chosen.names) - set(parts)):
        raise SourceError(f"{_PARTS[missing.pop()]} is missing: {chosen.title} needs two files, give both")
    return chosen, chosen.parse(parts, size)


def _sign(name: str, data: bytes) -> tuple[str, str | None]:
    for words, kind, part in _SIGNS:
        if any(word in data for word in words):
            return kind, part
    if _RIG in data:
        raise SourceError(f"{name}: a rig file describes a recording; put it beside the recording")
    readable = [each.title for each in FORMATS.values() if each.parse is not None]
    raise SourceError(f"{name}: not a calibration of {', '.join(readable[:-1])} or {readable[-1]}")
