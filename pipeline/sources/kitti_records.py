"""KITTI's small text records: labels, the inertial unit's state, time stamps."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np

from pipeline.geometry import Cuboid, inverse, transform
from pipeline.sources.base import SourceError, TruthObject
from pipeline.types import F64

_LABELS = {"van": "car", "pedestrian": "person", "person_sitting": "person", "cyclist": "bicycle", "tram": "train"}
_LABEL_FIELDS = 15
_OXTS_FIELDS = 30
_OXTS_FORWARD_SPEED, _OXTS_YAW_RATE = 8, 22  # vf, wu of dataformat.txt


def parse_labels(data: bytes, T_rect_ego: F64) -> tuple[TruthObject, ...]:
    """The cuboids of a ``label_2`` file, brought from the rectified camera to the ego frame.

    In print: height width length, the middle of the *bottom* face (y points down), and rotation_y about that axis,
    0 when the length lies along the camera's x. DontCare regions are passed over; vans are cars, as detectors name
    them. SourceError when a line is none of this.
    """
    T_ego_rect = inverse(T_rect_ego)
    objects = []
    for line in data.decode("utf-8", "replace").splitlines():
        fields = line.split()
        if not fields or fields[0] == "DontCare":
            continue
        objects.append(_label(fields, T_ego_rect))
    return tuple(objects)


def _label(fields: list[str], T_ego_rect: F64) -> TruthObject:
    try:
        height, width, length, x, y, z, rotation_y = (float(field) for field in fields[8:_LABEL_FIELDS])
    except ValueError:
        raise SourceError("not a KITTI label file") from None
    numbers = np.array([height, width, length, x, y, z, rotation_y])
    if not np.all(np.isfinite(numbers)) or np.abs(numbers).max() > 1e4 or min(height, width, length) <= 0.0:
        raise SourceError("a KITTI label without place or size")
    center = transform(T_ego_rect, np.array([[x, y - height / 2, z]]))[0]
    along = T_ego_rect[:3, :3] @ np.array([np.cos(rotation_y), 0.0, -np.sin(rotation_y)])
    name = fields[0].lower()
    cuboid = Cuboid(
        (float(center[0]), float(center[1]), float(center[2])),
        (length, width, height),
        float(np.arctan2(along[1], along[0])),
    )
    return TruthObject(_LABELS.get(name, name), cuboid)


def parse_oxts(data: bytes, file: str) -> tuple[float, float]:
    """Forward speed (m/s) and yaw rate (rad/s, positive to the left) of one oxts record. SourceError names the file."""
    try:
        values = [float(word) for word in data.split()[:_OXTS_FIELDS]]
    except ValueError:
        values = []
    if len(values) == _OXTS_FIELDS:
        speed_mps, yaw_rate_radps = values[_OXTS_FORWARD_SPEED], values[_OXTS_YAW_RATE]
        if abs(speed_mps) < 200.0 and abs(yaw_rate_radps) < 10.0:
            return speed_mps, yaw_rate_radps
    raise SourceError(f"{file}: not an oxts record")


def parse_timestamps(data: bytes) -> tuple[int, ...]:
    """``2011-09-26 13:04:32.349808512`` a line, as nanoseconds since 1970 (taken as UTC); 0 for a line that is none."""
    return tuple(_nanoseconds(line.strip()) for line in data.decode("utf-8", "replace").splitlines())


def _nanoseconds(text: str) -> int:
    whole, _, fraction = text.partition(".")
    try:
        seconds = int(datetime.strptime(whole, "%Y-%m-%d %H:%M:%S").replace(tzinfo=UTC).timestamp())
        return seconds * 1_000_000_000 + (int(fraction[:9].ljust(9, "0")) if fraction else 0)
    except (ValueError, OverflowError):
        return 0
