"""One binary message per frame, made once for every client.

    u32 little-endian   length of the header
    header              JSON, UTF-8, padded with spaces to a multiple of 4
    picture             JPEG, ``picture.bytes`` long, padded to a multiple of 4
    points              ``points`` × int16 x y z   centimetres, ego frame
                        ``points`` × int16 u v     pixels of the sent picture; -32768 where the camera cannot see it
                        ``points`` × uint16        1 + place in ``result.objects``; 0 belongs to none
                        ``points`` × uint8         0 ground, 1 unclustered, 2 cluster, 3 dropped

The header holds ``state`` (playback), ``result`` (the contract's object) and ``display``: geometry projected by the
alignment in use, in pixels of the sent picture, so that no view projects anything.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from app.snapshot import Snapshot
from pipeline.alignment import Alignment, resolve
from pipeline.results import to_json
from pipeline.types import DROPPED, F32, F64, GROUND, I32, UNCLUSTERED, Box, Frame, Path, Picture, Result

MAX_WIDTH_PX = 1280
JPEG_QUALITY = 80
UNSEEN = -32768
_GROUND_NEAR_M, _GROUND_SIDE_M = 40.0, 8.0
_GROUND_MIN_POINTS = 30


@dataclass(frozen=True)
class SentPicture:
    """The JPEG of a picture and its size; scale is sent pixels per picture pixel."""

    jpeg: bytes
    width: int
    height: int
    scale: float


class Encoder:
    """Keeps the JPEG of the last picture: while a slider moves on a paused frame, the picture is not encoded again."""

    def __init__(self) -> None:
        self._last: tuple[Picture, SentPicture] | None = None

    def message(self, snapshot: Snapshot) -> bytes | None:
        """The message for the snapshot's tick; null when there is none."""
        if snapshot.tick is None:
            return None
        frame, result = snapshot.tick.frame, snapshot.tick.result
        picture = self._picture(frame)
        scale = picture.scale if picture else 1.0
        aligned = resolve(snapshot.params.alignment, frame.camera)
        header = {
            "type": "frame",
            "made_unix_ms": snapshot.made_unix_s * 1e3,
            "detect_ms": snapshot.tick.detect_ms,
            "state": snapshot.state_json(),
            "picture": _picture_json(picture),
            "points": len(result.layers.points),
            "result": to_json(result),
            "display": display_json(result, aligned, scale),
        }
        return pack(header, picture.jpeg if picture else b"", point_arrays(result, aligned, scale))

    def _picture(self, frame: Frame) -> SentPicture | None:
        if frame.picture is None:
            return None
        if self._last is None or self._last[0] is not frame.picture:
            self._last = (frame.picture, encode_picture(frame.picture))
        return self._last[1]


def encode_picture(picture: Picture) -> SentPicture:
    """The camera's own JPEG where it is one and small enough; else encoded, at most ``MAX_WIDTH_PX`` wide."""
    height, width = picture.bgr.shape[:2]
    if picture.encoded is not None and picture.encoded[:2] == b"\xff\xd8" and width <= MAX_WIDTH_PX:
        return SentPicture(picture.encoded, width, height, 1.0)
    bgr, scale = picture.bgr, 1.0
    if width > MAX_WIDTH_PX:
        scale = MAX_WIDTH_PX / width
        small = cv2.resize(bgr, (MAX_WIDTH_PX, round(height * scale)), interpolation=cv2.INTER_AREA)
        bgr = small.astype(np.uint8, copy=False)
    _, jpeg = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return SentPicture(jpeg.tobytes(), bgr.shape[1], bgr.shape[0], scale)


