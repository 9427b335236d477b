"""ROS messages → the types of the pipeline. A message that cannot be used raises BadMessage with the reason."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.formats.file_reading import decode_image
from pipeline.formats.point_cloud_fields import MOST_POINTS, Cloud, cloud_of
from pipeline.types import U8, CameraImage, EgoState, GnssFix, GnssQuality
from pipeline.types.source import SourceError

_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""sensor_msgs/PointField's datatypes."""
_CONVERSIONS = {
    "rgb8": cv2.COLOR_RGB2BGR,
    "rgba8": cv2.COLOR_RGBA2BGR,
    "bgra8": cv2.COLOR_BGRA2BGR,
    "mono8": cv2.COLOR_GRAY2BGR,
    "bayer_rggb8": cv2.COLOR_BayerBG2BGR,
    "bayer_bggr8": cv2.COLOR_BayerRG2BGR,
    "bayer_gbrg8": cv2.COLOR_BayerGR2BGR,
    "bayer_grbg8": cv2.COLOR_BayerGB2BGR,
    "yuv422": cv2.COLOR_YUV2BGR_UYVY,
    "uyvy": cv2.COLOR_YUV2BGR_UYVY,
    "yuv422_yuy2": cv2.COLOR_YUV2BGR_YUYV,
    "yuyv": cv2.COLOR_YUV2BGR_YUYV,
}
_CHANNELS = {"bgr8": 3, "rgb8": 3, "bgra8": 4, "rgba8": 4, "yuv422": 2, "uyvy": 2, "yuv422_yuy2": 2, "yuyv": 2}


class BadMessage(Exception):
    """The text is the reason."""


def stamp_ns(message: Any, recorded_ns: int) -> tuple[int, bool]:
    """The header's time, and whether there is one; otherwise the recording time."""
    header = getattr(message, "header", None)
    stamp = getattr(header, "stamp", None)
    t_ns = int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec) if stamp is not None else 0
    return (t_ns, True) if t_ns > 0 else (recorded_ns, False)


def cloud(message: Any, t_ns: int, notes: list[str]) -> Cloud:
    """A PointCloud2's points by field; additional fields besides x, y, z are permitted."""
    count, step = int(message.width) * int(message.height), int(message.point_step)
    data = np.asarray(message.data, dtype=np.uint8)
    if not 0 < step <= 4096 or count > MOST_POINTS:
        raise BadMessage("a point cloud of an invalid size")
    order = ">" if message.is_bigendian else "<"
    rows, row_step = int(message.height), int(message.row_step) or int(message.width) * step
    if row_step < int(message.width) * step or len(data) < rows * row_step:
        raise BadMessage("a truncated point cloud")
    packed = data[: rows * row_step].reshape(rows, row_step)[:, : int(message.width) * step].reshape(-1)
    fields = {}
    for field in message.fields:
        kind = _TYPES.get(int(field.datatype))
        if kind is not None and int(field.count) == 1 and int(field.offset) + int(kind[1]) <= step:
            fields[str(field.name)] = (order + kind, int(field.offset))
    if not fields:
        raise BadMessage("a point cloud without fields")
    dtype = np.dtype(
        {
            "names": list(fields),
            "formats": [kind for kind, _ in fields.values()],
            "offsets": [offset for _, offset in fields.values()],
            "itemsize": step,
        }
    )
    try:
        return cloud_of(np.ascontiguousarray(packed).view(dtype), t_ns, notes)
    except SourceError as error:
        raise BadMessage(str(error)) from None


def packets(message: Any) -> list[tuple[bytes, int]]:
    """A VelodyneScan's packets, each with the time at which the driver received it (ns)."""
    return [
        (np.asarray(packet.data, dtype=np.uint8).tobytes(), int(packet.stamp.sec) * 10**9 + int(packet.stamp.nanosec))
        for packet in message.packets
    ]


