"""The tables of a nuScenes data set (Caesar et al. 2020; schema of version 1.0 in its development kit).

``v1.0-mini/*.json`` are lists of records that name each other by tokens. Poses are translations in metres and
quaternions ``w x y z``; times are µs since 1970.
"""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

import msgspec
import numpy as np

from pipeline.common.files.user_file_errors import reason_of
from pipeline.common.files.user_files import read_regular
from pipeline.common.geometry import Cuboid, inverse, transform
from pipeline.formats.file_reading import camera_matrix
from pipeline.types import F64
from pipeline.types.source import SourceError, TruthObject

_LARGEST_TABLE_BYTES = 2 << 30
"""Those of the whole data set have about one GB."""
_LABELS = (
    ("vehicle.car", "car"),
    ("vehicle.emergency", "car"),
    ("vehicle.truck", "truck"),
    ("vehicle.construction", "truck"),
    ("vehicle.bus", "bus"),
    ("vehicle.trailer", "trailer"),
    ("vehicle.motorcycle", "motorcycle"),
    ("vehicle.bicycle", "bicycle"),
    ("human.pedestrian", "person"),
    ("animal", "animal"),
)
"""Categories by their beginning, and the class that detectors know."""


class SceneRow(msgspec.Struct, gc=False):
    """Some twenty seconds of a drive."""

    token: str
    """Its key."""
    name: str
    """For people: ``scene-0061``."""


class SampleRow(msgspec.Struct, gc=False):
    """A labelled moment."""

    token: str
    """Its key."""
    scene_token: str
    """The scene it is of."""


class SampleDataRow(msgspec.Struct, gc=False):
    """One file of one sensor."""

    sample_token: str
    """The labelled moment nearest to it."""
    ego_pose_token: str
    """Where the car was."""
    calibrated_sensor_token: str
    """Which sensor, and where it sits."""
    timestamp: int
    """µs since 1970."""
    filename: str
    """From the data set's folder."""
    is_key_frame: bool
    """Whether it is of the labelled moment itself."""


class CalibratedSensorRow(msgspec.Struct, gc=False):
    """A sensor on one car."""

    token: str
    """Its key."""
    sensor_token: str
    """Which sensor."""
    translation: list[float]
    """In the car's frame: the rear axle's middle on the road, x forward, y left, z up."""
    rotation: list[float]
    """From the sensor's axes to the car's."""
    camera_intrinsic: list[list[float]]
    """(3, 3) of a camera, empty of others."""


class SensorRow(msgspec.Struct, gc=False):
    """A sensor's name."""

    token: str
    """Its key."""
    channel: str
    """``LIDAR_TOP``, ``CAM_FRONT``."""
    modality: str
    """``lidar``, ``camera`` or ``radar``."""


class EgoPoseRow(msgspec.Struct, gc=False):
    """Where the car was."""

    token: str
    """Its key."""
    translation: list[float]
    """On the map."""
    rotation: list[float]
    """From the car's axes to the map's."""


class AnnotationRow(msgspec.Struct, gc=False):
    """A labelled box."""

    sample_token: str
    """When."""
    instance_token: str
    """Which object, through the scene."""
    translation: list[float]
    """Of its middle, on the map."""
    size: list[float]
    """Width, length, height."""
    rotation: list[float]
    """From the box's axes to the map's."""


class InstanceRow(msgspec.Struct, gc=False):
    """One object of a scene."""

    token: str
    """Its key."""
    category_token: str
    """What it is."""


class CategoryRow(msgspec.Struct, gc=False):
    """A class of objects."""

    token: str
    """Its key."""
    name: str
    """``vehicle.car``."""


Row = TypeVar(
    "Row",
    SceneRow,
    SampleRow,
    SampleDataRow,
    CalibratedSensorRow,
    SensorRow,
    EgoPoseRow,
    AnnotationRow,
    InstanceRow,
    CategoryRow,
)


def read_table(folder: Path, name: str, kind: type[Row]) -> list[Row]:
    """The rows of ``NAME.json``. SourceError names the table and what is wrong."""
    path = folder / f"{name}.json"
    try:
        # as much memory as the file has bytes, not as the largest may have
        data = read_regular(path, min(path.stat().st_size, _LARGEST_TABLE_BYTES))
    except FileNotFoundError:
        raise SourceError(f"{folder.name}/{name}.json is missing") from None
    except OSError as error:
        raise SourceError(f"{folder.name}/{name}.json: cannot be read: {reason_of(error)}") from None
    return parse_table(data, f"{folder.name}/{name}.json", kind)


def parse_table(data: bytes, file: str, kind: type[Row]) -> list[Row]:
    """The rows in a table's text. SourceError when it is none of this kind."""
    try:
        return msgspec.json.decode(data, type=list[kind])  # type: ignore[valid-type]
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        raise SourceError(f"{file}: not a table of nuScenes, or cut off") from None


def pose_of(translation: list[float], rotation: list[float], what: str) -> F64:
    """(4, 4) of a translation and a quaternion ``w x y z``. SourceError when they are none."""
    numbers = np.array([*translation, *rotation])
    if len(translation) != 3 or len(rotation) != 4 or not np.isfinite(numbers).all() or np.abs(numbers).max() > 1e7:
        raise SourceError(f"{what}: not a pose")
    norm = float(np.linalg.norm(rotation))
    if not 0.9 < norm < 1.1:
        raise SourceError(f"{what}: its rotation is not a unit quaternion")
    w, x, y, z = np.array(rotation) / norm
    T = np.eye(4)
    T[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    T[:3, 3] = translation
    return T


def intrinsic_of(sensor: CalibratedSensorRow, what: str) -> F64:
    """(3, 3) of a camera. SourceError when it is none."""
    rows = sensor.camera_intrinsic
    return camera_matrix(rows if len({len(row) for row in rows}) == 1 else [], f"{what}: camera_intrinsic")


def truth_object(each: AnnotationRow, category: str, id: int, T_map_ego: F64) -> TruthObject | None:
    """A labelled box in the ego frame; None when its numbers are none of a box."""
    try:
        T = inverse(T_map_ego) @ pose_of(each.translation, each.rotation, "annotation")
    except SourceError:
        return None
    if len(each.size) != 3 or not all(0.0 < side < 100.0 for side in each.size):
        return None
    width, length, height = each.size
    x, y, z = transform(T, np.zeros((1, 3)))[0].tolist()
    yaw_rad = float(np.arctan2(T[1, 0], T[0, 0]))
    label = next((label for begin, label in _LABELS if category.startswith(begin)), category.rpartition(".")[2])
    return TruthObject(label, Cuboid((x, y, z), (length, width, height), yaw_rad), id, called=category)
