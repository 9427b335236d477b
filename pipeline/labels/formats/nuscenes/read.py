"""nuScenes' tables back to labels: cuboids from the global frame to each frame's ego frame."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from pydantic import BaseModel, TypeAdapter
from scipy.spatial.transform import Rotation

from pipeline.common.errors import BadInput
from pipeline.common.geometry import Cuboid, inverse, transform
from pipeline.formats.file_reading import camera_matrix, check_looks_ahead
from pipeline.labels.formats.base import Imported, LabeledDrive
from pipeline.labels.formats.nuscenes.write import CAMERA, CATEGORIES, LIDAR, instance_token
from pipeline.labels.formats.reading import parse_as, read_bytes
from pipeline.labels.model import LabelTrack, Origin, Sighting
from pipeline.types import F64, CameraCalibration
from pipeline.vision.classes import canonical

_USUAL_SIZE = (1600, 900)
_LARGEST_M = 1e7
"""Of a global coordinate: the northing of UTM stays below it."""
_LARGEST_TURN_RAD = 0.2
"""Between the camera's mounting in the file and in the recording."""
Three = tuple[float, float, float]
Four = tuple[float, float, float, float]


class _Row(BaseModel):
    token: str


class _Sample(_Row):
    timestamp: int


class _Annotation(_Row):
    sample_token: str
    instance_token: str
    translation: Three
    size: Three
    rotation: Four


class _Instance(_Row):
    category_token: str


class _Category(_Row):
    name: str


class _Pose(_Row):
    translation: Three
    rotation: Four


class _Calibrated(_Pose):
    sensor_token: str
    camera_intrinsic: list[Three]


class _Data(_Row):
    sample_token: str
    ego_pose_token: str
    calibrated_sensor_token: str
    is_key_frame: bool
    width: int = 0
    height: int = 0


class _Sensor(_Row):
    channel: str


R = TypeVar("R", bound=_Row)


def read(path: Path, drive: LabeledDrive, origin: Origin) -> Imported:
    """A folder with the tables, or one that contains such a folder. Samples are matched to the frames nearest in time.

    Positions are in nuScenes' ego frame, as given by ``ego_pose`` of each sample's LiDAR.
    """
    home = _home(path)
    frames = _frames(list(_table(home, "sample", _Sample).values()), drive, str(path))
    data = _table(home, "sample_data", _Data)
    channels = _channels(home)
    _check_camera(home, data, channels, drive)
    poses = _poses(home, data, channels)
    instances, categories = _table(home, "instance", _Instance), _table(home, "category", _Category)
    found: dict[str, dict[int, Sighting]] = {token: {} for token in instances}
    outside = 0
    for token, each in _table(home, "sample_annotation", _Annotation).items():
        frame = frames.get(each.sample_token)
        if frame is None:
            outside += 1
            continue
        if each.instance_token not in found or each.sample_token not in poses:
            raise BadInput(f"{path}: annotation {token[:40]} refers to a missing instance or pose")
        if frame in found[each.instance_token]:
            raise BadInput(f"{path}: annotation {token[:40]} occurs twice")
        found[each.instance_token][frame] = Sighting(frame, _cuboid(each, poses[each.sample_token], str(path)))
    numbers = _numbers(list(found))
    tracks = []
    for token, sightings in found.items():
        category = categories.get(instances[token].category_token)
        if category is None:
            raise BadInput(f"{path}: instance {token[:40]} refers to a missing category")
        if sightings:
            in_order = tuple(sightings[frame] for frame in sorted(sightings))
            tracks.append(
                LabelTrack(
                    numbers[token], drive.class_of(category.name, "nuscenes", _label), in_order, "accepted", origin
                )
            )
    tracks.sort(key=lambda track: track.id)
    note = (f"{outside:,} annotations belong to samples that are not frames of this recording",) if outside else ()
    return Imported(replace(drive.empty(), tracks=tuple(tracks)), note)


def _home(path: Path) -> Path:
    """The folder with the tables. BadInput if there is none."""
    for folder in (path, *sorted(each for each in path.glob("*") if each.is_dir())):
        if (folder / "sample.json").is_file():
            return folder
    raise BadInput(f"{path}: not nuScenes tables: sample.json is missing")


def _table(home: Path, name: str, row: type[R]) -> dict[str, R]:
    """Rows of a table by token."""
    file = home / f"{name}.json"
    rows: list[R] = parse_as(TypeAdapter(list[row]), read_bytes(file), str(file))  # type: ignore[valid-type]
    return {each.token: each for each in rows}