def image(message: Any, t_ns: int) -> CameraImage:
    """An Image or a CompressedImage; a JPEG in the latter is kept unchanged."""
    data = np.asarray(message.data, dtype=np.uint8)
    if not hasattr(message, "encoding"):
        try:
            bgr, encoded = decode_image(data.tobytes(), str(getattr(message, "format", "image")) or "image")
        except SourceError as error:
            raise BadMessage(str(error)) from None
        return CameraImage(t_ns, bgr, encoded)
    return CameraImage(t_ns, _raw_image(message, data))


def _raw_image(message: Any, data: npt.NDArray[np.uint8]) -> U8:
    height, width, step = int(message.height), int(message.width), int(message.step)
    encoding = str(message.encoding).lower()
    encoding = {"8uc1": "mono8", "8uc3": "bgr8"}.get(encoding, encoding)
    if encoding != "bgr8" and encoding not in _CONVERSIONS:
        raise BadMessage(f"unsupported image encoding {message.encoding}")
    channels = _CHANNELS.get(encoding, 1)
    if not (0 < width <= 16384 and 0 < height <= 16384) or step < width * channels or len(data) < height * step:
        raise BadMessage("a truncated image")
    pixels = data[: height * step].reshape(height, step)[:, : width * channels]
    pixels = np.ascontiguousarray(pixels).reshape((height, width, channels) if channels > 1 else (height, width))
    try:
        bgr = pixels if encoding == "bgr8" else cv2.cvtColor(pixels, _CONVERSIONS[encoding])
    except cv2.error:
        raise BadMessage(f"an image that is not in {message.encoding}") from None
    return np.ascontiguousarray(bgr, dtype=np.uint8)


def fix(message: Any, t_ns: int, before: GnssFix | None) -> GnssFix | None:
    """A NavSatFix; speed and course, which it does not contain, are derived from the previous fix. None without a
    fix."""
    status = int(message.status.status)
    lat_deg, lon_deg, alt_m = (float(value) for value in (message.latitude, message.longitude, message.altitude))
    if status < 0 or not (abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0):
        return None
    variance = float(max(message.position_covariance[0], message.position_covariance[4]))
    knows = int(message.position_covariance_type) > 0 and 0.0 < variance < 1e8
    sigma_m = math.sqrt(variance) if knows else 3.0
    speed_mps, course_rad = _from_places(lat_deg, lon_deg, t_ns, before)
    return GnssFix(t_ns, lat_deg, lon_deg, alt_m, course_rad, speed_mps, _quality(status, sigma_m), sigma_m)


def _quality(status: int, sigma_m: float) -> GnssQuality:
    if status >= 2:
        return "rtk_fixed" if sigma_m <= 0.05 else "rtk_float"
    return "dgnss" if status == 1 else "single"


def _from_places(lat_deg: float, lon_deg: float, t_ns: int, before: GnssFix | None) -> tuple[float, float | None]:
    if before is None or not 0 < t_ns - before.t_ns < 2_000_000_000:
        return 0.0, None
    north = math.radians(lat_deg - before.lat_deg) * 6_371_000.0
    east = math.radians(lon_deg - before.lon_deg) * 6_371_000.0 * math.cos(math.radians(lat_deg))
    speed_mps = math.hypot(north, east) / ((t_ns - before.t_ns) / 1e9)
    return speed_mps, math.atan2(east, north) % (2.0 * math.pi) if speed_mps >= 0.5 else None


def own_motion(message: Any, t_ns: int) -> EgoState:
    """An Odometry's forward speed and yaw rate."""
    speed_mps, yaw_rate_radps = float(message.twist.twist.linear.x), float(message.twist.twist.angular.z)
    if not (abs(speed_mps) < 200.0 and abs(yaw_rate_radps) < 10.0):
        raise BadMessage("odometry with an invalid speed")
    return EgoState(t_ns, speed_mps, yaw_rate_radps)
