"""Converts sensor data to and from messages in well-known schemas. Nothing is lost: floats keep their bits, a JPEG
keeps the camera's own bytes, any other image becomes a PNG."""

from __future__ import annotations

from typing import Any, Literal

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.common.files.image_decoding import TooMuch, decode_within_budget
from pipeline.common.geometry import inverse
from pipeline.recording import topics
from pipeline.recording.errors import Damaged
from pipeline.types import CameraCalibration, CameraImage, GnssFix, Sweep
from pipeline.types.camera_shot import Shot

_XYZI = ("x", "y", "z", "intensity")
_POINT: np.dtype[np.void] = np.dtype([*((name, "<f4") for name in _XYZI), ("ring", "<u2")])
_TIMED_POINT: np.dtype[np.void] = np.dtype([*((name, "<f4") for name in _XYZI), ("ring", "<u2"), ("time", "<f4")])
"""The fields of ROS's Velodyne driver; ``time`` is seconds after the cloud's timestamp."""

_NUMERIC_TYPE = {np.dtype("<f4"): 7, np.dtype("<u2"): 3}
"""``foxglove.PackedElementField.NumericType``: FLOAT32, UINT16."""

_PNG_FAST = [cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE]
"""An image's noise has no repetitions to look for: twice as fast to write, a quarter faster to read, and smaller."""
_JPEG_GOOD = [cv2.IMWRITE_JPEG_QUALITY, 95]
_DIAGONAL_KNOWN, _WARNING, _INFO = 2, 3, 2
_IDENTITY = (0.0, 0.0, 0.0, 1.0)


def points_message(sweep: Sweep) -> bytes:
    """``foxglove.PointCloud`` in the ego frame: x y z intensity float32, ring uint16, time float32 if known."""
    packed = np.empty(len(sweep.points), dtype=_POINT if sweep.time_s is None else _TIMED_POINT)
    for column, name in enumerate(_XYZI):
        packed[name] = sweep.points[:, column]
    packed["ring"] = sweep.ring
    if sweep.time_s is not None:
        packed["time"] = sweep.time_s
    return cloud_message(topics.POINTS, packed, sweep.t_ns)


def cloud_message(topic: str, packed: npt.NDArray[np.void], t_ns: int) -> bytes:
    """``foxglove.PointCloud`` in the ego frame of points with named fields."""
    return to_bytes(
        topics.message_class(topic)(
            timestamp=stamp(t_ns),
            frame_id=topics.EGO_FRAME,
            pose={"position": {}, "orientation": {"w": 1.0}},
            point_stride=packed.dtype.itemsize,
            fields=[
                {"name": name, "offset": offset, "type": kind} for name, offset, kind in packed_fields(packed.dtype)
            ],
            data=packed.tobytes(),
        )
    )


