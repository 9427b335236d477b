"""Defines a label format, and what it needs to know about the recording that the labels belong to."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from pipeline.alignment.projection import Pinhole, project_cuboids
from pipeline.common.errors import BadInput
from pipeline.common.files.output_files import open_new
from pipeline.common.geometry import Cuboid, corners_of
from pipeline.common.progress import Progress, silent
from pipeline.labels.classes import NO_CLASSES, ClassList
from pipeline.labels.model import LabelSet, Origin
from pipeline.types import F32, F64, Box, CameraCalibration, EgoState, Frame
from pipeline.types.source import InParts, Rectified, Source
from pipeline.vision.classes import canonical

_FILE_NAME = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,99}")
_FEWEST_PAIRS = 3
"""Pairs of cuboid and box that can show that two files do not belong together."""


@dataclass(frozen=True)
class FrameInfo:
    """Metadata of one frame."""

    name: str
    """The frame's name in the recording."""
    t_ns: int
    """Of the tick."""
    camera: CameraCalibration | None = None
    """None if the camera has no calibration."""
    size: tuple[int, int] | None = None
    """Width and height of its image in pixels."""
    T_rect_ego: F64 | None = None
    """(4, 4), takes ego points to the frame of KITTI's labels: the recording's rectified camera 0 if it has one, else
    the camera itself."""
    ego: EgoState | None = None
    """Speed, yaw rate and course; None where nothing measured them."""


def _no_points(frame: int) -> F32 | None:
    return None


@dataclass(frozen=True)
class LabeledDrive:
    """The recording that labels belong to."""

    uri: str
    """As the recording was opened."""
    shots: tuple[FrameInfo, ...]
    """Every frame, in order."""
    points: Callable[[int], F32 | None] = field(default=_no_points, compare=False)
    """Returns the (N, 4) float32 x y z intensity of a frame's sweep, None without one; read on demand."""
    classes: ClassList = field(default=NO_CLASSES, compare=False)
    """The class list by which an import reads the names in a file."""

    def class_of(self, word: str, export: str, otherwise: Callable[[str], str] = canonical) -> str:
        """The class for a name in a file. export: its format, one of ``EXPORTS``. otherwise: for a name that the class
        list does not have."""
        return self.classes.read_as(word, export) or otherwise(word)

    @property
    def frames(self) -> tuple[str, ...]:
        return tuple(shot.name for shot in self.shots)

    @property
    def t_ns(self) -> tuple[int, ...]:
        return tuple(shot.t_ns for shot in self.shots)

    def file_names(self) -> tuple[str, ...]:
        """A file name for each frame: the recording's own names if they are valid file names, otherwise numbers."""
        names = self.frames
        if len({name.lower() for name in names}) == len(names) and all(_FILE_NAME.fullmatch(name) for name in names):
            return names
        return tuple(f"{index:06d}" for index in range(len(names)))

    def empty(self) -> LabelSet:
        """An empty label set for this drive."""
        return LabelSet(self.uri, self.frames, self.t_ns)


def drive_of(
    source: Source,
    progress: Progress = silent,
    frame_of: Callable[[int], Frame] | None = None,
) -> LabeledDrive:
    """Metadata of every frame, without points and images if the source supports that. frame_of: returns complete frames
    if they are already available; pixels of images are not needed."""
    read = frame_of or source.frame
    shots = []
    for index, frame in enumerate(source.outlines() if isinstance(source, InParts) else map(read, range(len(source)))):
        camera = frame.camera
        size = (camera.width, camera.height) if camera is not None else _size(read(index))
        T_rect_ego = source.T_rect_ego(index) if isinstance(source, Rectified) else None
        if T_rect_ego is None and camera is not None:
            T_rect_ego = camera.T_camera_ego
        shots.append(FrameInfo(frame.name, frame.t_ns, camera, size, T_rect_ego, frame.ego))
        progress(index + 1, len(source))

    def points(index: int) -> F32 | None:
        sweep = source.sweep(index) if isinstance(source, InParts) else read(index).sweep
        return sweep.points if sweep is not None else None

    return LabeledDrive(source.uri, tuple(shots), points)


def _size(frame: Frame) -> tuple[int, int] | None:
    """From the image, if no calibration gives it."""
    return (frame.image.bgr.shape[1], frame.image.bgr.shape[0]) if frame.image is not None else None


@dataclass(frozen=True)
class Imported:
    """The content of a label file."""

    labels: LabelSet
    """Assigned to the frames of the drive."""
    notes: tuple[str, ...] = ()
    """What the file contains that labels cannot represent, and what is missing in it."""


Write = Callable[[LabelSet, LabeledDrive, Path], tuple[str, ...]]
"""Writes labels that contain only what the format supports; arguments are labels, drive, and output path. Returns
sentences about changed content."""

ReadLabels = Callable[[Path, LabeledDrive, Origin], Imported]
"""Arguments are the file or folder, the drive, and the default origin of labels."""


def check_extrinsic(labels: LabelSet, drive: LabeledDrive, what: str) -> None:
    """Raise BadInput if cuboids and boxes of the same sightings do not overlap in the image: a sign of an inverted
    extrinsic, or of labels for another recording."""
    count, apart = 0, 0
    for frame, pairs in _pairs(labels).items():
        camera = drive.shots[frame].camera
        if camera is not None:
            view = Pinhole(camera.K, camera.distortion, camera.T_camera_ego)
            corners = corners_of([cuboid for cuboid, _ in pairs])
            seen = project_cuboids(view, corners, camera.width, camera.height)
            count += len(pairs)
            apart += sum(not _touch(one, box) for one, (_, box) in zip(seen, pairs, strict=True))
    if count >= _FEWEST_PAIRS and apart > count / 2:
        raise BadInput(
            f"{what}: {apart} of {count} cuboids do not project onto their boxes in the image; "
            "is an extrinsic inverted?"
        )


def _pairs(labels: LabelSet) -> dict[int, list[tuple[Cuboid, Box]]]:
    """Frame → (cuboid, box) of every sighting that has both."""
    found: dict[int, list[tuple[Cuboid, Box]]] = {}
    for track in labels.tracks:
        for sighting in track.sightings:
            if sighting.cuboid is not None and sighting.bbox is not None:
                found.setdefault(sighting.frame, []).append((sighting.cuboid, sighting.bbox))
    return found


def _touch(one: Box | None, other: Box) -> bool:
    return one is not None and one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


def make_folder(out: Path) -> Path:
    """Create a folder to write into. Raises BadInput if it already contains files, which would mix old and new
    labels."""
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise BadInput(f"{out}: the folder is not empty; choose another name or remove it")
    out.mkdir(parents=True, exist_ok=True)
    return out


def write_file(out: Path, data: bytes) -> None:
    """Write a new file. Raises BadInput if it exists."""
    out.parent.mkdir(parents=True, exist_ok=True)
    with open_new(out) as file:
        file.write(data)
