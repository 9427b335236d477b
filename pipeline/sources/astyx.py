"""Astyx HiRes2019: a real VLP-16 and a front camera, with boxes (Meyer and Kuschk 2019, "Automotive Radar Dataset").

Layout: ``lidar_vlp16/*.txt``, ``camera_front/*.jpg``, ``calibration/*.json``, ``groundtruth_obj3d/*.json``, with one
file per frame each. The ego frame is the radar's reference frame: every sensor's ``T_to_ref_COS`` transforms to it, so
the camera's is the inverse of ``T_camera_ego``.

Times are the LiDAR's: a sweep starts behind the car and looks ahead half a rotation later, and that moment is the
frame's tick. The camera has no timestamps and is assumed to be at the tick.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.common.files.user_files import open_regular
from pipeline.common.geometry import Cuboid, inverse, transform
from pipeline.formats.file_reading import (
    camera_matrix,
    check_looks_ahead,
    files_by_name,
    image_of,
    image_size,
    in_order,
    read_bytes,
    recording_folder,
    rigid_transform,
)
from pipeline.formats.text_rows import parse_rows
from pipeline.types import F64, CameraCalibration, Frame, Sweep
from pipeline.types.source import Opening, SourceError, TruthObject

_CHANNELS = 16
_HALF_ROTATION_NS = 50_000_000
_NOMINAL_STEP_NS = 300_000_000
_NOMINAL_SIZE = (2048, 618)
"""Image size if no image can be read; the calibration files do not contain it."""
_ROAD_Z_M = -1.55
"""The road's height relative to the radar, which the files do not contain: the median over the fitted ground of its
sweeps."""
_COLUMNS = 6  # X Y Z Reflectivity LaserID Timestamp
_HEAD_BYTES = 4096
_LABELS = {"motorcyclist": "motorcycle", "cyclist": "bicycle", "towed object": "trailer"}
_RING_OF_LASER = np.array([laser // 2 + 8 * (laser % 2) for laser in range(_CHANNELS)], dtype=np.uint8)
"""VLP-16 lasers fire −15°, +1°, −13°, +3°, … (Velodyne manual 63-9243, table 9-1); rings count upwards."""


def open_recording(uri: str, rest: str, how: Opening) -> AstyxSource:
    """Loaded by name from ``pipeline.source_kinds``. SourceError if it cannot be opened."""
    return AstyxSource(uri, rest)


class AstyxSource:
    """A folder of Astyx HiRes2019 frames."""

    def __init__(self, uri: str, path: str) -> None:
        folder = recording_folder(path)
        self.uri, self.title = uri, folder.resolve().name
        self.notes: tuple[str, ...] = ("camera without timestamps: mid-sweep assumed", "no ego speed recorded")
        self._sweeps = files_by_name(folder / "lidar_vlp16", (".txt",))
        self._images = files_by_name(folder / "camera_front", (".jpg", ".jpeg", ".png"))
        self._labels = files_by_name(folder / "groundtruth_obj3d", (".json",))
        self._calibrations = files_by_name(folder / "calibration", (".json",))
        self._names = in_order(self._sweeps.keys() | self._images.keys())
        if not self._names:
            raise SourceError(f"{path}: not an Astyx recording: neither lidar_vlp16/*.txt nor camera_front/*.jpg in it")
        if not self._calibrations:
            raise SourceError(f"{path}: no calibration/*.json")
        self._size = image_size(self._images.values()) or _NOMINAL_SIZE
        self._calibration = _read_calibration(next(iter(self._calibrations.values())), self._size)
        self._stamps = _fill_gaps([_first_stamp_ns(self._sweeps.get(name)) for name in self._names])
        self.rate_hz = _rate_hz(self._stamps)

    def __len__(self) -> int:
        return len(self._names)

    @property
    def T_ego_stored(self) -> F64:
        return self._calibration[0]

    def t_ns(self, index: int) -> int:
        return self._stamps[_checked(index, len(self))]

    def frame(self, index: int) -> Frame:
        name, tick = self._names[_checked(index, len(self))], self.t_ns(index)
        notes: list[str] = []
        T_ego_lidar, camera = self._calibration_of(name, notes)
        sweep = self._sweep(name, tick, T_ego_lidar, notes)
        image = image_of(self._images.get(name), None, self._size, notes)
        return Frame(index, name, tick, sweep, image, camera, notes=tuple(notes))

    def outlines(self) -> Iterator[Frame]:
        return (self._outline(index) for index in range(len(self)))

    def _outline(self, index: int) -> Frame:
        name, notes = self._names[index], list[str]()
        _, camera = self._calibration_of(name, notes)
        return Frame(index, name, self.t_ns(index), camera=camera, notes=tuple(notes))

    def sweep(self, index: int) -> Sweep | None:
        name, tick = self._names[_checked(index, len(self))], self.t_ns(index)
        T_ego_lidar, _ = self._calibration_of(name, [])
        return self._sweep(name, tick, T_ego_lidar, [])

    def truth(self, index: int) -> tuple[TruthObject, ...] | None:
        path = self._labels.get(self._names[_checked(index, len(self))])
        if path is None:
            return None
        try:
            return _parse_labels(read_bytes(path))
        except SourceError:
            return None

    def _calibration_of(self, name: str, notes: list[str]) -> tuple[F64, CameraCalibration]:
        path = self._calibrations.get(name)
        if path is None:
            return self._calibration
        try:
            return _read_calibration(path, self._size)
        except SourceError as error:
            notes.append(f"{error}; the recording's first calibration is used")
            return self._calibration

    def _sweep(self, name: str, tick: int, T_ego_lidar: F64, notes: list[str]) -> Sweep | None:
        path = self._sweeps.get(name)
        if path is None:
            notes.append("no LiDAR file for this frame")
            return None
        try:
            return parse_sweep(read_bytes(path), path.name, tick, T_ego_lidar, notes)
        except SourceError as error:
            notes.append(str(error))
            return None


def parse_sweep(data: bytes, file: str, t_ns: int, T_ego_lidar: F64, notes: list[str]) -> Sweep:
    """The sweep of one LiDAR text file, in the ego frame. Invalid rows (truncated, not numeric, invalid laser, no
    return) are left out and counted in ``notes``. SourceError if none is left."""
    rows, bad = parse_rows(data, _COLUMNS)
    bad -= 1 if data.lstrip()[:1].isalpha() else 0  # the header line
    laser = rows[:, 4]
    good = (laser >= 0) & (laser < _CHANNELS) & (laser == np.floor(laser))
    good &= np.any(rows[:, :3] != 0.0, axis=1) & np.all(np.abs(rows[:, :4]) < 1e6, axis=1)
    kept = rows[good]
    bad += len(rows) - len(kept)
    if not len(kept):
        raise SourceError(f"{file}: no LiDAR points")
    if bad > 0:
        notes.append(f"{file}: {bad} unreadable rows skipped")
    points = np.empty((len(kept), 4), dtype=np.float32)
    points[:, :3] = transform(T_ego_lidar, kept[:, :3])
    points[:, 3] = kept[:, 3]
    x, y, z = T_ego_lidar[:3, 3].tolist()
    return Sweep(t_ns, points, _RING_OF_LASER[kept[:, 4].astype(np.intp)], _CHANNELS, origin=(x, y, z))


def parse_calibration(data: bytes, file: str, size: tuple[int, int]) -> tuple[F64, CameraCalibration]:
    """T_ego_lidar (4, 4) and the camera, from one calibration file. SourceError names the file and what is wrong."""
    try:
        sensors = {str(sensor["sensor_uid"]): sensor["calib_data"] for sensor in json.loads(data)["sensors"]}
        lidar, front = sensors["lidar_vlp16"], sensors["camera_front"]
        to_ego, from_camera, K = lidar["T_to_ref_COS"], front["T_to_ref_COS"], front["K"]
    except (ValueError, TypeError, KeyError, RecursionError):
        raise SourceError(f"{file}: not an Astyx calibration of lidar_vlp16 and camera_front") from None
    T_ego_lidar = rigid_transform(to_ego, f"calibration {file}: T_to_ref_COS of lidar_vlp16")
    T_ego_camera = rigid_transform(from_camera, f"calibration {file}: T_to_ref_COS of camera_front")
    K = camera_matrix(K, f"calibration {file}: K of camera_front")
    camera = CameraCalibration(K, np.empty(0), inverse(T_ego_camera), *size, road_z_m=_ROAD_Z_M)
    check_looks_ahead(camera, f"calibration {file}")
    return T_ego_lidar, camera


def _parse_labels(data: bytes) -> tuple[TruthObject, ...]:
    """The boxes of one label file: centres and sizes in metres, ``orientation_quat`` with w first. All ids in the
    recording are −1, so objects have none."""
    try:
        return tuple(_label(entry) for entry in json.loads(data)["objects"])
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
        raise SourceError("not an Astyx label file") from None


def _label(entry: dict[str, Any]) -> TruthObject:
    x, y, z = (float(value) for value in entry["center3d"])
    length, width, height = (float(value) for value in entry["dimension3d"])
    qw, qx, qy, qz = (float(value) for value in entry["orientation_quat"])
    yaw = float(np.arctan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz)))
    if not np.all(np.isfinite([x, y, z, length, width, height, yaw])) or min(length, width, height) <= 0.0:
        raise ValueError("a box without a position or size")
    name = str(entry["classname"]).lower()
    return TruthObject(_LABELS.get(name, name), Cuboid((x, y, z), (length, width, height), yaw))


def _read_calibration(path: Path, size: tuple[int, int]) -> tuple[F64, CameraCalibration]:
    return parse_calibration(read_bytes(path), path.name, size)


def _first_stamp_ns(path: Path | None) -> int | None:
    """The tick of a sweep: the first row's timestamp (µs since the hour) plus half a rotation. None if unreadable."""
    if path is None:
        return None
    try:
        with open_regular(path) as file:
            head = file.read(_HEAD_BYTES)
    except OSError:
        return None
    rows, _ = parse_rows(head[: head.rfind(b"\n") + 1], _COLUMNS)
    if not len(rows) or not 0 <= rows[0, 5] < 1e12:
        return None
    return int(rows[0, 5]) * 1000 + _HALF_ROTATION_NS


def _fill_gaps(stamps: list[int | None]) -> list[int]:
    """A frame without a timestamp follows the previous one by the recording's usual step."""
    filled: list[int] = []
    for stamp in stamps:
        filled.append(stamp if stamp is not None else filled[-1] + _NOMINAL_STEP_NS if filled else 0)
    return filled


def _rate_hz(stamps: list[int]) -> float:
    """Frames per second within a run: the median step of those under a second."""
    steps = np.diff(np.asarray(stamps, dtype=np.int64))
    steps = steps[(steps > 0) & (steps < 1_000_000_000)]
    return round(1e9 / float(np.median(steps)), 2) if len(steps) else 10.0


def _checked(index: int, count: int) -> int:
    if not 0 <= index < count:
        raise IndexError(f"frame {index} of {count}")
    return index
