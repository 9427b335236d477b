"""The topics of a session and their schemas, in one place.

Sensor data is in Foxglove's well-known protobuf schemas, so that Foxglove and rerun draw a session as it is; what they
have no schema for is JSON with a JSON schema beside it. The schemas come from foxglove-sdk, the messages are made and
read by protobuf.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from typing import Any

from foxglove import messages as foxglove
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory  # type: ignore[import-untyped]

from pipeline.formats.velodyne.ros import PACKET_DEFINITION, SCAN, SCAN_DEFINITION

FRAMES = "/frames"
_POINTS_SUFFIX = "/points"
POINTS = f"/lidar{_POINTS_SUFFIX}"
PACKETS = "/lidar/packets"
IMAGE = "/camera/image"
CALIBRATION = "/camera/calibration"
GNSS = "/gnss"
EGO = "/ego"
TF = "/tf"
ROUTE = "/route"
PARAMS = "/params"
RESULTS = "/results"
OBJECTS = "/objects"
MARKS = "/marks"
NOTES = "/notes"
HEALTH = "/health"
LABELS = "/labels"
LABEL_SCENE, LABEL_IMAGE = "/labels/scene", "/labels/image"
"""The labels of each frame as drawn by viewers, derived from ``LABELS`` and not read by this program."""
OF_LABELS = frozenset((LABELS, LABEL_SCENE, LABEL_IMAGE))
"""Topics that are replaced when labels are written."""

EGO_FRAME, CAMERA_FRAME = "ego", "camera"
"""Names of the frames of reference: points are in ``ego``; ``camera`` is the optical frame (z ahead, x right)."""

PROFILE = "cipv"
"""The MCAP header's profile; identifies a session."""

METADATA = "cipv"
"""Name of the metadata record with the origin of a session."""

INDEX = "cipv-frames"
"""Name of the attachment that lists all frames: pairs of little-endian int64, log time and header time, in order."""

TICKS = "cipv-ticks"
"""Name of the attachment with the small data of each frame: lines of ``/frames`` without labels and recorded
detections, one per frame, in gzip."""


@dataclass(frozen=True)
class Channel:
    """MCAP's description of a topic."""

    topic: str
    """With its slashes."""
    message_encoding: str
    """``protobuf``, ``json`` or ``ros1``."""
    schema_name: str
    """Of the messages' type."""
    schema_encoding: str
    """Encoding of ``schema_data``."""
    schema_data: bytes
    """The schema itself; empty for none."""
    metadata: tuple[tuple[str, str], ...] = ()
    """(key, value) pairs."""


_WELL_KNOWN: dict[str, Any] = {
    IMAGE: foxglove.CompressedImage,
    CALIBRATION: foxglove.CameraCalibration,
    GNSS: foxglove.LocationFix,
    TF: foxglove.FrameTransform,
    OBJECTS: foxglove.SceneUpdate,
    LABEL_SCENE: foxglove.SceneUpdate,
    LABEL_IMAGE: foxglove.ImageAnnotations,
    MARKS: foxglove.Log,
    NOTES: foxglove.Log,
}


def scan_topic(sensor: str) -> str:
    """The topic of a further ranging sensor's scans, by ``SensorKind.name``."""
    return f"/{sensor}{_POINTS_SUFFIX}"


def _well_known(topic: str) -> Any:
    """The Foxglove message of a topic; None for a topic with another schema."""
    return foxglove.PointCloud if topic.endswith(_POINTS_SUFFIX) else _WELL_KNOWN.get(topic)


_SCAN_SCHEMA = f"\n{'=' * 80}\n".join(
    (
        SCAN_DEFINITION,
        f"MSG: velodyne_msgs/VelodynePacket\n{PACKET_DEFINITION}",
        "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n",
        "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n",
    )
)
"""ROS 2's schema for raw packets with all its dependencies, in MCAP's format."""

_JSON_TITLES = {
    FRAMES: "cipv.Frame",
    EGO: "cipv.Ego",
    ROUTE: "cipv.Route",
    PARAMS: "cipv.Params",
    RESULTS: "cipv.Result",
    HEALTH: "cipv.Health",
    LABELS: "cipv.Labels",
}


def _numbers(*names: str) -> dict[str, Any]:
    return {name: {"type": "number"} for name in names}


_JSON_NUMBERS: dict[str, dict[str, Any]] = {
    EGO: _numbers("speed_mps", "yaw_rate_radps"),
    RESULTS: {
        "ego": {"type": "object", "properties": _numbers("speed_mps", "yaw_rate_radps")},
        "cipv": {
            "type": "object",
            "properties": _numbers("id", "distance_m", "closing_speed_mps", "ttc_s", "accel_mps2", "accel_sigma_mps2"),
        },
        "acc": {
            "type": "object",
            "properties": _numbers("desired_speed_mps", "accel_mps2", "accelerator", "brake")
            | {"state": {"type": "string"}},
        },
        "timing_ms": {"type": "object", "properties": _numbers("total")},
    },
}
"""Values that a user may want to plot, declared so that viewers offer them."""


@cache
def channel(topic: str) -> Channel:
    """The channel of one of this module's topics. KeyError for another."""
    if (message := _well_known(topic)) is not None:
        schema = message.get_schema()
        return Channel(topic, "protobuf", schema.name, schema.encoding, schema.data)
    if topic == PACKETS:
        return Channel(topic, "cdr", SCAN, "ros2msg", _SCAN_SCHEMA.encode())
    schema = {"title": _JSON_TITLES[topic], "type": "object", "properties": _JSON_NUMBERS.get(topic, {})}
    return Channel(topic, "json", _JSON_TITLES[topic], "jsonschema", json.dumps(schema).encode())


@cache
def message_class(topic: str) -> Any:
    """The protobuf class of a topic in a well-known schema."""
    schema = _well_known(topic).get_schema()
    return protobuf_class(schema.name, schema.data)


def protobuf_class(name: str, file_descriptor_set: bytes) -> Any:
    """The class of message ``name``, from a schema as MCAP stores it."""
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(file_descriptor_set).file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(name))
