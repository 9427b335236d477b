"""Sidecar files of a LiDAR recording: a video, a GNSS receiver's sentences, and a rig file. They are found by the
recording's name, or named by options."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from pipeline.common.fast_replace import evolve
from pipeline.common.files.user_file_errors import given_path, reason_of
from pipeline.common.files.user_files import open_regular
from pipeline.common.nearest_in_time import Timeline, nearest
from pipeline.common.progress import Progress, silent
from pipeline.ego_motion.from_gnss import MotionFromGnss
from pipeline.formats import video_file as video_files
from pipeline.formats.file_reading import files_by_name
from pipeline.formats.nmea import NmeaReader
from pipeline.source_kinds import VIDEO_SUFFIXES
from pipeline.sources import rig as rig_files
from pipeline.sources.uri_options import number_option
from pipeline.types import CameraCalibration, CameraImage, EgoState, Frame, GnssFix, Sweep
from pipeline.types.source import SourceError

OPTIONS = ("video", "video_offset_s", "nmea", "rig")
_LARGEST_NMEA_BYTES = 1 << 30
"""Ten sentences of 80 bytes ten times a second, for more than a day."""
NMEA_SUFFIXES = (".nmea", ".nma", ".ubx.txt")
IMAGE_WITHIN_NS = 100_000_000
"""The image of a sweep is at most this far away in time: a period of 10 Hz."""
FIX_WITHIN_NS = 1_500_000_000
"""A fix is used for as long as this; receivers send once a second or more often."""
_LONGEST_LINE = 1024


class Beside:
    """All data of a frame except its sweep. notes: what was found, and what had to be assumed.

    begin_ns: when the recording begins; its video is assumed to begin at the same time. fixes: positions in the
    recording itself, used if there is no NMEA file beside it. progress: receives the reading progress of a video.
    SourceError for a named file that cannot be used.
    """

    def __init__(
        self,
        recording: Path,
        options: dict[str, str],
        rig: rig_files.Rig,
        begin_ns: int,
        fixes: Iterable[GnssFix] = (),
        progress: Progress = silent,
    ) -> None:
        self.notes: list[str] = []
        self._unreadable: list[str] = []
        self._camera = rig.camera_calibration()
        self._video = self._open_video(named(recording, options, "video", VIDEO_SUFFIXES), "video" in options, progress)
        offset_s = number_option(options, "video_offset_s", 0.0) + rig.camera.time_offset_ms / 1e3
        self._video_begins_ns = begin_ns + round(offset_s * 1e9)
        if self._video is not None and not offset_s:
            self.notes.append("the video is assumed to start with the recording; ?video_offset_s= shifts it")
        if self._video is not None and self._camera is None:
            self.notes.append("the camera has no calibration: LiDAR and camera are not fused")
        sentences = named(recording, options, "nmea", NMEA_SUFFIXES)
        found = fixes_of(sentences, begin_ns, self.notes) if sentences is not None else list(fixes)
        found = [evolve(fix, t_ns=fix.t_ns + round(rig.gnss.time_offset_ms * 1e6)) for fix in found]
        self._fixes = Timeline([fix.t_ns for fix in found], found)
        follow = MotionFromGnss()
        own = [follow.push(fix) for fix in sorted(found, key=lambda fix: fix.t_ns)]
        self._own = Timeline([each.t_ns for each in own], own)
        if not found:
            self.notes.append("no ego speed recorded")

    def frame(self, index: int, t_ns: int, sweep: Sweep | None, notes: list[str]) -> Frame:
        """The frame at ``t_ns``: with the nearest image within 0.1 s and the last fix within 1.5 s."""
        image = self._image(t_ns, notes)
        camera = rig_files.calibration_for(self._camera, image, notes)
        outline = self._outline(index, t_ns, camera)
        return evolve(outline, sweep=sweep, image=image, notes=tuple(notes))

    def outlines(self, times_ns: Sequence[int]) -> Iterator[Frame]:
        """Like ``frame`` without sweep and image, one for each of these times. All images of a video have one size: the
        first one shows whether the calibration matches."""
        first = self._image(self._video_begins_ns, []) if self._video is not None else None
        camera = rig_files.calibration_for(self._camera, first, [])
        return (self._outline(index, t_ns, camera) for index, t_ns in enumerate(times_ns))

    def _outline(self, index: int, t_ns: int, camera: CameraCalibration | None) -> Frame:
        ego, gnss = self._ego(t_ns), self._fixes.latest(t_ns, FIX_WITHIN_NS)
        return Frame(index, f"{index:06d}", t_ns, camera=camera, ego=ego, gnss=gnss)

    def _ego(self, t_ns: int) -> EgoState | None:
        return self._own.latest(t_ns, FIX_WITHIN_NS)

    def _image(self, t_ns: int, notes: list[str]) -> CameraImage | None:
        if self._video is None:
            notes += self._unreadable
            return None
        index = nearest(self._video.times_ns, t_ns - self._video_begins_ns, IMAGE_WITHIN_NS)
        if index is None:
            notes.append("no image within 0.1 s")
            return None
        try:
            bgr = self._video.image(index)
        except SourceError as error:
            notes.append(str(error))
            return None
        return CameraImage(self._video_begins_ns + int(self._video.times_ns[index]), bgr)

    def _open_video(self, path: Path | None, is_asked_for: bool, progress: Progress) -> video_files.VideoFile | None:
        """None, with a note, for a damaged one that merely lies beside the recording."""
        if path is None:
            return None
        try:
            video = video_files.VideoFile(path, progress)
        except SourceError as error:
            if is_asked_for:
                raise
            self._unreadable.append(f"no images: {error}")
            self.notes += self._unreadable
            return None
        self.notes.append(f"images from {path.name}")
        return video


def rig_of(recording: Path, options: dict[str, str]) -> rig_files.Rig:
    """The file with the sensors' mounts; without one, every sensor is at the ego origin."""
    path = named(recording, options, "rig", rig_files.SUFFIXES)
    return rig_files.load_rig(path) if path is not None else rig_files.Rig()


def named(recording: Path, options: dict[str, str], option: str, suffixes: tuple[str, ...]) -> Path | None:
    """The file named by an option, relative to the recording's folder; else the one with the recording's own name."""
    if option in options:
        path = recording.parent / given_path(options[option], SourceError)
        if not path.is_file():
            raise SourceError(f"{option}={options[option]}: no such file")
        return path
    return files_by_name(recording.parent, suffixes).get(recording.stem)


def fixes_of(path: Path, near_ns: int, notes: list[str]) -> list[GnssFix]:
    """Every fix in an NMEA file. Damaged lines are counted in ``notes``."""
    reader, fixes = NmeaReader(), []
    try:
        with open_regular(path) as file:
            if os.fstat(file.fileno()).st_size > _LARGEST_NMEA_BYTES:
                raise SourceError(f"{path.name}: larger than {_LARGEST_NMEA_BYTES >> 20} MiB")
            while line := file.readline(_LONGEST_LINE):
                fix = reader.push(line.decode("ascii", "replace"), near_ns) if line.strip() else None
                if fix is not None:
                    fixes.append(fix)
    except OSError as error:
        raise SourceError(f"{path.name}: cannot be read: {reason_of(error)}") from None
    last = reader.flush(near_ns)
    fixes += [last] if last is not None else []
    notes.append(f"{len(fixes)} GNSS fixes from {path.name}, by the receiver's own time")
    if reader.bad:
        notes.append(f"{path.name}: {reader.bad} damaged lines skipped")
    return fixes
