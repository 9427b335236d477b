"""KITTI: HDL-64 and colour camera 2 (Geiger et al. 2013), as raw drives, folders in the object benchmark's form and
odometry sequences; and KITTI-360, with its camera 0.

``pipeline.sources.kitti.layouts`` describes the folders of each layout.

The ego frame is the Velodyne's axes. Intensity, 0–1 in the files, is 0–255 here, like a VLP-16's reflectivity.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np

from pipeline.formats.file_reading import image_of, image_size, read_bytes, recording_folder
from pipeline.formats.float_points import parse_points
from pipeline.formats.kitti_calibration import (
    KittiCalibration,
    parse_360_calibration,
    parse_object_calibration,
    parse_raw_calibration,
)
from pipeline.formats.kitti_records import parse_labels, parse_oxts
from pipeline.sources.driven_way import DrivenWay
from pipeline.sources.kitti.files import Files
from pipeline.sources.kitti.hdl64_rings import (
    NOMINAL_ELEVATIONS_DEG,
    RINGS,
    Turns,
    is_in_order,
    keep_rings,
    match_vlp16,
    ring_elevations_deg,
    rings_by_elevation,
    turns,
)
from pipeline.sources.kitti.kitti360 import drives_in
from pipeline.sources.kitti.layouts import files_of, motion_of, sequence_calibration
from pipeline.types import F32, F64, EgoState, Frame, GnssFix, Sweep
from pipeline.types.source import Opening, SourceError, TruthObject

_STEP_NS = 100_000_000
_NOMINAL_SIZE = (1242, 375)


def open_recording(uri: str, rest: str, how: Opening) -> KittiSource:
    """Loaded by name from ``pipeline.source_kinds``. SourceError if it cannot be opened."""
    return KittiSource(uri, rest, how.rings)


class KittiSource:
    """A KITTI drive. rings: 16 keeps the rings closest to those of a VLP-16, 64 keeps all."""

    def __init__(self, uri: str, path: str, rings: int = 16) -> None:
        if rings not in (16, RINGS):
            raise SourceError(f"{uri}: {rings} rings requested; KITTI supports 16 (like a VLP-16) or 64")
        folder = recording_folder(path)
        self.uri, self.title, self.rate_hz = uri, folder.resolve().name, 10.0
        self._files = files_of(folder)
        self._names = self._files.names
        if not self._names:
            raise SourceError(f"{path}: not a KITTI recording: {_what_it_holds(folder)}")
        # object calibration files do not contain the image size
        self._size = image_size(self._files.images.values()) or _NOMINAL_SIZE
        self._calibration = self._first_calibration(path)
        self._ticks = _ticks(self._names, self._files)
        self._moved = motion_of(self._files, self._calibration)
        self._elevations_deg = self._ring_elevations()
        self._channels = match_vlp16(self._elevations_deg) if rings == 16 else None
        self.notes = self._about()

    def __len__(self) -> int:
        return len(self._names)

    def t_ns(self, index: int) -> int:
        """The time at which the LiDAR faces ahead, when KITTI triggers its cameras; 10 Hz without timestamps."""
        self._name(index)
        return self._ticks[index]

    def frame(self, index: int) -> Frame:
        name, tick = self._name(index), self.t_ns(index)
        notes: list[str] = []
        calibration = self._calibration_of(name, notes)
        sweep = self._sweep(name, tick, notes)
        stamp = _stamp(self._files.camera_stamps, name)
        image = image_of(self._files.images.get(name), stamp, self._size, notes)
        ego, gnss = self._own_motion(name, tick, notes)
        return Frame(index, name, tick, sweep, image, calibration.camera, ego, notes=tuple(notes), gnss=gnss)

    def outlines(self) -> Iterator[Frame]:
        return (self._outline(index) for index in range(len(self)))

    def _outline(self, index: int) -> Frame:
        name, tick, notes = self._name(index), self.t_ns(index), list[str]()
        calibration = self._calibration_of(name, notes)
        ego, gnss = self._own_motion(name, tick, notes)
        return Frame(index, name, tick, camera=calibration.camera, ego=ego, notes=tuple(notes), gnss=gnss)

    def sweep(self, index: int) -> Sweep | None:
        return self._sweep(self._name(index), self.t_ns(index), [])

    def truth(self, index: int) -> tuple[TruthObject, ...] | None:
        name = self._name(index)
        path = self._files.labels.get(name)
        if path is None:
            return None
        try:
            labels = parse_labels(read_bytes(path), self._calibration_of(name, []).T_rect_ego)
        except SourceError:
            return None
        return self._way.placed(self._ticks[index], labels)

    @cached_property
    def _way(self) -> DrivenWay:
        motions = [self._own_motion(name, tick, [])[0] for name, tick in zip(self._names, self._ticks, strict=True)]
        return DrivenWay(self._ticks, motions)

    def T_rect_ego(self, index: int) -> F64:
        """(4, 4), takes ego points to the rectified camera 0, the frame of the labels."""
        return self._calibration_of(self._name(index), []).T_rect_ego

    def _name(self, index: int) -> str:
        if not 0 <= index < len(self._names):
            raise IndexError(f"frame {index} of {len(self._names)}")
        return self._names[index]

    def _sweep(self, name: str, tick: int, notes: list[str]) -> Sweep | None:
        path = self._files.sweeps.get(name)
        if path is None:
            notes.append("no LiDAR file for this frame")
            return None
        try:
            points = parse_velodyne(read_bytes(path), path.name, notes)
        except SourceError as error:
            notes.append(str(error))
            return None
        turn, own_channels = self._rings(points, path.name, notes)
        if self._channels is None:
            return Sweep(tick, points, (RINGS - 1 - turn).astype(np.uint8), RINGS)
        kept, ring = keep_rings(points, turn, own_channels if own_channels is not None else self._channels)
        if not len(kept):
            notes.append(f"{path.name}: none of its rings matches the elevation of a VLP-16 ring")
            return None
        return Sweep(tick, kept, ring, 16)

    def _rings(self, points: F32, file: str, notes: list[str]) -> tuple[Turns, dict[int, int] | None]:
        """The ring of each point, 0 the highest, and the rings that replace a VLP-16's channels if those of the drive
        do not fit this sweep."""
        turn = turns(points)
        count = int(turn.max()) + 1
        elevations_deg = ring_elevations_deg(points, turn, min(count, RINGS))
        if count > RINGS or not is_in_order(elevations_deg):
            notes.append(f"{file}: points are not in KITTI's order; rings are assigned by elevation")
            return rings_by_elevation(points, self._elevations_deg), None
        if count < RINGS:
            notes.append(f"{file}: {count} rings instead of {RINGS}; matched by this sweep's own elevations")
            return turn, match_vlp16(elevations_deg)
        return turn, None

    def _own_motion(self, name: str, tick: int, notes: list[str]) -> tuple[EgoState | None, GnssFix | None]:
        """Own speed and position from the inertial unit; its records are matched by frame number."""
        path = self._files.oxts.get(name)
        if path is None:
            number = int(name) if name.isdecimal() else -1
            return (self._moved[number] if 0 <= number < len(self._moved) else None), None
        try:
            oxts = parse_oxts(read_bytes(path), path.name)
        except SourceError as error:
            notes.append(str(error))
            return None, None
        ego = EgoState(tick, oxts.speed_mps, oxts.yaw_rate_radps, source="ins")
        if oxts.quality is None:
            return ego, None
        place = (oxts.lat_deg, oxts.lon_deg, oxts.alt_m, oxts.course_rad)
        return ego, GnssFix(tick, *place, abs(oxts.speed_mps), oxts.quality, oxts.sigma_m)

    def _calibration_of(self, name: str, notes: list[str]) -> KittiCalibration:
        path = self._files.calibrations.get(name)
        if path is None:
            return self._calibration
        try:
            return parse_object_calibration(read_bytes(path), path.name, self._size)
        except SourceError as error:
            notes.append(f"{error}; the recording's first calibration is used")
            return self._calibration

    def _first_calibration(self, path: str) -> KittiCalibration:
        if self._files.raw_calibration is not None:
            cameras, velodyne = self._files.raw_calibration
            names = (cameras.name, velodyne.name)
            missing = next((file.name for file in (cameras, velodyne) if not file.exists()), None)
            if missing is not None:
                raise SourceError(
                    f"{path}: no calibration: {missing} must be in this folder or in the one above it; it belongs to "
                    "the calibration of the day, which is a download of its own"
                )
            return parse_raw_calibration(read_bytes(cameras), read_bytes(velodyne), names, self._size)
        if self._files.calibration_360 is not None:
            velodyne, cameras = self._files.calibration_360
            names = (velodyne.name, cameras.name)
            return parse_360_calibration(read_bytes(velodyne), read_bytes(cameras), names, self._size)
        if self._files.sequence_calibration is not None:
            return sequence_calibration(self._files.sequence_calibration, self._size)
        if not self._files.calibrations:
            raise SourceError(
                f"{path}: no calibration: neither calib.txt nor calib/*.txt nor calib_cam_to_cam.txt one folder up"
            )
        first = next(iter(self._files.calibrations.values()))
        return parse_object_calibration(read_bytes(first), first.name, self._size)

    def _ring_elevations(self) -> F64:
        """(64,) elevations of the rings in degrees, highest first, from the first complete sweep, because the laser
        mounts do not move within a drive; without one, those of the manual."""
        for path in self._files.sweeps.values():
            try:
                points = parse_velodyne(read_bytes(path), path.name, [])
            except SourceError:
                continue
            turn = turns(points)
            if int(turn.max()) == RINGS - 1:
                elevations_deg = ring_elevations_deg(points, turn, RINGS)
                if is_in_order(elevations_deg) and np.isfinite(elevations_deg).all():
                    return elevations_deg
        return NOMINAL_ELEVATIONS_DEG

    def _about(self) -> tuple[str, ...]:
        notes = []
        if not self._files.sweeps:
            notes.append("no LiDAR: distances come from the camera alone")
        elif self._channels:
            notes.append(f"{len(self._channels)} of a VLP-16's 16 rings remain: the HDL-64 reaches only about +3°")
        if not self._files.lidar_stamps and not self._files.camera_stamps:
            notes.append("no timestamps: 10 Hz assumed")
        notes += self._about_times()
        if not self._files.oxts and not self._moved:
            notes.append("no ego speed recorded")
        return tuple(notes)

    def _about_times(self) -> list[str]:
        """What in the timestamps contradicts a drive: the pipeline relies on them, so damage has to be named."""
        pairs = [(_stamp(self._files.lidar_stamps, n), _stamp(self._files.camera_stamps, n)) for n in self._names]
        apart_ns = max((abs(lidar - camera) for lidar, camera in pairs if lidar and camera), default=0)
        backwards = sum(later <= earlier for earlier, later in pairwise(self._ticks))
        notes = []
        if apart_ns > _STEP_NS:
            notes.append(f"the timestamps of images and sweeps differ by up to {apart_ns / 1e9:.1f} s")
        if backwards:
            notes.append(f"timestamps run backwards in {backwards} of {len(self._ticks)} frames")
        return notes


def parse_velodyne(data: bytes, file: str, notes: list[str]) -> F32:
    """(N, 4) float32 ``x y z intensity`` (0–255) of a Velodyne file, as ``parse_points`` reads it."""
    points = parse_points(data, file, 4, 1.0, notes)
    points[:, 3] *= 255.0
    return points


def _ticks(names: list[str], files: Files) -> list[int]:
    """The tick of every frame; one without a timestamp follows the previous frame by 0.1 s."""
    ticks: list[int] = []
    for name in names:
        stamp = _stamp(files.lidar_stamps, name) or _stamp(files.camera_stamps, name)
        ticks.append(stamp if stamp is not None else ticks[-1] + _STEP_NS if ticks else 0)
    return ticks


def _stamp(stamps: tuple[int, ...], name: str) -> int | None:
    """The timestamp of the frame with this number: lines are counted over the drive, also where a file is missing."""
    number = int(name) if name.isdecimal() else -1
    return stamps[number] if 0 <= number < len(stamps) and stamps[number] else None


def _what_it_holds(folder: Path) -> str:
    drives = sorted(path for path in folder.glob("*_drive_*") if path.is_dir())
    drives = drives or [folder / "data_3d_raw" / name for name in drives_in(folder)]
    if drives:
        return f"it holds drives; open one of them, for example kitti:{drives[0]}"
    return "neither velodyne/*.bin nor velodyne_points/data/*.bin nor images in it"
