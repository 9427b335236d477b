"""RADIATE (Sheeny et al. 2021): HDL-32E, left ZED camera and GNSS/INS in bad weather, by the format of its SDK.

``velo_lidar/*.csv``, ``zed_left/*.png`` and ``GPS_IMU_Twist/*.txt``, each with an index of the files' times beside it,
``velo_lidar.txt`` and so on. The ego frame is the LiDAR's place with x forward: in the files y looks ahead and x to the
right. The boxes are drawn on radar images, without a height, and are not read.

Mounts and the camera's calibration are those of the SDK's ``default-calib.yaml``; ``rig.yaml`` in the folder, or
``?rig=``, gives others.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pipeline.common.geometry import inverse
from pipeline.common.nearest_in_time import Times, nearest
from pipeline.common.time_range import is_time
from pipeline.formats.file_reading import files_by_name, image_of, image_size, read_bytes, recording_folder
from pipeline.formats.text_rows import parse_rows
from pipeline.sources import rig as rig_files
from pipeline.sources.sidecar_files import IMAGE_WITHIN_NS
from pipeline.sources.uri_options import split_options
from pipeline.types import F32, F64, U8, CameraCalibration, EgoState, Frame, GnssFix, Sweep
from pipeline.types.frame import SLOWEST_COURSE_MPS
from pipeline.types.source import Opening, SourceError, TruthObject

_CHANNELS = 32
_COLUMNS = 5  # x y z intensity ring
_NO_IMAGES = "no images: no zed_left/*.png whose time is in zed_left.txt"
_STATE_WITHIN_NS = 500_000_000
_STAMP = re.compile(rb"Frame:\s*(\d{1,9})\s+Time:\s*(\d{1,10})\.(\d{1,9})\s*$")
_ROAD_Z_M = -2.1
"""From the LiDAR's road returns at 4 to 12 m in the SDK's sample; the files do not contain its height."""
_SIZE = (672, 376)
_K = np.array([[337.9191448899105, 0.0, 341.7366010946575], [0.0, 338.6957068549526, 200.7359735313929], [0, 0, 1.0]])
_DISTORTION = np.array([-0.183879883467351, 0.0308609205858947, 0.0, 0.0])
_TURNS_DEG, _OFFSET_M = (-1.2787805, 0.530414, 0.000802), (0.26029, -0.05021277, -0.037881)
"""From the LiDAR to the left camera: differences of both rotations and translations in ``default-calib.yaml``."""
_T_EGO_LIDAR = np.array([[0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


class TimedFiles(NamedTuple):
    """The files of one sensor."""

    times_ns: Times
    """(N,) int64, ascending."""
    paths: list[Path]
    """Path for each time."""


def open_recording(uri: str, rest: str, how: Opening) -> RadiateSource:
    """``radiate:DIR?rig=FILE``. Loaded by name from ``pipeline.source_kinds``. SourceError if it cannot be opened."""
    return RadiateSource(uri, rest)


class RadiateSource:
    """One sequence."""

    def __init__(self, uri: str, rest: str) -> None:
        path, options = split_options(rest, ("rig",))
        folder = recording_folder(path)
        self.uri, self.title = uri, folder.resolve().name
        sweeps = _files_in_time(folder, "velo_lidar", (".csv",))
        if not sweeps.paths:
            raise SourceError(f"{path}: not a RADIATE sequence: no velo_lidar/*.csv whose time is in velo_lidar.txt")
        self._ticks: list[int] = sweeps.times_ns.tolist()
        self._sweeps = sweeps.paths
        self._images = _files_in_time(folder, "zed_left", (".png", ".jpg"))
        self._states = _files_in_time(folder, "GPS_IMU_Twist", (".txt",))
        self._size = image_size(self._images.paths[:3]) or _SIZE
        rig_file = rig_files.rig_in_folder(folder, options)
        rig = rig_files.load_rig(rig_file) if rig_file is not None else rig_files.Rig()
        self._camera = rig.camera_calibration() or default_camera()
        steps = np.diff(self._ticks)
        self.rate_hz = round(1e9 / float(np.median(steps)), 1) if len(steps) and np.median(steps) > 0 else 10.0
        self.notes = self._about(rig_file)

    def __len__(self) -> int:
        return len(self._ticks)

    @property
    def T_ego_stored(self) -> F64:
        return _T_EGO_LIDAR

    def t_ns(self, index: int) -> int:
        if not 0 <= index < len(self):
            raise IndexError(f"frame {index} of {len(self)}")
        return self._ticks[index]

    def frame(self, index: int) -> Frame:
        t_ns, notes = self.t_ns(index), list[str]()
        sweep = self._sweep(index, notes)
        image = None
        if self._images.paths:
            at = nearest(self._images.times_ns, t_ns, IMAGE_WITHIN_NS)
            stamp = int(self._images.times_ns[at]) if at is not None else None
            image = image_of(self._images.paths[at] if at is not None else None, stamp, self._size, notes)
        else:
            notes.append(_NO_IMAGES)
        camera = rig_files.calibration_for(self._camera, image, notes)
        ego, gnss = self._state(t_ns, notes)
        return Frame(index, self._name(index), t_ns, sweep, image, camera, ego, notes=tuple(notes), gnss=gnss)

    def outlines(self) -> Iterator[Frame]:
        for index, t_ns in enumerate(self._ticks):
            ego, gnss = self._state(t_ns, [])
            yield Frame(index, self._name(index), t_ns, camera=self._camera, ego=ego, gnss=gnss)

    def sweep(self, index: int) -> Sweep | None:
        self.t_ns(index)
        return self._sweep(index, [])

    def truth(self, index: int) -> tuple[TruthObject, ...] | None:
        self.t_ns(index)
        return None

    def _name(self, index: int) -> str:
        return self._sweeps[index].stem

    def _sweep(self, index: int, notes: list[str]) -> Sweep | None:
        path = self._sweeps[index]
        try:
            points, ring = parse_sweep(read_bytes(path), path.name, notes)
        except SourceError as error:
            notes.append(str(error))
            return None
        return Sweep(self._ticks[index], points, ring, _CHANNELS)

    def _state(self, t_ns: int, notes: list[str]) -> tuple[EgoState | None, GnssFix | None]:
        at = int(np.searchsorted(self._states.times_ns, t_ns, side="right")) - 1
        if at < 0 or t_ns - int(self._states.times_ns[at]) > _STATE_WITHIN_NS:
            return None, None
        path = self._states.paths[at]
        try:
            return parse_state(read_bytes(path), path.name, int(self._states.times_ns[at]))
        except SourceError as error:
            notes.append(str(error))
            return None, None

    def _about(self, rig_file: Path | None) -> tuple[str, ...]:
        notes = [] if rig_file is not None else ["mounts and calibration are those of RADIATE's default-calib.yaml"]
        if not self._images.paths:
            notes.append(_NO_IMAGES)
        if not self._states.paths:
            notes.append("no ego speed recorded")
        return tuple(notes)


def parse_sweep(data: bytes, file: str, notes: list[str]) -> tuple[F32, U8]:
    """(N, 4) float32 ``x y z intensity`` in the ego frame and (N,) uint8 ring from lines ``x,y,z,intensity,ring``.
    Invalid lines are left out and counted in ``notes``. SourceError if none is left."""
    rows, bad = parse_rows(data.replace(b",", b" "), _COLUMNS)
    bad -= 1 if data.lstrip()[:1].isalpha() else 0  # a header
    good = np.all(np.abs(rows[:, :3]) < 1000.0, axis=1) & (rows[:, 3] >= 0.0) & (rows[:, 3] <= 255.0)
    good &= (rows[:, 4] >= 0.0) & (rows[:, 4] < _CHANNELS) & np.any(rows[:, :3] != 0.0, axis=1)
    kept = rows[good]
    if not len(kept):
        raise SourceError(f"{file}: no LiDAR points")
    if bad + len(rows) - len(kept):
        notes.append(f"{file}: {bad + len(rows) - len(kept)} unreadable rows skipped")
    points = np.empty((len(kept), 4), dtype=np.float32)
    points[:, :3] = kept[:, :3] @ _T_EGO_LIDAR[:3, :3].T
    points[:, 3] = kept[:, 3]
    return points, kept[:, 4].astype(np.uint8)


def parse_state(data: bytes, file: str, t_ns: int) -> tuple[EgoState, GnssFix]:
    """Own motion and position from a ``GPS_IMU_Twist`` file of 18 lines: the first is latitude, longitude and height,
    the next three the covariance of the position, the last two the velocities north, east and down and the turn rates
    about forward, right and down. SourceError names the file."""
    lines = [line for line in data.decode("utf-8", "replace").splitlines() if line.strip()]
    try:
        rows = [[float(word) for word in line.split(",")] for line in lines]
        (lat_deg, lon_deg, alt_m), (north, east, _), (_, _, down_radps) = rows[0], rows[16], rows[17]
        sigma_m = math.sqrt(max(rows[1][0], rows[2][1]))  # ValueError for a negative one
        numbers = np.array([lat_deg, lon_deg, alt_m, north, east, down_radps, sigma_m])
    except (ValueError, IndexError, TypeError):
        raise SourceError(f"{file}: not a record of the GNSS/INS") from None
    is_place = abs(lat_deg) < 89.0 and abs(lon_deg) <= 180.0
    if not np.isfinite(numbers).all() or not is_place or np.abs(numbers[3:]).max() > 200.0:
        raise SourceError(f"{file}: not a record of the GNSS/INS")
    speed_mps = float(np.hypot(north, east))
    course_rad = float(np.arctan2(east, north) % (2.0 * np.pi)) if speed_mps >= SLOWEST_COURSE_MPS else None
    ego = EgoState(t_ns, speed_mps, -down_radps, source="ins")
    fix = GnssFix(t_ns, lat_deg, lon_deg, alt_m, course_rad, speed_mps, "dgnss", max(sigma_m, 0.01))
    return ego, fix


def default_camera() -> CameraCalibration:
    """The left camera of ``default-calib.yaml``; images are raw, not rectified."""
    x, y, z = np.radians(_TURNS_DEG)
    Rx = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    Ry = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    Rz = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
    to_lidar_axes = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    T_camera_lidar = np.eye(4)
    T_camera_lidar[:3, :3], T_camera_lidar[:3, 3] = (to_lidar_axes @ Rx @ Ry @ Rz).T, _OFFSET_M
    T_camera_ego: F64 = T_camera_lidar @ inverse(_T_EGO_LIDAR)
    return CameraCalibration(_K, _DISTORTION, T_camera_ego, *_SIZE, road_z_m=_ROAD_Z_M)


def _files_in_time(folder: Path, name: str, suffixes: tuple[str, ...]) -> TimedFiles:
    """The files of a sensor with known times. File numbers are those of the index; if they restart at 1, as in a
    cut-out sequence, they count its lines."""
    files = {int(stem): path for stem, path in files_by_name(folder / name, suffixes).items() if stem.isdecimal()}
    try:
        lines = read_bytes(folder / f"{name}.txt").splitlines()
    except SourceError:
        lines = []
    found = [match for line in lines if (match := _STAMP.match(line.strip()))]
    numbered = [(int(each[1]), int(each[2]) * 1_000_000_000 + int(each[3].ljust(9, b"0"))) for each in found]
    by_number = {number: t_ns for number, t_ns in numbered if is_time(t_ns)}
    if not files.keys() <= by_number.keys():
        by_number = {k: t_ns for k, (_, t_ns) in enumerate(numbered, start=1) if is_time(t_ns)}
    known = sorted((by_number[number], path) for number, path in files.items() if number in by_number)
    return TimedFiles(np.array([t_ns for t_ns, _ in known], dtype=np.int64), [path for _, path in known])
