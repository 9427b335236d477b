"""KITTI's object labels, a file a frame in ``label_2``, and tracking labels, a file a drive in ``label_02``.

Both are in the rectified camera's frame, so the calibration is written beside them, and theirs is used where it is
there (Geiger et al. 2012, "Are we ready for autonomous driving?", and the development kits' readme files).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.common.errors import BadInput
from pipeline.formats.file_reading import check_looks_ahead, files_by_name
from pipeline.formats.kitti_calibration import parse_object_calibration
from pipeline.formats.kitti_records import DONT_CARE, UNLABELLED, LabelRow, kind_of, truth_of
from pipeline.labels.formats.base import FrameInfo, Imported, LabeledDrive, make_folder
from pipeline.labels.formats.kitti import rows as kitti_rows
from pipeline.labels.formats.reading import read_bytes
from pipeline.labels.model import LabelSet, LabelTrack, Origin, Sighting
from pipeline.labels.recorded_truth import LINKED, renamed, tracks_of
from pipeline.types import F64, CameraCalibration

_OBJECT, _TRACKING, _CALIBRATION = "label_2", "label_02", "calib"
_SEQUENCE = "0000"
_USUAL_SIZE = (1242, 375)
_LARGEST_ID = 2**63
_MOST_TILT_RAD = math.radians(1.5)
"""Tilt of the labels' frame from which on it is reported. KITTI's own is below 1°."""
_NO_TRACK = "-1"
"""Track id of an ignored region."""


def write_objects(labels: LabelSet, drive: LabeledDrive, out: Path) -> tuple[str, ...]:
    """``label_2/NAME.txt`` and ``calib/NAME.txt`` for each frame with an object."""
    found: dict[int, list[tuple[str, Sighting]]] = {}
    for track, sighting in _sightings(labels):
        found.setdefault(sighting.frame, []).append((track.label, sighting))
    views = {frame: _view(drive.shots[frame]) for frame in found}
    make_folder(out)
    for folder in (_OBJECT, _CALIBRATION):
        (out / folder).mkdir()
    names = drive.file_names()
    for frame, seen in sorted(found.items()):
        T_rect_ego, camera = views[frame]
        lines = (kitti_rows.to_line(label, sighting, T_rect_ego, camera) for label, sighting in seen)
        (out / _OBJECT / f"{names[frame]}.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
        calibration = _object_calibration(T_rect_ego, camera)
        (out / _CALIBRATION / f"{names[frame]}.txt").write_text(calibration, encoding="utf-8")
    empty = len(drive.shots) - len(found)
    nothing = (f"{empty:,} frames have no file: nothing is labelled in them",) if empty else ()
    return (*_changes(labels, drive), *nothing)


def write_tracking(labels: LabelSet, drive: LabeledDrive, out: Path) -> tuple[str, ...]:
    """``label_02/0000.txt`` and ``calib/0000.txt``; all frames with the first one's calibration, as required by the
    format."""
    shot = next((each for each in drive.shots if each.camera is not None), None)
    T_rect_ego, camera = _view(shot or FrameInfo("", 0))
    rows = sorted(
        (sighting.frame, track.id, kitti_rows.to_line(track.label, sighting, T_rect_ego, camera))
        for track, sighting in _sightings(labels)
    )
    make_folder(out)
    for folder in (_TRACKING, _CALIBRATION):
        (out / folder).mkdir()
    text = "".join(f"{frame} {number} {line}\n" for frame, number, line in rows)
    (out / _TRACKING / f"{_SEQUENCE}.txt").write_text(text, encoding="utf-8")
    calibration = _tracking_calibration(T_rect_ego, camera)
    (out / _CALIBRATION / f"{_SEQUENCE}.txt").write_text(calibration, encoding="utf-8")
    return _changes(labels, drive)


def read_objects(path: Path, drive: LabeledDrive, origin: Origin) -> Imported:
    """A folder that contains ``label_2``, such a folder itself, or one file of it. Objects are linked over time in the
    same way as labels of an opened recording."""
    home, files = _files(path, _OBJECT)
    frames = {name: index for index, name in enumerate(drive.file_names())}
    known = {frames[name]: (name, file) for name, file in files.items() if name in frames}
    if not known:
        raise BadInput(f"{path}: no label file has the name of a frame of {drive.uri}")
    rows: dict[int, list[LabelRow]] = {}
    for frame, (name, file) in sorted(known.items()):
        T_rect_ego, camera = _view_beside(home, name, drive.shots[frame])
        rows[frame] = [_row(fields, T_rect_ego, camera, drive, what) for fields, what in _lines(file)]
    objects = {
        frame: tuple(truth_of(row, row.cuboid) for row in found if row.cuboid is not None)
        for frame, found in rows.items()
    }
    tracks = tracks_of(objects, drive.t_ns, origin)
    flat = [(frame, row) for frame, found in rows.items() for row in found if row.cuboid is None]
    first = max((track.id for track in tracks), default=0) + 1
    alone = tuple(
        LabelTrack(n, row.label, (Sighting(frame, None, row.bbox, box_set=True),), "accepted", origin)
        for n, (frame, row) in enumerate(flat, start=first)
    )
    unknown = len(files) - len(known)
    notes = (
        f"{unknown} files match no frame of this recording: left out" if unknown else "",
        LINKED if tracks else "",
        f"{len(flat):,} regions without a cuboid become a track each" if flat else "",
    )
    labels = replace(drive.empty(), tracks=(*tracks, *alone))
    return Imported(labels, (*filter(None, notes), *_notes([row for found in rows.values() for row in found])))


def read_tracking(path: Path, drive: LabeledDrive, origin: Origin) -> Imported:
    """A folder that contains ``label_02``, such a folder with one file, or the file."""
    home, files = _files(path, _TRACKING)
    if len(files) != 1:
        raise BadInput(f"{path}: {len(files)} tracking files; choose one")
    ((name, file),) = files.items()
    shot = next((each for each in drive.shots if each.camera is not None), FrameInfo("", 0))
    T_rect_ego, camera = _view_beside(home, name, shot)
    found: dict[int, tuple[str, dict[int, Sighting]]] = {}
    rows: list[LabelRow] = []
    regions: list[tuple[int, LabelRow]] = []
    for (frame_text, id_text, *fields), what in _lines(file, skip=2):
        frame = _whole(frame_text, len(drive.shots), what)
        if id_text == _NO_TRACK:
            regions.append((frame, _row(fields, T_rect_ego, camera, drive, what)))
            continue
        number = _whole(id_text, _LARGEST_ID, what)
        row = _row(fields, T_rect_ego, camera, drive, what)
        label, sightings = found.setdefault(number, (row.label, {}))
        if label == UNLABELLED:  # a track may begin with sightings only in the image
            label = row.label
            found[number] = label, sightings
        if frame in sightings or row.label not in (label, UNLABELLED):
            raise BadInput(f"{what}: track {number} occurs twice, or with two classes")
        sightings[frame] = _sighting_of(frame, row)
        rows.append(row)
    tracks = [
        LabelTrack(number, label, tuple(sightings[frame] for frame in sorted(sightings)), "accepted", origin)
        for number, (label, sightings) in sorted(found.items())
    ]
    first = max(found, default=0) + 1
    tracks += [
        LabelTrack(n, row.label, (_sighting_of(frame, row),), "accepted", origin)
        for n, (frame, row) in enumerate(regions, start=first)
    ]
    labels = replace(drive.empty(), tracks=tuple(tracks))
    return Imported(labels, _notes([*rows, *(row for _, row in regions)]))


def _sighting_of(frame: int, row: LabelRow) -> Sighting:
    return Sighting(
        frame, row.cuboid, row.bbox, box_set=row.bbox is not None, truncation=row.truncation, occlusion=row.occlusion
    )


def _sightings(labels: LabelSet) -> Iterator[tuple[LabelTrack, Sighting]]:
    """By track, then frame."""
    in_order = sorted(labels.tracks, key=lambda track: track.id)
    return ((track, sighting) for track in in_order for sighting in track.sightings)


def _view(shot: FrameInfo) -> tuple[F64, CameraCalibration]:
    """Transform to the frame of the labels, and its camera. BadInput without one."""
    if shot.camera is None or shot.T_rect_ego is None:
        raise BadInput("KITTI labels are in the camera's frame; this recording has no camera calibration")
    check_looks_ahead(shot.camera, "the recording's calibration")
    return shot.T_rect_ego, shot.camera


def _view_beside(home: Path, name: str, shot: FrameInfo) -> tuple[F64, CameraCalibration | None]:
    """Like ``_view``, but with the calibration beside the labels, if there is one."""
    file = home / _CALIBRATION / f"{name}.txt"
    if not file.is_file():
        return _view(shot)
    size = (shot.camera.width, shot.camera.height) if shot.camera is not None else _USUAL_SIZE
    return parse_object_calibration(read_bytes(file), str(file), size).T_rect_ego, shot.camera


def _files(path: Path, folder: str) -> tuple[Path, dict[str, Path]]:
    """(folder that may contain ``calib``, label files by name). BadInput without files."""
    if path.is_file():
        return path.parent.parent, {path.stem: path}
    inside = path / folder if (path / folder).is_dir() else path
    files = files_by_name(inside, (".txt",))
    if not files:
        raise BadInput(f"{path}: not KITTI labels: neither {folder}/*.txt nor *.txt in it")
    return inside.parent, files


def _lines(file: Path, skip: int = 0) -> Iterator[tuple[list[str], str]]:
    """(fields, position) of each line."""
    for number, line in enumerate(read_bytes(file).decode("utf-8", "replace").splitlines(), start=1):
        fields, what = line.split(), f"{file}, line {number}"
        if 0 < len(fields) <= skip:
            raise BadInput(f"{what}: not a KITTI label")
        if fields:
            yield fields, what


def _row(
    fields: list[str], T_rect_ego: F64, camera: CameraCalibration | None, drive: LabeledDrive, what: str
) -> LabelRow:
    """A line with the drive's class for its type."""
    row = kitti_rows.from_fields(fields, T_rect_ego, camera, what)
    return row._replace(label=drive.class_of(row.kind, "kitti", lambda _: row.label))


