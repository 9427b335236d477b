"""Images without a LiDAR: a video file, or a folder of images, with a GNSS track beside it if there is one.

Without a calibration, the camera is assumed to be a dash cam: looking straight ahead, with a diagonal field of view of
78°, 1.3 m above the road. The notes say so; ``NAME.yaml`` beside the recording, or ``hfov_deg``, overrides this."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from math import hypot, radians, tan
from pathlib import Path

import numpy as np

from pipeline.common.fast_replace import evolve
from pipeline.common.nearest_in_time import Timeline
from pipeline.common.time_range import is_time
from pipeline.ego_motion.from_gnss import MotionFromGnss
from pipeline.formats.file_reading import (
    IMAGE_SUFFIXES,
    files_by_name,
    read_bytes,
    read_image,
    recording_file,
    recording_folder,
)
from pipeline.formats.gpx_file import parse_gpx
from pipeline.formats.video_file import VideoFile
from pipeline.source_kinds import VIDEO_SUFFIXES
from pipeline.sources import rig as rig_files
from pipeline.sources.live.config import CalibrationConfig
from pipeline.sources.recognition import recording_around
from pipeline.sources.sidecar_files import FIX_WITHIN_NS, NMEA_SUFFIXES, fixes_of, named
from pipeline.sources.uri_options import number_option, split_options
from pipeline.types import U8, CameraCalibration, CameraImage, Frame, GnssFix, Sweep
from pipeline.types.source import Opening, SourceError, TruthObject

_OPTIONS = ("rate_hz", "hfov_deg", "height_m", "nmea", "gpx", "rig", "gnss_offset_s")
_RANGES = {"rate_hz": (0.01, 1000.0), "hfov_deg": (10.0, 170.0), "height_m": (0.1, 10.0)}
"""Of options: from slow time lapses to high-speed cameras, from telephoto to wide-angle lenses, from low cars to
trucks. With them, every image size that is accepted gives a focal length that is accepted."""
_SIZES_PX = (16, 16384)
"""Of images, as in ``CalibrationConfig``."""
_RATE_HZ = 10.0
"""Frames per second used from a video: more do not improve tracking, but each costs a network run."""
_DIAGONAL_DEG, _HEIGHT_M = 78.0, 1.3
_EPOCH_NS = 631_152_000 * 1_000_000_000
"""1990: smaller numbers in names are image counters."""
_STAMP = re.compile(r"^\d{16}(\d{3})?$")


def open_video(uri: str, rest: str, how: Opening) -> CameraAlone:
    """``video:FILE?rate_hz=10&hfov_deg=70&…``. Loaded by name from ``pipeline.source_kinds``. SourceError if it cannot
    be opened."""
    path, options = split_options(rest, _OPTIONS)
    file = recording_file(path)
    video = VideoFile(file, how.progress)
    wanted_hz = _in_range(options, "rate_hz", _RATE_HZ)
    steps = np.diff(video.times_ns)
    recorded_hz = 1e9 / float(np.median(steps)) if len(steps) else wanted_hz
    every = max(1, round(recorded_hz / wanted_hz))
    taken = range(0, len(video.times_ns), every)
    notes = [f"{recorded_hz:.0f} images per second; every {_ordinal(every)} is used"] if every > 1 else []
    return CameraAlone(
        uri, file, options, video.times_ns[::every].tolist(), lambda index: (video.image(taken[index]), None), notes
    )


def open_images(uri: str, rest: str, how: Opening) -> CameraAlone:
    """``pictures:DIR?rate_hz=10&…``, in order of name. Names of 16 or 19 digits are µs or ns since 1970. Loaded by name
    from ``pipeline.source_kinds``. SourceError if it cannot be opened."""
    path, options = split_options(rest, _OPTIONS)
    folder = recording_folder(path)
    files = files_by_name(folder, IMAGE_SUFFIXES)
    if not files:
        raise SourceError(f"{path}: contains no .jpg, .jpeg or .png images")
    names, paths = list(files), list(files.values())
    times = [_stamp_ns(name) for name in names]
    stamped = all(times) and bool(np.all(np.diff(times) > 0))
    step_ns = round(1e9 / _in_range(options, "rate_hz", _RATE_HZ))
    ticks = times if stamped else [index * step_ns for index in range(len(names))]
    notes = _about_neighbours(folder)
    notes += [] if stamped else [f"no timestamps in the names: {1e9 / step_ns:g} Hz assumed; ?rate_hz= overrides it"]
    return CameraAlone(uri, folder, options, ticks, lambda index: read_image(paths[index]), notes, names)


class CameraAlone:
    """A recording of images only. ticks: ns of each, ascending. read: returns (image, JPEG file or None) of each."""

    def __init__(
        self,
        uri: str,
        path: Path,
        options: dict[str, str],
        ticks: Sequence[int],
        read: Callable[[int], tuple[U8, bytes | None]],
        notes: list[str],
        names: Sequence[str] | None = None,
    ) -> None:
        self.uri, self.title = uri, path.resolve().stem
        self._read, self._names = read, names
        notes = [*notes]
        rig_file = named(path, options, "rig", rig_files.SUFFIXES)
        rig = rig_files.load_rig(rig_file) if rig_file is not None else rig_files.Rig()
        fixes = _track(path, options, ticks[0], notes)
        if fixes and not fixes[0].t_ns <= ticks[0] <= fixes[-1].t_ns:
            # a video's clock starts at zero: the track is assumed to start with it
            begin = fixes[0].t_ns + round(number_option(options, "gnss_offset_s", 0.0) * 1e9)
            ticks = [begin + tick - ticks[0] for tick in ticks]
            notes.append("the GNSS track is assumed to start with the images; ?gnss_offset_s= shifts it")
        self._ticks = ticks
        steps = np.diff(ticks)
        self.rate_hz = round(1e9 / float(np.median(steps)), 2) if len(steps) else _RATE_HZ
        self._fixes = Timeline([fix.t_ns for fix in fixes], fixes)
        follow = MotionFromGnss()
        own = [follow.push(fix) for fix in fixes]
        self._own = Timeline([each.t_ns for each in own], own)
        self._given, self._options = rig.camera_calibration(), options
        self._camera = self._given or self._assumed(notes)
        self.notes = (*notes, "no LiDAR: distances come from the camera alone", *([] if fixes else [_NO_SPEED]))

    def __len__(self) -> int:
        return len(self._ticks)

    def t_ns(self, index: int) -> int:
        if not 0 <= index < len(self):
            raise IndexError(f"frame {index} of {len(self)}")
        return self._ticks[index]

    def frame(self, index: int) -> Frame:
        t_ns, notes = self.t_ns(index), list[str]()
        image = self._image(index, t_ns, notes)
        camera = self._calibration_for(image, notes)
        return evolve(self._outline(index), image=image, camera=camera, notes=tuple(notes))

    def outlines(self) -> Iterator[Frame]:
        return (self._outline(index) for index in range(len(self)))

    def sweep(self, index: int) -> Sweep | None:
        self.t_ns(index)
        return None

    def truth(self, index: int) -> tuple[TruthObject, ...] | None:
        self.t_ns(index)
        return None

    def _outline(self, index: int) -> Frame:
        t_ns = self.t_ns(index)
        name = self._names[index] if self._names is not None else f"{index:06d}"
        ego, gnss = self._own.latest(t_ns, FIX_WITHIN_NS), self._fixes.latest(t_ns, FIX_WITHIN_NS)
        return Frame(index, name, t_ns, camera=self._camera, ego=ego, gnss=gnss)

    def _image(self, index: int, t_ns: int, notes: list[str]) -> CameraImage | None:
        try:
            bgr, encoded = self._read(index)
        except SourceError as error:
            notes.append(str(error))
            return None
        return CameraImage(t_ns, bgr, encoded)

    def _calibration_for(self, image: CameraImage | None, notes: list[str]) -> CameraCalibration | None:
        """The given calibration if the image fits it; an assumed one is assumed for images of any size."""
        if self._given is not None or self._camera is None or image is None:
            return rig_files.calibration_for(self._camera, image, notes)
        height, width = image.bgr.shape[:2]
        if (width, height) == (self._camera.width, self._camera.height):
            return self._camera
        return _dash_cam(width, height, self._options) if _is_camera_size(width, height) else None

    def _assumed(self, notes: list[str]) -> CameraCalibration | None:
        """A dash cam's calibration with the size of the first readable image."""
        for index in range(len(self)):
            image = self._image(index, 0, [])
            if image is not None:
                break
        else:
            return None
        height, width = image.bgr.shape[:2]
        if not _is_camera_size(width, height):
            raise SourceError(
                f"{self.title}: images of {width}×{height} pixels; they need {_SIZES_PX[0]} to {_SIZES_PX[1]}"
            )
        if "hfov_deg" not in self._options:
            notes.append(
                f"no calibration: a dash cam with a diagonal field of view of {_DIAGONAL_DEG:.0f}°, looking straight "
                "ahead, is assumed; set the real one with ?hfov_deg= or a .yaml file beside it"
            )
        return _dash_cam(width, height, self._options)


