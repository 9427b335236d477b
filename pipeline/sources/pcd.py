"""A folder of PCD files as a recording, ordered by name, with images of the same names.

A name that is a number of nanoseconds, microseconds or seconds since 1970 is the sweep's time; otherwise, 10 Hz is
assumed. Images are in the same folder, or in one named ``images``, ``image``, ``camera`` or ``image_02``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from pipeline.common.time_range import is_time
from pipeline.formats.file_reading import (
    IMAGE_SUFFIXES,
    files_by_name,
    image_of,
    image_size,
    read_bytes,
    recording_folder,
)
from pipeline.formats.pcd_file import parse_pcd
from pipeline.formats.point_cloud_fields import cloud_of
from pipeline.sources import rig as rig_files
from pipeline.sources.uri_options import split_options
from pipeline.types import Frame, Sweep
from pipeline.types.source import Opening, SourceError, TruthObject

_STEP_NS = 100_000_000
_IMAGES = ("", "images", "image", "camera", "image_02")
_CLOUDS = ("", "pcd", "lidar", "velodyne", "points")
_NUMBER = re.compile(r"^\d+(\.\d+)?$")
_EPOCH_S = 631_152_000  # 1990: smaller numbers count frames
_UNITS_NS = ((10**18, 1), (10**15, 1_000), (10**12, 1_000_000))


def open_recording(uri: str, rest: str, how: Opening) -> PcdSource:
    """Loaded by name from ``pipeline.source_kinds``. SourceError if it cannot be opened."""
    return PcdSource(uri, rest)


class PcdSource:
    """``<folder>?rig=file.yaml``. A file ``rig.yaml`` in the folder is used by default."""

    def __init__(self, uri: str, rest: str) -> None:
        path, options = split_options(rest, ("rig",))
        folder = recording_folder(path)
        self.uri, self.title = uri, folder.resolve().name
        self._sweeps = next((found for name in _CLOUDS if (found := files_by_name(folder / name, (".pcd",)))), {})
        if not self._sweeps:
            raise SourceError(f"{path}: contains no PCD files")
        self._names = list(self._sweeps)
        self._images = next((found for name in _IMAGES if (found := files_by_name(folder / name, IMAGE_SUFFIXES))), {})
        self._size = image_size(self._images.values()) or (0, 0)
        rig_file = rig_files.rig_in_folder(folder, options)
        rig = rig_files.load_rig(rig_file) if rig_file is not None else rig_files.Rig()
        self.T_ego_lidar, self._camera = rig.lidar.mount.T_ego_sensor(), rig.camera_calibration()
        stamps = [_stamp_ns(name) for name in self._names]
        known = [stamp for stamp in stamps if stamp is not None]
        self._has_times = len(known) == len(stamps) and bool(np.all(np.diff(known) > 0))
        self._ticks = known if self._has_times else [index * _STEP_NS for index in range(len(self._names))]
        steps = np.diff(self._ticks)
        self.rate_hz = round(1e9 / float(np.median(steps)), 2) if len(steps) else 10.0
        self.notes = self._about()

    def __len__(self) -> int:
        return len(self._names)

    def t_ns(self, index: int) -> int:
        if not 0 <= index < len(self):
            raise IndexError(f"frame {index} of {len(self)}")
        return self._ticks[index]

    def frame(self, index: int) -> Frame:
        t_ns, name, notes = self.t_ns(index), self._names[index], list[str]()
        sweep = self._sweep(name, t_ns, notes)
        image = image_of(self._images.get(name), None, self._size, notes) if self._images else None
        camera = rig_files.calibration_for(self._camera, image, notes)
        return Frame(index, name, t_ns, sweep, image, camera, notes=tuple(notes))

    def outlines(self) -> Iterator[Frame]:
        """All images of a camera have one size: the first one shows whether the calibration matches."""
        first = image_of(next(iter(self._images.values()), None), None, self._size, []) if self._images else None
        camera = rig_files.calibration_for(self._camera, first, [])
        return (Frame(index, name, self.t_ns(index), camera=camera) for index, name in enumerate(self._names))

    def sweep(self, index: int) -> Sweep | None:
        return self._sweep(self._names[index], self.t_ns(index), [])

    def truth(self, index: int) -> tuple[TruthObject, ...] | None:
        self.t_ns(index)
        return None

    def _sweep(self, name: str, t_ns: int, notes: list[str]) -> Sweep | None:
        path = self._sweeps[name]
        try:
            cloud = cloud_of(parse_pcd(read_bytes(path), path.name, notes), t_ns, notes)
        except SourceError as error:
            notes.append(str(error) if path.name in str(error) else f"{path.name}: {error}")
            return None
        return cloud.sweep(t_ns, self.T_ego_lidar)

    def _about(self) -> tuple[str, ...]:
        notes = [] if self._has_times else ["no timestamps in the file names: 10 Hz assumed"]
        if self._images and self._camera is None:
            notes.append("the camera has no calibration: LiDAR and camera are not fused")
        return (*notes, "no ego speed recorded")


def _stamp_ns(name: str) -> int | None:
    """The time in a file's name; None if there is none."""
    if not _NUMBER.match(name):
        return None
    whole, _, fraction = name.partition(".")
    if len(whole) > 19:
        return None
    value = int(whole)
    for least, unit_ns in _UNITS_NS:
        if value >= least:
            return value * unit_ns if is_time(value * unit_ns) else None
    if value < _EPOCH_S:
        return None
    return value * 1_000_000_000 + int(fraction[:9].ljust(9, "0") if fraction else 0)
