"""A small frame and result of real types: a lead that both sensors see, a pole, a carried car and a far pedestrian."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import MISSING, fields
from typing import Any

import cv2
import msgspec
import numpy as np
import pytest
import viser
import zstandard
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from app.views.viser.internal_port import HEADERS, PAGE_HEADER
from pipeline.common.geometry import Cuboid
from pipeline.types import (
    GROUND,
    UNCLUSTERED,
    AccCommand,
    CameraCalibration,
    CameraImage,
    Cipv,
    EgoState,
    Frame,
    FusedObject,
    Ground,
    Layers,
    LidarTrack,
    Obstacle,
    Path,
    Point3,
    Rejection,
    Result,
    SensorHealth,
    Sweep,
)

T_NS = 1_700_000_000_000_000_000
GROUND_M = -1.2
LEAD = Cuboid((22.0, 0.2, -0.5), (4.2, 1.8, 1.4), 0.05)
POLE = Cuboid((15.0, 6.0, 0.0), (0.4, 0.4, 2.4), 0.0)


def _filled(cuboid: Cuboid, count: int, rng: np.random.Generator) -> np.ndarray:
    inside = rng.uniform(-0.5, 0.5, (count, 3)) * cuboid.size + cuboid.center
    return np.column_stack([inside, np.full(count, 80.0)]).astype(np.float32)


def _cloud() -> tuple[np.ndarray, np.ndarray]:
    """60 ground points, 40 on the lead (cluster 0), 12 on the pole (cluster 1), 5 without a cluster."""
    rng = np.random.default_rng(7)
    ground = np.column_stack(
        [rng.uniform(3, 40, 60), rng.uniform(-8, 8, 60), np.full(60, GROUND_M), np.full(60, 10.0)]
    ).astype(np.float32)
    loose = np.column_stack([rng.uniform(5, 30, 5), np.full(5, 12.0), np.full(5, 1.0), np.full(5, 5.0)])
    parts = [ground, _filled(LEAD, 40, rng), _filled(POLE, 12, rng), loose.astype(np.float32)]
    kinds = [GROUND, 0, 1, UNCLUSTERED]
    return np.vstack(parts), np.repeat(kinds, [len(part) for part in parts]).astype(np.int32)


def _object(number: int, source: str, **known: object) -> FusedObject:
    names = {each.name for each in fields(FusedObject) if each.default is MISSING and each.default_factory is MISSING}
    unknown: dict[str, object] = dict.fromkeys(names)
    fixed = {"id": number, "source": source, "seen_by": source, "hits": 4, "lidar_points": 0}
    return FusedObject(**{**unknown, **fixed, **known})  # type: ignore[arg-type]


def _corners(cuboid: Cuboid) -> tuple[tuple[float, float], ...]:
    return tuple((float(x), float(y)) for x, y in cuboid.footprint())


def make_frame(index: int = 0) -> Frame:
    points, _ = _cloud()
    bgr = np.full((120, 320, 3), (60, 90, 40), dtype=np.uint8)
    cv2.rectangle(bgr, (140, 60), (180, 90), (30, 30, 200), -1)
    t_ns = T_NS + index * 100_000_000
    T_camera_ego = np.array([[0, -1, 0, 0], [0, 0, -1, 0.3], [1, 0, 0, 0.2], [0, 0, 0, 1]], dtype=np.float64)
    K = np.array([[200.0, 0, 160], [0, 200, 60], [0, 0, 1]])
    return Frame(
        index=index,
        name=f"{index:06d}",
        t_ns=t_ns,
        sweep=Sweep(t_ns, points, np.zeros(len(points), dtype=np.uint8), 16),
        image=CameraImage(t_ns, bgr, cv2.imencode(".jpg", bgr)[1].tobytes()),
        camera=CameraCalibration(K, np.zeros(0), T_camera_ego, 320, 120),
        ego=EgoState(t_ns, 15.0, 0.0),
    )


def make_result(index: int = 0) -> Result:
    points, kind = _cloud()
    lead = _object(
        7, "VL", label="car", score=0.9, bbox=(140.0, 55.0, 182.0, 88.0), bev=_corners(LEAD), cuboid=LEAD,
        closest_point=(19.9, 0.2, -0.5), distance_m=19.9, distance_sigma_m=0.2, velocity_mps=(-2.5, 0.0),
        lidar_points=40, lidar_track=3, vision_track=1, in_path=True, in_path_probability=0.98, ttc_s=7.96,
    )  # fmt: skip
    pole = _object(
        8, "L", bev=_corners(POLE), cuboid=POLE, closest_point=(14.8, 5.8, 0.0), distance_m=15.9, distance_sigma_m=0.2,
        lidar_points=12, lidar_track=4,
    )  # fmt: skip
    truck = _object(
        9, "V", label="truck", score=0.6, bbox=(10.0, 20.0, 60.0, 70.0), distance_m=45.0, distance_sigma_m=4.0,
        bev=((47.0, 9.0), (47.0, 6.6), (45.0, 6.6), (45.0, 9.0)), closest_point=(45.0, 7.8, -1.2), vision_track=2,
        seen_by="",
    )  # fmt: skip
    person = _object(10, "V", label="person", score=0.4, bbox=(300.0, 40.0, 310.0, 70.0), vision_track=3)
    x = np.linspace(0.0, 60.0, 31)
    center = np.column_stack([x, 0.002 * x**2])
    spread = (0.1, 0.1, 0.1)
    obstacles = (
        Obstacle(0, LEAD, (19.9, 0.2, -0.5), 40, 5.0, spread),
        Obstacle(1, POLE, (14.8, 5.8, 0.0), 12, 70.0, spread),
    )
    tracks = tuple(LidarTrack(3 + i, each, (-2.5, 0.0), 4, 0, False) for i, each in enumerate(obstacles))
    return Result(
        frame=f"{index:06d}",
        t_ns=T_NS + index * 100_000_000,
        sensors=SensorHealth(0.0, len(points), 0.0, 0.0, 0.0),
        ego=EgoState(T_NS, 15.0, 0.0),
        objects=(lead, pole, truck, person),
        path=Path("yaw_rate", center, center + np.array([0, 1.5]), center - np.array([0, 1.5]), 1.5, {}, {}),
        cipv=Cipv(7, 19.9, 2.5, 7.96, "nearest in path: 19.9 m"),
        rejected=(Rejection(8, "out of path by 4.1 m"),),
        acc=AccCommand("follow", 13.0, -0.5, 0.0, 0.1, "gap below the desired one"),
        notes=(),
        timing_ms={"ground": 0.1, "cluster": 0.9, "total": 3.0},
        layers=Layers(
            points, kind, obstacles, tracks, (),
            {7: (139.0, 53.0, 183.0, 90.0)}, {7: (140.0, 55.0, 182.0, 88.0), 10: (300.0, 40.0, 310.0, 70.0)},
            ground=Ground(kind == GROUND, np.array([[0.0, 0.0, 1.0, 1.2]]), np.array([-50.0, 50.0]), np.ones(1, bool)),
        ),
    )  # fmt: skip


@pytest.fixture
def frame() -> Frame:
    return make_frame()


@pytest.fixture
def result() -> Result:
    return make_result()


@pytest.fixture
def frames() -> list[tuple[Frame, Result]]:
    """Three ticks, 0.1 s apart."""
    return [(make_frame(index), make_result(index)) for index in range(3)]


class SceneClient:
    """The browser's side of viser's protocol: collects the server's messages, and can move a slider.

    Messages come as ``[8 bytes inner size][8 bytes packed size][zstd of msgpack][arrays]``.
    """

    def __init__(self, connection: ClientConnection) -> None:
        self.connection = connection
        self.messages: list[dict[str, Any]] = []
        self.largest = 0

    def read_until(self, wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """The first message that fulfils ``wanted``; TimeoutError without one."""
        while True:
            data = self.connection.recv(timeout=180)
            assert isinstance(data, bytes)
            self.largest = max(self.largest, len(data))
            packed = data[16 : 16 + int.from_bytes(data[8:16], "little")]
            batch = msgspec.msgpack.decode(zstandard.decompress(packed))["messages"]
            self.messages += batch
            found = next((each for each in batch if wanted(each)), None)
            if found is not None:
                return found

    def read_present_state(self) -> None:
        self.look()
        self.read_until(lambda each: each["type"] == "ReplayDoneMessage")

    def read_names(self, *wanted: str) -> None:
        """Read until these are the texts of the visible name tags, in any order; TimeoutError if they never are."""
        while sorted(self.texts()) != sorted(wanted):
            self.read_until(lambda each: True)

    def nodes(self) -> dict[str, bool]:
        """Name → visibility of every scene node, after all messages so far."""
        seen: dict[str, bool] = {}
        for each in self.messages:
            if each["type"] == "SetSceneNodeVisibilityMessage":
                seen[each["name"]] = each["visible"]
            elif each["type"] == "RemoveSceneNodeMessage":
                seen.pop(each["name"], None)
        return seen

    def owned(self, name: str) -> bool:
        """Whether this browser has its own node of that name, which overrides the shared one."""
        of_name = [each for each in self.messages if each.get("name") == name and each.get("owner")]
        return bool(of_name) and of_name[-1]["type"] != "RemoveSceneNodeMessage"

    def texts(self) -> list[str]:
        """The texts of the visible labels."""
        words: dict[str, str] = {}
        for each in self.messages:
            written = each.get("props", each.get("updates", {}))
            if each.get("name", "").startswith("/own/names/") and "text" in written:
                words[each["name"]] = written["text"]
        return [words[name] for name, shown in self.nodes().items() if shown and name in words]

    def inputs(self, label: str) -> list[dict[str, Any]]:
        """Every input of the panel with this label, in order."""
        return [each for each in self.messages if each.get("props", {}).get("label") == label]

    def look(self, x: float = -9.0, y: float = 0.0) -> None:
        """Send the camera, which a browser does first; only then does viser count it as a client. It looks along x from
        this position."""
        pose = {"wxyz": (0.5, -0.5, 0.5, -0.5), "position": (x, y, 5.0), "look_at": (x + 18.0, y, 5.0)}
        lens = {"fov": 1.2, "near": 0.01, "far": 1000.0, "image_height": 600, "image_width": 800}
        self._send("ViewerCameraMessage", **pose, **lens, up_direction=(0.0, 0.0, 1.0))

    def move(self, uuid: str, value: object) -> None:
        """Send what a browser sends when the user moves a slider."""
        self._send("GuiUpdateMessage", uuid=uuid, updates={"value": value})

    def click(self, origin: Point3, direction: Point3) -> None:
        """Send what a browser sends when the user clicks into the scene: the ray through that pixel."""
        place = {"screen_pos": ((0.5, 0.5),), "modifier": None}
        self._send("ScenePointerMessage", event_type="click", ray_origin=origin, ray_direction=direction, **place)

    def _send(self, kind: str, **fields: Any) -> None:
        self.connection.send(msgspec.msgpack.encode({"type": kind, **fields}))


OpenScene = Callable[..., SceneClient]


@pytest.fixture
def open_scene() -> Iterator[OpenScene]:
    """Connect to ``ws://127.0.0.1:<port><path>`` as viser's own page does."""
    with ExitStack() as stack:

        def opening(
            port: int, path: str = "", version: str = viser.__version__, page: str = "", **options: Any
        ) -> SceneClient:
            if not path:  # viser's own port, which the proxy uses
                options["additional_headers"] = HEADERS | {PAGE_HEADER: page}
            connection = connect(
                f"ws://127.0.0.1:{port}{path}",
                subprotocols=[Subprotocol(f"viser-v{version}")],
                compression=None,
                max_size=None,
                proxy=None,
                **options,
            )
            return SceneClient(stack.enter_context(connection))

        yield opening