def sweep_from(data: bytes, t_ns: int, channels: int, origin: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Sweep:
    """The sweep from a message of ``points_message``. Damaged if it is invalid."""
    message = parsed(topics.POINTS, data)
    given = [(field.name, field.offset, field.type) for field in message.fields]
    layout = next((layout for layout in (_POINT, _TIMED_POINT) if packed_fields(layout) == given), None)
    if layout is None or message.point_stride != layout.itemsize or len(message.data) % layout.itemsize:
        raise Damaged("the point cloud's fields are not those of a session")
    packed = np.frombuffer(message.data, dtype=layout)
    points = np.array(packed.view(_first_of(layout))["xyzi"]).view(np.float32).reshape(-1, 4)
    time_s = packed["time"].astype(np.float32) if layout is _TIMED_POINT else None
    if not np.isfinite(points).all() or (packed["ring"] >= channels).any():
        raise Damaged("the point cloud holds invalid values")
    return Sweep(t_ns, points, packed["ring"].astype(np.uint8), channels, time_s, origin)


def _first_of(layout: np.dtype[np.void]) -> np.dtype[np.void]:
    """Layout with x, y, z and intensity of each point as one field: copying them together takes an eighth of the
    time."""
    return np.dtype({"names": ["xyzi"], "formats": ["V16"], "offsets": [0], "itemsize": layout.itemsize})


def image_message(image: CameraImage, t_ns: int) -> bytes:
    """``foxglove.CompressedImage``: the camera's own JPEG, else a PNG. t_ns: the tick, for a camera without
    timestamps."""
    taken_ns = t_ns if image.t_ns is None else image.t_ns
    if image.encoded is not None:
        return jpeg_message(image.encoded, taken_ns)
    return _compressed(cv2.imencode(".png", image.bgr, _PNG_FAST)[1].tobytes(), "png", taken_ns)


def jpeg_message(data: bytes, t_ns: int) -> bytes:
    """``foxglove.CompressedImage`` of a JPEG taken at ``t_ns``."""
    return _compressed(data, "jpeg", t_ns)


def jpeg_of(shot: Shot) -> bytes | None:
    """A JPEG of an image that was not received as one; None if it is damaged."""
    bgr = shot.bgr()
    return None if bgr is None else cv2.imencode(".jpg", bgr, _JPEG_GOOD)[1].tobytes()


def _compressed(data: bytes, kind: Literal["jpeg", "png"], t_ns: int) -> bytes:
    message = topics.message_class(topics.IMAGE)
    return to_bytes(message(timestamp=stamp(t_ns), frame_id=topics.CAMERA_FRAME, data=data, format=kind))


def image_from(data: bytes, t_ns: int | None) -> CameraImage:
    """The image from a message of ``image_message``. Damaged if it cannot be decoded."""
    message = parsed(topics.IMAGE, data)
    try:
        pixels = decode_within_budget(message.data)
    except TooMuch as error:
        raise Damaged(f"the image cannot be decoded: {error}") from None
    if pixels is None:
        raise Damaged("the image cannot be decoded")
    return CameraImage(t_ns, pixels, message.data if message.format == "jpeg" else None)


def calibration_message(camera: CameraCalibration, t_ns: int) -> bytes:
    """``foxglove.CameraCalibration``. Its D has 5 or 8 numbers, so shorter distortions are padded with zeros."""
    distortion = [float(value) for value in camera.distortion]
    model = "rational_polynomial" if len(distortion) > 5 else "plumb_bob"
    distortion += [0.0] * ((8 if len(distortion) > 5 else 5) - len(distortion))
    return to_bytes(
        topics.message_class(topics.CALIBRATION)(
            timestamp=stamp(t_ns),
            frame_id=topics.CAMERA_FRAME,
            width=camera.width,
            height=camera.height,
            distortion_model=model,
            D=distortion,
            K=camera.K.ravel().tolist(),
            R=np.eye(3).ravel().tolist(),
            P=np.column_stack([camera.K, np.zeros(3)]).ravel().tolist(),
        )
    )


def transform_messages(camera: CameraCalibration | None, t_ns: int) -> list[bytes]:
    """``foxglove.FrameTransform`` of the LiDAR, whose points are already in the ego frame, and of the camera.

    Viewers do not draw data in a frame without a transform, so the LiDAR's identity is written too.
    """
    transforms = [("lidar", (0.0, 0.0, 0.0), _IDENTITY)]
    if camera is not None:
        from scipy.spatial.transform import Rotation  # takes 0.2 s to import, only needed to write a camera's pose

        T_ego_camera = inverse(camera.T_camera_ego)
        x, y, z = (float(value) for value in T_ego_camera[:3, 3])
        turned = tuple(float(value) for value in Rotation.from_matrix(T_ego_camera[:3, :3]).as_quat())
        transforms.append((topics.CAMERA_FRAME, (x, y, z), turned))  # type: ignore[arg-type]
    return [
        to_bytes(
            topics.message_class(topics.TF)(
                timestamp=stamp(t_ns),
                parent_frame_id=topics.EGO_FRAME,
                child_frame_id=child,
                translation=dict(zip("xyz", place, strict=True)),
                rotation=dict(zip("xyzw", quaternion, strict=True)),
            )
        )
        for child, place, quaternion in transforms
    ]


def location_message(fix: GnssFix) -> bytes:
    """``foxglove.LocationFix``; its heading is the course, in degrees clockwise from north."""
    known = {} if fix.course_rad is None else {"heading": float(np.degrees(fix.course_rad)) % 360.0}
    variance = fix.sigma_m**2
    return to_bytes(
        topics.message_class(topics.GNSS)(
            timestamp=stamp(fix.t_ns),
            frame_id=topics.EGO_FRAME,
            latitude=fix.lat_deg,
            longitude=fix.lon_deg,
            altitude=fix.alt_m,
            position_covariance=[variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance],
            position_covariance_type=_DIAGONAL_KNOWN,
            metadata=[{"key": "quality", "value": fix.quality}],
            **known,
        )
    )


def log_message(topic: str, text: str, t_ns: int, *, warning: bool = False) -> bytes:
    """``foxglove.Log`` for ``/marks`` and ``/notes``."""
    level = _WARNING if warning else _INFO
    return to_bytes(topics.message_class(topic)(timestamp=stamp(t_ns), level=level, message=text, name=topic[1:]))


def log_text(topic: str, data: bytes) -> str:
    """The text of a message of ``log_message``."""
    return str(parsed(topic, data).message)


def packed_fields(layout: np.dtype[np.void]) -> list[tuple[str, int, int]]:
    """(name, offset, numeric type) of each field."""
    fields = dict(layout.fields or {})
    return [(name, fields[name][1], _NUMERIC_TYPE[fields[name][0]]) for name in layout.names or ()]


def stamp(t_ns: int) -> dict[str, int]:
    """``google.protobuf.Timestamp``."""
    seconds, nanos = divmod(t_ns, 1_000_000_000)
    return {"seconds": seconds, "nanos": nanos}


def to_bytes(message: Any) -> bytes:
    """The same message gives the same bytes."""
    return bytes(message.SerializeToString(deterministic=True))


def parsed(topic: str, data: bytes) -> Any:
    """The parsed message; protobuf's own DecodeError is not public in all versions."""
    try:
        return topics.message_class(topic).FromString(data)
    except Exception as error:
        raise Damaged(f"a message of {topic} cannot be read: {error}") from None
