"""nuScenes' tables (Caesar et al. 2020; nuscenes-devkit/docs/schema_nuscenes.md): a folder of JSON lists whose rows
name each other by token.

Cuboids are in the global frame, ``size`` is width, length, height, quaternions are w x y z. Here the global frame is
the ego frame of the first frame, from where own speed and yaw rate lead on; where a recording has none, every frame's
ego frame is it. A track's number is its instance's token, written with 32 hexadecimal digits.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.common.geometry import inverse, rotation
from pipeline.formats.file_reading import check_looks_ahead
from pipeline.labels.formats.base import FrameInfo, LabeledDrive, make_folder
from pipeline.labels.formats.points import points_inside
from pipeline.labels.model import LabelSet, LabelTrack, Sighting
from pipeline.types import F64

VERSION_FOLDER = "v1.0-cipv"
CATEGORIES = {
    "car": "vehicle.car",
    "truck": "vehicle.truck",
    "bus": "vehicle.bus.rigid",
    "motorcycle": "vehicle.motorcycle",
    "bicycle": "vehicle.bicycle",
    "trailer": "vehicle.trailer",
    "person": "human.pedestrian.adult",
}
"""Class → nuScenes' category; other classes keep their names."""
LIDAR, CAMERA = "LIDAR_TOP", "CAM_FRONT"
_VISIBILITY = ("0-40", "40-60", "60-80", "80-100")
_NO_TURN = [1.0, 0.0, 0.0, 0.0]
_FOLDERS = {LIDAR: ("samples/LIDAR_TOP", "pcd.bin", "pcd"), CAMERA: ("samples/CAM_FRONT", "jpg", "jpg")}
TableRow = dict[str, Any]


def write(labels: LabelSet, drive: LabeledDrive, out: Path) -> tuple[str, ...]:
    """The 13 tables in ``v1.0-cipv``, readable by the development kit."""
    poses, is_known = _poses(drive)
    turns = _quaternions(poses)
    annotations = _annotations(labels, drive, poses, turns)
    tables: dict[str, list[TableRow]] = {
        "attribute": [],
        "category": _categories(labels),
        "visibility": [
            {"token": str(place), "level": f"v{level}", "description": f"{level} % of the object are visible"}
            for place, level in enumerate(_VISIBILITY, start=1)
        ],
        "instance": _instances(labels, annotations),
        "sample_annotation": [row for rows in annotations.values() for row in rows],
        "log": [{"token": _token("log"), "logfile": drive.uri, "vehicle": "", "date_captured": "", "location": ""}],
        "map": [{"token": _token("map"), "log_tokens": [_token("log")], "category": "semantic_prior", "filename": ""}],
        "scene": [_scene(drive)],
        "sample": [_sample(index, drive) for index in range(len(drive.shots))],
        "ego_pose": [
            {
                "token": _token("pose", index),
                "timestamp": shot.t_ns // 1000,
                "translation": poses[index][:3, 3].tolist(),
                "rotation": turns[index],
            }
            for index, shot in enumerate(drive.shots)
        ],
        "sensor": [
            {"token": _token("sensor", LIDAR), "channel": LIDAR, "modality": "lidar"},
            {"token": _token("sensor", CAMERA), "channel": CAMERA, "modality": "camera"},
        ],
    }
    tables |= _sensor_tables(drive)
    folder = make_folder(out) / VERSION_FOLDER
    folder.mkdir()
    for name, rows in tables.items():
        (folder / f"{name}.json").write_text(_json(rows), encoding="utf-8")
    return _changes(labels, drive, is_known)


def _json(rows: list[TableRow]) -> str:
    """One row per line; encoded row by row, which Python does in C, unlike with an indent."""
    lines = map(json.JSONEncoder(ensure_ascii=False, allow_nan=False).encode, rows)
    return "[\n" + ",\n".join(lines) + "\n]\n"