def _whole(text: str, limit: int, what: str) -> int:
    if not (text.isascii() and text.isdecimal() and len(text) < 20 and int(text) < limit):
        raise BadInput(f"{what}: {text[:20]!r} is not a frame or track of this recording")
    return int(text)


def _changes(labels: LabelSet, drive: LabeledDrive) -> tuple[str, ...]:
    """Content that is changed by the export."""
    found = list(_sightings(labels))
    changes = [
        f"class {label!r} is written as {kind_of(label)} and will be read as another"
        for label in sorted({track.label for track, _ in found})
        if not kitti_rows.is_kept(label)
    ]
    cameras = [drive.shots[sighting.frame].camera for _, sighting in found if sighting.bbox is not None]
    if any(camera is not None and camera.distortion.size for camera in cameras):
        changes.append("boxes are moved to the undistorted image, as in KITTI")
    tilts = [_tilt_rad(drive.shots[sighting.frame].T_rect_ego) for _, sighting in found if sighting.cuboid is not None]
    if (most := max(tilts, default=0.0)) > _MOST_TILT_RAD:
        changes.append(
            f"the camera is tilted by {math.degrees(most):.1f}°, and so are the cuboids, which turn only about its "
            "vertical axis in this format: projected, they differ from their boxes"
        )
    hidden = sum(sighting.cuboid is not None and sighting.occlusion is None for _, sighting in found)
    if hidden:
        changes.append(f"occlusion of {hidden:,} objects is unknown: written as 3")
    flat = sum(sighting.cuboid is None and track.label != UNLABELLED for track, sighting in found)
    if flat:
        changes.append(f"{flat:,} objects have a box but no cuboid: written as {DONT_CARE}, which trainers ignore")
    without = sum(sighting.bbox is None for _, sighting in found)
    if without:
        changes.append(f"{without:,} objects have no box in the image: written as -1")
    return tuple(changes)