def _about_neighbours(folder: Path) -> list[str]:
    """What a folder of images has beside them, or what it is a part of: the user may have meant that."""
    around = recording_around(folder)
    if around is not None:
        return [f"these images are a part of the recording {around}; open that folder to use its other sensors, too"]
    notes = []
    sweeps = len(files_by_name(folder, (".bin",)))
    if sweeps:
        notes.append(
            f"{sweeps} .bin beside the images not used: sweeps are read from PCD files or the folders of a data set"
        )
    videos = list(files_by_name(folder, VIDEO_SUFFIXES).values())
    if videos:
        notes.append(f"{videos[0].name} beside the images not used: open it by its own name")
    return notes


_NO_SPEED = "no ego speed recorded"


def _is_camera_size(width: int, height: int) -> bool:
    return all(_SIZES_PX[0] <= size <= _SIZES_PX[1] for size in (width, height))


def _dash_cam(width: int, height: int, options: dict[str, str]) -> CameraCalibration:
    """The assumed calibration for images of a size."""
    if "hfov_deg" in options:
        focal = 0.5 * width / tan(radians(_in_range(options, "hfov_deg", 70.0)) / 2.0)
    else:
        focal = 0.5 * hypot(width, height) / tan(radians(_DIAGONAL_DEG) / 2.0)
    pinhole = CalibrationConfig(
        fx_px=focal, fy_px=focal, cx_px=width / 2, cy_px=height / 2, width_px=width, height_px=height
    )
    return evolve(pinhole.calibration(), road_z_m=-_in_range(options, "height_m", _HEIGHT_M))