def _annotations(
    labels: LabelSet, drive: LabeledDrive, poses: list[F64], turns: list[list[float]]
) -> dict[int, list[TableRow]]:
    """Rows by track. turns: rotations of the poses, w x y z."""
    inside = points_inside(labels, drive)  # used by the benchmark as a filter
    samples = [_token("sample", index) for index in range(len(drive.shots))]
    rows: dict[int, list[TableRow]] = {}
    for track in labels.tracks:
        seen = [each for each in track.sightings if each.cuboid is not None]
        instance, tokens = instance_token(track.id), [_token("annotation", track.id, each.frame) for each in seen]
        rows[track.id] = [
            {
                "token": tokens[place],
                "sample_token": samples[each.frame],
                "instance_token": instance,
                "visibility_token": "",
                "attribute_tokens": [],
                **_box(each, poses[each.frame], turns[each.frame]),
                "prev": tokens[place - 1] if place else "",
                "next": tokens[place + 1] if place + 1 < len(tokens) else "",
                "num_lidar_pts": inside.get((track.id, each.frame), 0),
                "num_radar_pts": 0,
            }
            for place, each in enumerate(seen)
        ]
    return rows


def _box(sighting: Sighting, T_global_ego: F64, turn: list[float]) -> TableRow:
    """turn: rotation of the ego frame, w x y z."""
    assert sighting.cuboid is not None
    length, width, height = sighting.cuboid.size
    center = T_global_ego[:3, :3] @ sighting.cuboid.center + T_global_ego[:3, 3]
    w, x, y, z = turn
    c, s = math.cos(sighting.cuboid.yaw_rad / 2), math.sin(sighting.cuboid.yaw_rad / 2)
    rotation_wxyz = [w * c - z * s, x * c + y * s, y * c - x * s, z * c + w * s]
    return {"translation": center.tolist(), "size": [width, length, height], "rotation": rotation_wxyz}


def _categories(labels: LabelSet) -> list[TableRow]:
    names = sorted({CATEGORIES.get(track.label, track.label) for track in labels.tracks})
    return [{"token": _token("category", name), "name": name, "description": ""} for name in names]


def _instances(labels: LabelSet, annotations: dict[int, list[TableRow]]) -> list[TableRow]:
    return [_instance(track, annotations[track.id]) for track in labels.tracks if annotations[track.id]]


def _instance(track: LabelTrack, rows: list[TableRow]) -> TableRow:
    return {
        "token": instance_token(track.id),
        "category_token": _token("category", CATEGORIES.get(track.label, track.label)),
        "nbr_annotations": len(rows),
        "first_annotation_token": rows[0]["token"],
        "last_annotation_token": rows[-1]["token"],
    }


def _scene(drive: LabeledDrive) -> TableRow:
    last = len(drive.shots) - 1
    return {
        "token": _token("scene"),
        "log_token": _token("log"),
        "nbr_samples": len(drive.shots),
        "first_sample_token": _token("sample", 0),
        "last_sample_token": _token("sample", last),
        "name": "scene-0001",
        "description": drive.uri,
    }


def _sample(index: int, drive: LabeledDrive) -> TableRow:
    return {
        "token": _token("sample", index),
        "timestamp": drive.shots[index].t_ns // 1000,
        "scene_token": _token("scene"),
        "prev": _token("sample", index - 1) if index else "",
        "next": _token("sample", index + 1) if index + 1 < len(drive.shots) else "",
    }


