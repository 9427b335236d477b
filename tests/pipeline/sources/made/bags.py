"""Small ROS bags: a LiDAR's clouds or packets, a camera, GNSS, odometry, transforms."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from pipeline.types import Sweep
from tests.pipeline.formats.velodyne.streams import drive, ring_wall

Kind = Literal["ros1", "db3", "mcap"]
HEADER_NS = 1_700_000_000_000_000_000
RECORDED_LATER_NS = 30_000_000
STEP_NS = 100_000_000
WIDTH, HEIGHT = 80, 48
_SCAN = {
    "velodyne_msgs/msg/VelodynePacket": "builtin_interfaces/Time stamp\nuint8[1206] data",
    "velodyne_msgs/msg/VelodyneScan": "std_msgs/Header header\nvelodyne_msgs/VelodynePacket[] packets",
}
_ROS1 = {name: text.replace("builtin_interfaces/Time", "time") for name, text in _SCAN.items()} | {
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms"
}
POINT = np.dtype(
    {
        "names": ["x", "y", "z", "intensity", "ring", "time"],
        "formats": ["<f4", "<f4", "<f4", "<f4", "<u2", "<f4"],
        "offsets": [0, 4, 8, 16, 20, 24],
        "itemsize": 32,
    }
)
"""The layout of points in velodyne_pointcloud."""


@cache
def _store(ros1: bool) -> Any:
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    for name, text in (_ROS1 if ros1 else _SCAN).items():
        store.register(get_types_from_msg(text, name))
    return store


class BagWriter:
    """Writes one bag of ROS 1 or ROS 2 from the same messages."""

    def __init__(self, path: Path, kind: Kind) -> None:
        self.kind = kind
        self.store = _store(kind == "ros1")
        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        self._writer: Any = Writer1(path) if kind == "ros1" else Writer2(path, version=9, storage_plugin=plugin)
        self._connections: dict[str, Any] = {}

    def __enter__(self) -> BagWriter:
        self._writer.open()
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.close()

    def write(self, topic: str, message: Any, recorded_ns: int) -> None:
        kind = message.__msgtype__
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(topic, kind, typestore=self.store)
        to_bytes = self.store.serialize_ros1 if self.kind == "ros1" else self.store.serialize_cdr
        self._writer.write(self._connections[topic], recorded_ns, to_bytes(message, kind))

    def make(self, kind: str, **values: Any) -> Any:
        """A message, by its ROS 2 type name. In ROS 1, it has ``seq``, and CameraInfo's fields have other names."""
        return self.store.types[kind](**values)

    def time(self, t_ns: int) -> Any:
        return self.make("builtin_interfaces/msg/Time", sec=t_ns // 10**9, nanosec=t_ns % 10**9)

    def header(self, t_ns: int, frame_id: str) -> Any:
        extra = {"seq": 0} if self.kind == "ros1" else {}
        return self.make("std_msgs/msg/Header", stamp=self.time(t_ns), frame_id=frame_id, **extra)

    def cloud(self, sweep: Sweep, t_ns: int, dtype: np.dtype[Any] = POINT) -> Any:
        rows = np.zeros(len(sweep.points), dtype)
        for index, name in enumerate(("x", "y", "z", "intensity")):
            rows[name] = sweep.points[:, index]
        if "ring" in (dtype.names or ()):
            rows["ring"] = sweep.ring
            rows["time"] = np.linspace(-0.05, 0.05, len(rows))
        kinds = {"<f4": 7, "<u2": 4}
        fields = [
            self.make("sensor_msgs/msg/PointField", name=name, offset=offset, datatype=kinds[kind.str], count=1)
            for name, (kind, offset) in ((n, dtype.fields[n][:2]) for n in dtype.names or ())  # type: ignore[index]
        ]
        return self.make(
            "sensor_msgs/msg/PointCloud2",
            header=self.header(t_ns, "velodyne"),
            height=1,
            width=len(rows),
            fields=fields,
            is_bigendian=False,
            point_step=dtype.itemsize,
            row_step=dtype.itemsize * len(rows),
            data=rows.view(np.uint8).reshape(-1),
            is_dense=True,
        )

    def scan(self, packets: list[tuple[bytes, int]]) -> Any:
        return self.make(
            "velodyne_msgs/msg/VelodyneScan",
            header=self.header(packets[0][1], "velodyne"),
            packets=[
                self.make("velodyne_msgs/msg/VelodynePacket", stamp=self.time(t), data=np.frombuffer(data, np.uint8))
                for data, t in packets
            ],
        )

    def jpeg(self, t_ns: int, grey: int) -> Any:
        data = cv2.imencode(".jpg", np.full((HEIGHT, WIDTH, 3), grey, np.uint8))[1].reshape(-1)
        header = self.header(t_ns, "camera_optical")
        return self.make("sensor_msgs/msg/CompressedImage", header=header, format="jpeg", data=data)

    def image(self, t_ns: int, pixels: np.ndarray[Any, np.dtype[np.uint8]], encoding: str) -> Any:
        step = pixels[0].size
        return self.make(
            "sensor_msgs/msg/Image",
            header=self.header(t_ns, "camera_optical"),
            height=len(pixels),
            width=pixels.shape[1],
            encoding=encoding,
            is_bigendian=0,
            step=step,
            data=pixels.reshape(-1),
        )

    def camera_info(self, t_ns: int) -> Any:
        names = ("D", "K", "R", "P") if self.kind == "ros1" else ("d", "k", "r", "p")
        K = np.array([60.0, 0, 40, 0, 60, 24, 0, 0, 1])
        values = (np.zeros(5), K, np.eye(3).reshape(-1), np.zeros(12))
        zero = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
        return self.make(
            "sensor_msgs/msg/CameraInfo",
            header=self.header(t_ns, "camera_optical"),
            height=HEIGHT,
            width=WIDTH,
            distortion_model="plumb_bob",
            binning_x=0,
            binning_y=0,
            roi=self.make("sensor_msgs/msg/RegionOfInterest", **zero),
            **dict(zip(names, values, strict=True)),
        )

    def transforms(self, *edges: tuple[str, str, tuple[float, float, float], tuple[float, float, float, float]]) -> Any:
        """A message of transforms. Each edge: parent, child, translation, quaternion x y z w."""
        made = []
        for parent, child, (x, y, z), (qx, qy, qz, qw) in edges:
            moved = self.make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)
            turned = self.make("geometry_msgs/msg/Quaternion", x=qx, y=qy, z=qz, w=qw)
            transform = self.make("geometry_msgs/msg/Transform", translation=moved, rotation=turned)
            header = self.header(HEADER_NS, parent)
            made.append(
                self.make(
                    "geometry_msgs/msg/TransformStamped", header=header, child_frame_id=child, transform=transform
                )
            )
        return self.make("tf2_msgs/msg/TFMessage", transforms=made)

    def fix(self, t_ns: int, lat_deg: float, status: int = 2) -> Any:
        return self.make(
            "sensor_msgs/msg/NavSatFix",
            header=self.header(t_ns, "gps"),
            status=self.make("sensor_msgs/msg/NavSatStatus", status=status, service=1),
            latitude=lat_deg,
            longitude=9.0,
            altitude=500.0,
            position_covariance=np.diag([4e-4, 4e-4, 1e-3]).reshape(-1),
            position_covariance_type=2,
        )

    def odometry(self, t_ns: int, speed_mps: float, yaw_rate_radps: float) -> Any:
        vector = lambda x, z: self.make("geometry_msgs/msg/Vector3", x=x, y=0.0, z=z)  # noqa: E731
        pose = self.make(
            "geometry_msgs/msg/Pose",
            position=self.make("geometry_msgs/msg/Point", x=0.0, y=0.0, z=0.0),
            orientation=self.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
        )
        twist = self.make("geometry_msgs/msg/Twist", linear=vector(speed_mps, 0.0), angular=vector(0.0, yaw_rate_radps))
        return self.make(
            "nav_msgs/msg/Odometry",
            header=self.header(t_ns, "odom"),
            child_frame_id="base_link",
            pose=self.make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=np.zeros(36)),
            twist=self.make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.zeros(36)),
        )