def _track(path: Path, options: dict[str, str], near_ns: int, notes: list[str]) -> list[GnssFix]:
    """The fixes in a file beside the recording, in order of time; empty without one, and, with a note, for a damaged
    one that no option names."""
    try:
        return _fixes(path, options, near_ns, notes)
    except SourceError as error:
        if "gpx" in options or "nmea" in options:
            raise
        notes.append(f"no GNSS track: {error}")
        return []


def _fixes(path: Path, options: dict[str, str], near_ns: int, notes: list[str]) -> list[GnssFix]:
    gpx = named(path, options, "gpx", (".gpx",)) or _the_only_one(path, options, (".gpx",))
    if gpx is not None:
        fixes = parse_gpx(read_bytes(gpx).decode("utf-8", "replace"), gpx.name)
        notes.append(f"{len(fixes)} GNSS fixes from {gpx.name}")
        return fixes
    nmea = named(path, options, "nmea", NMEA_SUFFIXES) or _the_only_one(path, options, NMEA_SUFFIXES)
    return sorted(fixes_of(nmea, near_ns, notes), key=lambda fix: fix.t_ns) if nmea is not None else []


def _the_only_one(path: Path, options: dict[str, str], suffixes: tuple[str, ...]) -> Path | None:
    """The track file in a folder of images, or beside the only video of a folder, whatever its name; None if there are
    several, or if an option names one."""
    folder = path if path.is_dir() else path.parent
    if "gpx" in options or "nmea" in options or (path.is_file() and len(files_by_name(folder, VIDEO_SUFFIXES)) > 1):
        return None
    found = [each for each in files_by_name(folder, suffixes).values()]
    return found[0] if len(found) == 1 else None


def _in_range(options: dict[str, str], name: str, otherwise: float) -> float:
    value, (least, most) = number_option(options, name, otherwise), _RANGES[name]
    if not least <= value <= most:
        raise SourceError(f"{name}={options[name]}: must be between {least:g} and {most:g}")
    return value


def _stamp_ns(name: str) -> int:
    """The time in an image's name; 0 if there is none."""
    if not _STAMP.match(name):
        return 0
    t_ns = int(name) * (1000 if len(name) == 16 else 1)
    return t_ns if t_ns > _EPOCH_NS and is_time(t_ns) else 0


def _ordinal(number: int) -> str:
    return {2: "second", 3: "third"}.get(number, f"{number}th")