def pack(header: dict[str, Any], jpeg: bytes, arrays: bytes) -> bytes:
    """The message as this module's first lines lay it out."""
    text = json.dumps(header, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    return b"".join([struct.pack("<I", len(text)), text, jpeg, b"\0" * (-len(jpeg) % 4), arrays])


def point_arrays(result: Result, aligned: Alignment | None, scale: float) -> bytes:
    """Every point of the sweep, as the message's last part."""
    points, kind = result.layers.points, result.layers.kind
    places = points[:, :3].astype(np.float64)
    xyz = np.clip(np.round(places * 100.0), -32767, 32767).astype("<i2")
    uv: npt.NDArray[np.int16] = np.full((len(points), 2), UNSEEN, "<i2")
    if aligned is not None and len(points):
        uv = _pixels_i2(aligned.project(places) * scale)
    classes: npt.NDArray[np.uint8] = np.full(len(points), 2, np.uint8)
    for value, code in ((GROUND, 0), (UNCLUSTERED, 1), (DROPPED, 3)):
        classes[kind == value] = code
    return xyz.tobytes() + uv.tobytes() + _owners(result, kind).tobytes() + classes.tobytes()


def display_json(result: Result, aligned: Alignment | None, scale: float) -> dict[str, Any]:
    """What is drawn over the picture. Boxes are those that fusion compared; ``cuboids`` are 8 corners, bottom first;
    ``path`` is the corridor laid on the ground that the sweep shows, null where it shows none."""
    layers = result.layers
    cuboids = {}
    if aligned is not None:
        for item in result.objects:
            if item.cuboid is not None:
                cuboids[str(item.id)] = _pixel_list(aligned.project(item.cuboid.corners()) * scale)
    return {
        "lidar_boxes": _boxes_json(layers.lidar_boxes, scale),
        "vision_boxes": _boxes_json(layers.vision_boxes, scale),
        "cuboids": cuboids,
        "path": _path_json(result.path, ground_plane(layers.points, layers.kind), aligned, scale),
    }


def ground_plane(points: F32, kind: I32) -> F64 | None:
    """(3,) a, b, c of z = a·x + b·y + c: least squares through the ground points ahead; null with too few."""
    near = (kind == GROUND) & (points[:, 0] > 0) & (points[:, 0] < _GROUND_NEAR_M)
    near &= np.abs(points[:, 1]) < _GROUND_SIDE_M
    ground = points[near, :3].astype(np.float64)
    if len(ground) < _GROUND_MIN_POINTS:
        return None
    design = np.column_stack([ground[:, :2], np.ones(len(ground))])
    return np.asarray(np.linalg.lstsq(design, ground[:, 2], rcond=None)[0])


def _path_json(path: Path, plane: F64 | None, aligned: Alignment | None, scale: float) -> dict[str, Any] | None:
    if plane is None or aligned is None:
        return None

    def on_ground(line: F64) -> list[list[float] | None]:
        xyz = np.column_stack([line, line @ plane[:2] + plane[2]])
        return _pixel_list(aligned.project(xyz) * scale)

    return {"center": on_ground(path.center), "left": on_ground(path.left), "right": on_ground(path.right)}


def _owners(result: Result, kind: I32) -> npt.NDArray[np.uint16]:
    """(N,) for each point, 1 + the place of its object in ``result.objects``."""
    cluster_of_track = {t.id: t.obstacle.cluster for t in result.layers.lidar_tracks if not t.carried}
    owner: npt.NDArray[np.uint16] = np.zeros(int(kind.max(initial=-1)) + 2, "<u2")
    for place, item in enumerate(result.objects):
        cluster = cluster_of_track.get(item.lidar_track) if item.lidar_track is not None else None
        if cluster is not None and 0 <= cluster < len(owner) - 1:
            owner[cluster] = place + 1
    return owner[np.where(kind >= 0, kind, len(owner) - 1)]


def _pixels_i2(uv: F64) -> npt.NDArray[np.int16]:
    seen = ~np.isnan(uv[:, :1])
    return np.where(seen, np.clip(np.nan_to_num(uv), -32767, 32767), UNSEEN).round().astype("<i2")


def _pixel_list(uv: F64) -> list[list[float] | None]:
    return [None if np.isnan(u) else [round(float(u), 1), round(float(v), 1)] for u, v in uv]


def _boxes_json(boxes: dict[int, Box], scale: float) -> dict[str, list[float]]:
    return {str(number): [round(value * scale, 1) for value in box] for number, box in sorted(boxes.items())}


def _picture_json(picture: SentPicture | None) -> dict[str, Any] | None:
    if picture is None:
        return None
    return {"width": picture.width, "height": picture.height, "scale": picture.scale, "bytes": len(picture.jpeg)}