def _frames(samples: list[_Sample], drive: LabeledDrive, what: str) -> dict[str, int]:
    """Sample → frame: the nearest in time, within half of the usual step. BadInput if there is none."""
    stamps_us = np.array(drive.t_ns, dtype=np.float64) // 1000
    steps = np.diff(np.sort(stamps_us))
    steps = steps[steps > 0]
    reach_us = float(np.median(steps)) / 2 if len(steps) else 1e6
    frames: dict[str, int] = {}
    for sample in samples:
        away_us = np.abs(stamps_us - float(np.clip(sample.timestamp, -(2**62), 2**62)))
        nearest = int(np.argmin(away_us)) if len(away_us) else 0
        if len(away_us) and away_us[nearest] < reach_us:
            frames[sample.token] = nearest
    if not frames:
        raise BadInput(f"{what}: no sample has the time of a frame of {drive.uri}")
    if len(set(frames.values())) < len(frames):
        raise BadInput(f"{what}: two samples match the same frame of {drive.uri}")
    return frames


def _channels(home: Path) -> dict[str, tuple[str, _Calibrated]]:
    """Calibrated sensor → (channel, calibration)."""
    sensors = _table(home, "sensor", _Sensor)
    calibrated = _table(home, "calibrated_sensor", _Calibrated)
    return {
        token: (sensors[each.sensor_token].channel, each)
        for token, each in calibrated.items()
        if each.sensor_token in sensors
    }


def _poses(home: Path, data: dict[str, _Data], channels: dict[str, tuple[str, _Calibrated]]) -> dict[str, F64]:
    """Sample → T_ego_global at its LiDAR's time."""
    poses = _table(home, "ego_pose", _Pose)
    return {
        each.sample_token: inverse(_rigid(poses[each.ego_pose_token], str(home)))
        for each in data.values()
        if each.is_key_frame
        and each.ego_pose_token in poses
        and channels.get(each.calibrated_sensor_token, ("",))[0] == LIDAR
    }


def _check_camera(
    home: Path, data: dict[str, _Data], channels: dict[str, tuple[str, _Calibrated]], drive: LabeledDrive
) -> None:
    """BadInput if the front camera does not look ahead, or not in the direction of the recording's."""
    ours = next((shot.camera for shot in drive.shots if shot.camera is not None), None)
    size = next(((each.width, each.height) for each in data.values() if min(each.width, each.height) > 0), _USUAL_SIZE)
    for channel, calibrated in channels.values():
        if channel != CAMERA:
            continue
        what = f"{home}: the calibration of {CAMERA}"
        K = camera_matrix(calibrated.camera_intrinsic, what)
        T_camera_ego = inverse(_rigid(calibrated, what))
        check_looks_ahead(CameraCalibration(K, np.empty(0), T_camera_ego, *size), what)
        if ours is not None:
            between = Rotation.from_matrix(ours.T_camera_ego[:3, :3] @ T_camera_ego[:3, :3].T).magnitude()
            if between > _LARGEST_TURN_RAD:
                raise BadInput(
                    f"{what} is turned {np.degrees(between):.0f}° from the recording's; is it from another car?"
                )


def _cuboid(each: _Annotation, T_ego_global: F64, what: str) -> Cuboid:
    turn = T_ego_global[:3, :3] @ _turn(each.rotation, what)
    if not np.all(np.abs(np.array((*each.translation, *each.size))) < _LARGEST_M):
        raise BadInput(f"{what}: annotation {each.token[:40]} has no position")
    x, y, z = (float(value) for value in transform(T_ego_global, np.array([each.translation]))[0])
    width, length, height = each.size
    return Cuboid((x, y, z), (length, width, height), float(np.arctan2(turn[1, 0], turn[0, 0])))


def _rigid(pose: _Pose, what: str) -> F64:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = _turn(pose.rotation, what), pose.translation
    if not np.all(np.abs(T) < _LARGEST_M):
        raise BadInput(f"{what}: an invalid pose")
    return T


def _turn(quaternion: Four, what: str) -> F64:
    """(3, 3) from w x y z; SciPy has w last. BadInput unless it has unit length."""
    w, x, y, z = quaternion
    length = float(np.linalg.norm(quaternion)) if max(map(abs, quaternion)) < 2.0 else 0.0
    if not abs(length - 1.0) < 1e-3:
        raise BadInput(f"{what}: a rotation that is not a unit quaternion")
    return np.asarray(Rotation.from_quat([x, y, z, w]).as_matrix())


def _numbers(tokens: list[str]) -> dict[str, int]:
    """Instance → track: the number in the token if all tokens were written by this program, else numbered in order."""
    try:
        numbers = {token: int(token, 16) for token in tokens}
    except ValueError:
        numbers = {}
    if len(numbers) == len(tokens) and all(n < 2**63 and instance_token(n) == token for token, n in numbers.items()):
        return numbers
    return {token: place for place, token in enumerate(tokens, start=1)}


def _label(category: str) -> str:
    """The class for a category; for an unknown category, its own name."""
    for label, name in CATEGORIES.items():
        if category == name:
            return label
    if category.startswith("human.pedestrian"):
        return "person"
    if category.startswith("vehicle.bus"):
        return "bus"
    return canonical(category)
