"""Scans of further ranging sensors, such as a radar, as point clouds: viewers draw them, and floats keep their bits."""

from __future__ import annotations

import numpy as np

from pipeline.recording import topics
from pipeline.recording.errors import Damaged
from pipeline.recording.session.messages import cloud_message, packed_fields, parsed
from pipeline.types import RangeScan

_XYZ = ("x", "y", "z")


def range_scan_message(sensor: str, scan: RangeScan) -> bytes:
    """``foxglove.PointCloud`` of a further ranging sensor in the ego frame: x y z and its other values, float32."""
    packed = np.empty(len(scan.points), dtype=[(name, "<f4") for name in (*_XYZ, *scan.values)])
    for column, name in enumerate(_XYZ):
        packed[name] = scan.points[:, column]
    for name, values in scan.values.items():
        packed[name] = values
    return cloud_message(topics.scan_topic(sensor), packed, scan.t_ns)


def range_scan_from(sensor: str, data: bytes, t_ns: int) -> RangeScan:
    """The scan from a message of ``range_scan_message``. Damaged if it is invalid."""
    topic = topics.scan_topic(sensor)
    message = parsed(topic, data)
    names = [field.name for field in message.fields]
    if len(set(names)) != len(names) or tuple(names[:3]) != _XYZ:
        raise Damaged(f"the fields of {topic} are not those of a session")
    layout = np.dtype([(name, "<f4") for name in names])
    given = [(field.name, field.offset, field.type) for field in message.fields]
    if packed_fields(layout) != given or message.point_stride != layout.itemsize or len(message.data) % layout.itemsize:
        raise Damaged(f"the fields of {topic} are not those of a session")
    values = np.frombuffer(message.data, dtype="<f4").reshape(-1, len(names)).astype(np.float32)
    if not np.isfinite(values).all():
        raise Damaged(f"{topic} holds invalid values")
    others = {name: np.ascontiguousarray(values[:, column]) for column, name in enumerate(names) if column >= 3}
    return RangeScan(t_ns, np.ascontiguousarray(values[:, :3]), others)
