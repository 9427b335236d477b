"""KITTI's small text records: labels, the inertial unit's state, timestamps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np

from pipeline.common.geometry import Cuboid, inverse, transform
from pipeline.common.time_range import is_time
from pipeline.types import F64, Box, GnssQuality
from pipeline.types.frame import SLOWEST_COURSE_MPS
from pipeline.types.source import SourceError, TruthObject

DONT_CARE = "DontCare"
"""KITTI's class of a region without labels."""
UNLABELLED = "dont care"
"""Name of such a region in this program."""
_LABELS = {
    "dontcare": UNLABELLED,
    "van": "car",
    "pedestrian": "person",
    "person_sitting": "person",
    "cyclist": "bicycle",
    "tram": "train",
}
_KINDS = {
    UNLABELLED: DONT_CARE,
    "car": "Car",
    "truck": "Truck",
    "person": "Pedestrian",
    "bicycle": "Cyclist",
    "train": "Tram",
}
NO_CUBOID = (-1.0, -1.0, -1.0, -1000.0, -1000.0, -1000.0, -10.0)
NO_BOX = (-1.0, -1.0, -1.0, -1.0)
_LABEL_FIELDS = 15
_LARGEST_PX = 1e6
_OXTS_FIELDS = 30
_LAT, _LON, _ALT, _YAW, _NORTH_MPS, _EAST_MPS, _FORWARD_MPS = 0, 1, 2, 5, 6, 7, 8  # as in dataformat.txt
_YAW_RATE, _POSITION_ERROR, _POSITION_MODE = 22, 23, 27
_QUALITY: dict[int, GnssQuality] = {3: "single", 4: "dgnss", 5: "rtk_float", 6: "rtk_fixed", 7: "dgnss", 8: "dgnss"}
"""OXTS's position modes that are a fix; below 3 the unit reckons from what it had."""
_VELODYNE_FROM_IMU_M = (0.81, -0.32)
"""Forward and left, from calib_imu_to_velo.txt, which is the same to a centimetre in all drives."""
_METRES_A_DEGREE = 111_320.0


class LabelRow(NamedTuple):
    """One line of a label file, ego frame."""

    kind: str
    """KITTI's own class name."""
    label: str
    """The corresponding class of this program."""
    cuboid: Cuboid | None
    """None if the line contains no cuboid."""
    bbox: Box | None
    """Pixels of the rectified image; None if the line contains no box."""
    truncation: float | None = None
    """0–1 of the object outside the image; None where unknown."""
    occlusion: int | None = None
    """0 visible, 1 partly, 2 largely hidden; None where unknown."""


def parse_labels(data: bytes, T_rect_ego: F64) -> tuple[TruthObject, ...]:
    """The objects of a ``label_2`` file, converted from the rectified camera to the ego frame.

    Fields: height width length, the centre of the *bottom* face (y points down), and rotation_y about that axis, 0 if
    the length is along the camera's x. DontCare regions are skipped; vans become cars, as in detectors. SourceError for
    an invalid line, or an object of unknown position.
    """
    T_ego_rect = inverse(T_rect_ego)
    objects = []
    for line in data.decode("utf-8", "replace").splitlines():
        fields = line.split()
        if not fields or fields[0] == DONT_CARE:
            continue
        row = parse_row(fields, T_ego_rect)
        if row.cuboid is None:
            raise SourceError("a KITTI label without position or size")
        objects.append(truth_of(row, row.cuboid))
    return tuple(objects)


def truth_of(row: LabelRow, cuboid: Cuboid) -> TruthObject:
    """A labelled object of a row whose place is known."""
    called = row.kind if row.kind != kind_of(row.label) else ""
    return TruthObject(row.label, cuboid, None, row.bbox, called, row.truncation, row.occlusion)


def parse_row(fields: Sequence[str], T_ego_rect: F64) -> LabelRow:
    """One line that was split at its blanks. SourceError when it is none."""
    if len(fields) not in (_LABEL_FIELDS, _LABEL_FIELDS + 1):  # the last one is a detector's score
        raise SourceError(f"a KITTI label with {len(fields)} fields instead of {_LABEL_FIELDS}")
    try:
        truncated, occluded, _, x1, y1, x2, y2, *place = (float(field) for field in fields[1:_LABEL_FIELDS])
    except ValueError:
        raise SourceError("a KITTI label with a field that is not a number") from None
    box: Box = (x1, y1, x2, y2)
    if not all(math.isfinite(value) and abs(value) < _LARGEST_PX for value in (truncated, occluded, *box)):
        raise SourceError("a KITTI label with invalid numbers")
    # the tracking benchmark writes its regions' missing numbers in another order than the object benchmark
    is_region = fields[0] == DONT_CARE and min(place[:3]) <= 0.0
    cuboid = cuboid_from_label(place, T_ego_rect) if tuple(place) != NO_CUBOID and not is_region else None
    seen = box if box != NO_BOX else None
    cut = truncated if 0.0 <= truncated <= 1.0 and cuboid is not None else None
    hidden = int(occluded) if occluded in (0.0, 1.0, 2.0) and cuboid is not None else None
    return LabelRow(fields[0], label_name(fields[0]), cuboid, seen, cut, hidden)


def label_name(kind: str) -> str:
    """KITTI's type of an object as detectors name it."""
    name = kind.lower()
    return _LABELS.get(name, name.replace("_", " "))