def _tilt_rad(T_rect_ego: F64 | None) -> float:
    """Angle between the vertical axes of the labels' frame and the ego frame."""
    return 0.0 if T_rect_ego is None else math.acos(min(1.0, max(-1.0, -float(T_rect_ego[1, 2]))))


def _notes(rows: list[LabelRow]) -> tuple[str, ...]:
    notes = renamed((row.kind, row.label) for row in rows if row.kind != kind_of(row.label))
    return tuple(notes)


def _object_calibration(T_rect_ego: F64, camera: CameraCalibration) -> str:
    projection = _numbers(_projection(T_rect_ego, camera))
    return (
        "".join(f"P{number}: {projection}\n" for number in range(4))
        + f"R0_rect: {_numbers(np.eye(3))}\nTr_velo_to_cam: {_numbers(T_rect_ego[:3])}\n"
        + f"Tr_imu_to_velo: {_numbers(np.eye(4)[:3])}\n"
    )


def _tracking_calibration(T_rect_ego: F64, camera: CameraCalibration) -> str:
    """The same with the names of the tracking benchmark, two of them without a colon."""
    names = {"R0_rect:": "R_rect", "Tr_velo_to_cam:": "Tr_velo_cam", "Tr_imu_to_velo:": "Tr_imu_velo"}
    text = _object_calibration(T_rect_ego, camera)
    for ours, theirs in names.items():
        text = text.replace(ours, theirs)
    return text


def _projection(T_rect_ego: F64, camera: CameraCalibration) -> F64:
    """(3, 4) from the frame of the labels to pixels."""
    return np.asarray(camera.K @ (camera.T_camera_ego @ np.linalg.inv(T_rect_ego))[:3])


def _numbers(values: F64) -> str:
    return " ".join(f"{value:.12e}" for value in values.ravel())