def _sensor_tables(drive: LabeledDrive) -> dict[str, list[TableRow]]:
    """``sample_data`` and ``calibrated_sensor``: the LiDAR's points are already in the ego frame; one row for each
    calibration of the camera in the drive."""
    calibrated: dict[str, TableRow] = {}
    sensors: dict[tuple[str, int], TableRow] = {}
    data: list[TableRow] = []
    names = drive.file_names()
    for channel in (LIDAR, CAMERA):
        shots = [(i, s) for i, s in enumerate(drive.shots) if channel == LIDAR or s.camera is not None]
        tokens = [_token("data", channel, index) for index, _ in shots]
        folder, ending, kind = _FOLDERS[channel]
        for place, (index, shot) in enumerate(shots):
            key = channel, id(shot.camera)  # one calibration is shared by many frames
            if key not in sensors:
                sensors[key] = _calibrated(channel, shot)
            sensor = calibrated.setdefault(sensors[key]["token"], sensors[key])
            data.append(
                {
                    "token": tokens[place],
                    "sample_token": _token("sample", index),
                    "ego_pose_token": _token("pose", index),
                    "calibrated_sensor_token": sensor["token"],
                    "timestamp": shot.t_ns // 1000,
                    "fileformat": kind,
                    "is_key_frame": True,
                    "height": shot.size[1] if channel == CAMERA and shot.size else 0,
                    "width": shot.size[0] if channel == CAMERA and shot.size else 0,
                    "filename": f"{folder}/{names[index]}.{ending}",
                    "prev": tokens[place - 1] if place else "",
                    "next": tokens[place + 1] if place + 1 < len(tokens) else "",
                }
            )
    return {"sample_data": data, "calibrated_sensor": list(calibrated.values())}


def _calibrated(channel: str, shot: FrameInfo) -> TableRow:
    camera = shot.camera if channel == CAMERA else None
    row: TableRow = {"sensor_token": _token("sensor", channel), "camera_intrinsic": []}
    if camera is None:
        row |= {"translation": [0.0, 0.0, 0.0], "rotation": _NO_TURN}
    else:
        check_looks_ahead(camera, "the recording's calibration")
        T_ego_camera = inverse(camera.T_camera_ego)
        row |= {"translation": T_ego_camera[:3, 3].tolist(), "rotation": _quaternions([T_ego_camera])[0]}
        row |= {"camera_intrinsic": camera.K.tolist()}
    return {"token": _token(json.dumps(row)), **row}


@dataclass(frozen=True)
class _Motion:
    speed_mps: float
    yaw_rate_radps: float


def _poses(drive: LabeledDrive) -> tuple[list[F64], bool]:
    """T_global_ego (4, 4) of every frame, and whether own motion is known in all of them; else the identity."""
    motions = [
        _Motion(shot.ego.speed_mps, shot.ego.yaw_rate_radps)
        for shot in drive.shots
        if shot.ego is not None and shot.ego.yaw_rate_radps is not None
    ]
    if len(motions) < len(drive.shots):
        return [np.eye(4) for _ in drive.shots], False
    poses, yaw_rad, place = [], 0.0, np.zeros(3)
    for index, motion in enumerate(motions):
        if index:
            dt_s = (drive.shots[index].t_ns - drive.shots[index - 1].t_ns) / 1e9
            turn_rad = motion.yaw_rate_radps * dt_s
            middle_rad = yaw_rad + turn_rad / 2
            place = place + motion.speed_mps * dt_s * np.array([np.cos(middle_rad), np.sin(middle_rad), 0.0])
            yaw_rad += turn_rad
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation(0.0, 0.0, yaw_rad), place
        poses.append(pose)
    return poses, True


def _changes(labels: LabelSet, drive: LabeledDrive, is_known: bool) -> tuple[str, ...]:
    changes = ["images and point clouds are not written, only their file names"]
    if not is_known:
        changes.append("ego speed or yaw rate is unknown: the global frame is each frame's ego frame")
    if any(shot.camera is not None and shot.camera.distortion.size for shot in drive.shots):
        changes.append("lens distortion is not written: the format has no field for it")
    if any(track.sightings for track in labels.tracks):
        changes.append("visibility of objects is unknown: written as empty")
    return tuple(changes)


def instance_token(track: int) -> str:
    return f"{track:032x}"


def _token(*parts: str | int) -> str:
    """32 hexadecimal digits, deterministic for each row."""
    return blake2b("/".join(map(str, parts)).encode(), digest_size=16).hexdigest()


def _quaternions(poses: Sequence[F64]) -> list[list[float]]:
    """w x y z of each (4, 4); SciPy has w last."""
    found = Rotation.from_matrix(np.reshape(poses, (-1, 4, 4))[:, :3, :3]).as_quat().tolist()
    return [[w, x, y, z] for x, y, z, w in found]