def kind_of(label: str) -> str:
    """KITTI's type for a class; other classes are written with a capital and without spaces."""
    return _KINDS.get(label) or "_".join(label.split()).capitalize() or "Misc"


def cuboid_from_label(numbers: Sequence[float], T_ego_rect: F64) -> Cuboid:
    """A label's height, width, length, x, y, z and rotation_y as a cuboid in the ego frame. SourceError when these are
    no place and size."""
    height, width, length, x, y, z, rotation_y = numbers
    if not np.all(np.isfinite(numbers)) or np.abs(numbers).max() > 1e4 or min(height, width, length) <= 0.0:
        raise SourceError("a KITTI label without position or size")
    center = transform(T_ego_rect, np.array([[x, y - height / 2, z]]))[0]
    along = T_ego_rect[:3, :3] @ np.array([np.cos(rotation_y), 0.0, -np.sin(rotation_y)])
    return Cuboid(
        (float(center[0]), float(center[1]), float(center[2])),
        (length, width, height),
        float(np.arctan2(along[1], along[0])),
    )


def cuboid_to_label(cuboid: Cuboid, T_rect_ego: F64) -> tuple[float, ...]:
    """The inverse of ``cuboid_from_label``: height, width, length, x, y, z, rotation_y in −π…π.

    A turn about the camera's y is one about ego z only as long as the camera is level; the one sought is that whose
    length axis, seen from above, points along the cuboid's.
    """
    x, y, z = transform(T_rect_ego, np.array([cuboid.center]))[0]
    length, width, height = cuboid.size
    c, s = np.cos(cuboid.yaw_rad), np.sin(cuboid.yaw_rad)
    (right_x, _, ahead_x), (right_y, _, ahead_y) = T_rect_ego[:3, 0], T_rect_ego[:3, 1]
    rotation_y = np.arctan2(right_x * s - right_y * c, ahead_x * s - ahead_y * c)
    along = np.cos(rotation_y) * np.array([right_x, right_y]) - np.sin(rotation_y) * np.array([ahead_x, ahead_y])
    if along @ [c, s] < 0.0:
        rotation_y += np.pi if rotation_y <= 0.0 else -np.pi
    return height, width, length, float(x), float(y + height / 2), float(z), float(rotation_y)


class Oxts(NamedTuple):
    """One record of the inertial unit."""

    speed_mps: float
    """Forwards."""
    yaw_rate_radps: float
    """Positive to the left."""
    lat_deg: float
    """Of the Velodyne, WGS 84."""
    lon_deg: float
    """Of the Velodyne, WGS 84."""
    alt_m: float
    """Of the Velodyne."""
    course_rad: float | None
    """Clockwise from north; None when the car stands."""
    sigma_m: float
    """The unit's own accuracy of the place."""
    quality: GnssQuality | None
    """None without a satellite fix."""


def parse_oxts(data: bytes, file: str) -> Oxts:
    """One oxts record. SourceError names the file."""
    try:
        values = [float(word) for word in data.split()[:_OXTS_FIELDS]]
    except ValueError:
        values = []
    if len(values) != _OXTS_FIELDS or not np.all(np.isfinite(values)):
        raise SourceError(f"{file}: not an oxts record")
    speed_mps, yaw_rate_radps, lat_deg, lon_deg = (values[k] for k in (_FORWARD_MPS, _YAW_RATE, _LAT, _LON))
    if not (abs(speed_mps) < 200.0 and abs(yaw_rate_radps) < 10.0 and abs(lat_deg) < 89.0 and abs(lon_deg) <= 180.0):
        raise SourceError(f"{file}: not an oxts record")
    east, north = values[_EAST_MPS], values[_NORTH_MPS]
    forward, left = _VELODYNE_FROM_IMU_M
    c, s = np.cos(values[_YAW]), np.sin(values[_YAW])  # counter-clockwise from east
    return Oxts(
        speed_mps,
        yaw_rate_radps,
        lat_deg + (forward * s + left * c) / _METRES_A_DEGREE,
        lon_deg + (forward * c - left * s) / (_METRES_A_DEGREE * np.cos(np.radians(lat_deg))),
        values[_ALT],
        float(np.arctan2(east, north) % (2.0 * np.pi)) if np.hypot(east, north) >= SLOWEST_COURSE_MPS else None,
        max(values[_POSITION_ERROR], 0.01),
        _QUALITY.get(int(np.clip(values[_POSITION_MODE], -1, 99))),
    )


def parse_timestamps(data: bytes) -> tuple[int, ...]:
    """``2011-09-26 13:04:32.349808512`` a line, as nanoseconds since 1970 (taken as UTC); 0 for a line that is none."""
    return tuple(_nanoseconds(line.strip()) for line in data.decode("utf-8", "replace").splitlines())


def _nanoseconds(text: str) -> int:
    whole, _, fraction = text.partition(".")
    try:
        seconds = int(datetime.strptime(whole, "%Y-%m-%d %H:%M:%S").replace(tzinfo=UTC).timestamp())
        t_ns = seconds * 1_000_000_000 + (int(fraction[:9].ljust(9, "0")) if fraction else 0)
        return t_ns if is_time(t_ns) else 0
    except (ValueError, OverflowError):
        return 0