OPTICAL = (-0.5, 0.5, -0.5, 0.5)
"""Quaternion of an optical frame (z forward, x right, y down) in its body frame."""


def write_bag(path: Path, kind: Kind = "db3", sweeps: int = 3, every: int = 1) -> Path:
    """A bag of a car at 12 m/s: clouds, images 20 ms later, fixes, odometry. The LiDAR is turned 90° to the left on the
    car, with the camera 0.3 m above it. every: keep only every n-th point of the clouds."""
    with BagWriter(path, kind) as bag:
        half = float(np.sqrt(0.5))
        tree = bag.transforms(
            ("base_link", "velodyne", (1.0, 0.0, 0.5), (0.0, 0.0, half, half)),
            ("base_link", "camera_link", (1.0, 0.0, 0.8), (0.0, 0.0, 0.0, 1.0)),
            ("camera_link", "camera_optical", (0.0, 0.0, 0.0), OPTICAL),
        )
        bag.write("/tf_static", tree, HEADER_NS)
        bag.write("/front/camera_info", bag.camera_info(HEADER_NS), HEADER_NS)
        for index in range(sweeps):
            t_ns = HEADER_NS + index * STEP_NS
            late_ns = t_ns + RECORDED_LATER_NS
            bag.write("/odom", bag.odometry(t_ns - 10_000_000, 12.0, 0.1), late_ns)
            bag.write("/fix", bag.fix(t_ns - 5_000_000, 47.0 + index * 1.2 / 111_195), late_ns)
            wall = ring_wall(t_ns, 10.0 - 0.1 * index)
            few = replace(wall, points=wall.points[::every], ring=wall.ring[::every])
            bag.write("/velodyne_points", bag.cloud(few, t_ns), late_ns)
            bag.write("/front/image_raw/compressed", bag.jpeg(t_ns + 20_000_000, 60 + 40 * index), late_ns)
    return path


def write_packet_bag(path: Path, kind: Kind = "db3", sweeps: int = 4) -> Path:
    """VelodyneScan messages that begin and end ahead of the car, like those of some drivers."""
    stream = drive(sweeps)
    with BagWriter(path, kind) as bag:
        for begin in range(0, len(stream), 75):
            part = stream[max(0, begin - 38) : begin + 37]
            bag.write("/velodyne_packets", bag.scan(part), part[-1][1] + 1_000_000)
        bag.write("/velodyne_packets", bag.scan(stream[-38:]), stream[-1][1] + 2_000_000)
    return path


def write_long_bag(path: Path, sweeps: int) -> Path:
    """Clouds and raw 720p images at 10 Hz, 3 MB each time."""
    pixels = np.random.default_rng(0).integers(0, 255, (720, 1280, 3), dtype=np.uint8)
    with BagWriter(path, "mcap") as bag:
        for index in range(sweeps):
            t_ns = HEADER_NS + index * STEP_NS
            bag.write("/velodyne_points", bag.cloud(ring_wall(t_ns), t_ns), t_ns + RECORDED_LATER_NS)
            bag.write("/front/image_raw", bag.image(t_ns, pixels, "bgr8"), t_ns + RECORDED_LATER_NS)
    return path
