"""One binary message per frame, made once for every client.

    u32 little-endian   length of the header
    header              JSON, UTF-8, padded with spaces to a multiple of 4
    image             JPEG, ``picture.bytes`` long, padded to a multiple of 4
    points              ``points`` × int16 x y z   centimetres, ego frame
                        ``points`` × int16 u v     pixels of the sent image; -32768 where the camera cannot see it
                        ``points`` × uint16        1 + place in ``result.objects``; 0 belongs to none
                        ``points`` × uint8         0 ground, 1 unclustered, 2 cluster, 3 dropped
                        ``points`` × uint8         intensity
                        ``points`` × uint8         ring, 0 = lowest beam
                        ``points`` × uint8         ms before the sweep's newest point; 255 unknown

The header holds ``state`` (playback), ``result`` (docs/reference/results.md), ``display``: geometry projected by the
alignment in use, in pixels of the sent image, so that no view projects anything, and of live sensors ``row``: the
frame's value of each column of the timeline, which a recording's whole run gives otherwise.
"""

from __future__ import annotations

import struct
from typing import Any

import msgspec
import numpy as np

from app.drive.frame_rows import row_json, row_of
from app.engine.snapshot import Snapshot
from app.streaming.points import point_arrays
from app.streaming.ranking import ranking_json
from app.streaming.sent_image import MAX_WIDTH_PX, SentImage, encode_image
from pipeline.alignment.projection import Alignment, resolve
from pipeline.common.geometry import corners_of
from pipeline.lanes.drawn_lines import in_image, polylines
from pipeline.types import F64, Box, CameraImage, Frame, Ground, PixelWindow, Result
from pipeline.types.lane import EgoLane
from pipeline.types.result_json import to_json


class Encoder:
    """Keeps the last JPEG, so that moving a slider on a paused frame does not encode the image again."""

    def __init__(self) -> None:
        self._last: tuple[CameraImage, int, SentImage] | None = None

    def message(self, snapshot: Snapshot, width_px: int = MAX_WIDTH_PX) -> bytes | None:
        """The message for the snapshot's tick, its image at most ``width_px`` wide; None without a tick."""
        if snapshot.processed is None:
            return None
        frame, result = snapshot.processed.frame, snapshot.processed.result
        image = self._image(frame, width_px)
        scale = image.scale if image else 1.0
        aligned = resolve(snapshot.params.alignment, frame.camera)
        header = {
            "type": "frame",
            "made_unix_ms": snapshot.made_unix_s * 1e3,
            "detect_ms": snapshot.processed.detect_ms,
            "state": snapshot.state_json(),
            "picture": _image_json(image, frame),
            "points": len(result.layers.points),
            "result": to_json(result),
            "display": display_json(result, aligned, scale),
            "row": row_json(row_of(frame, result)) if snapshot.live else None,
        }
        return pack(header, image.jpeg if image else b"", point_arrays(frame, result, aligned, scale))

    def _image(self, frame: Frame, width_px: int) -> SentImage | None:
        if frame.image is None:
            return None
        if self._last is None or self._last[0] is not frame.image or self._last[1] != width_px:
            self._last = (frame.image, width_px, encode_image(frame.image, width_px))
        return self._last[2]


def pack(header: dict[str, Any], jpeg: bytes, arrays: bytes) -> bytes:
    """The message, in the layout described in the module's docstring."""
    text = msgspec.json.encode(header)
    text += b" " * (-len(text) % 4)
    return b"".join([struct.pack("<I", len(text)), text, jpeg, b"\0" * (-len(jpeg) % 4), arrays])


def display_json(result: Result, aligned: Alignment | None, scale: float) -> dict[str, Any]:
    """Overlays for the camera image. Boxes are those that fusion compared; ``cuboids`` are 8 corners, bottom first;
    ``far_view`` is the window of the detector's second pass and ``lanes_far_view`` the only one in which lane lines
    were looked for, each None without one; ``path`` is the corridor on the ground of the sweep, None without a ground.
    ``lanes`` are the ego lane's lines where the camera saw them, None without a lane detector; ``plan_lanes`` the same
    seen from above, x y in metres; ``plan_edges`` the structure beside the road, also from above, None if the path does
    not use it; ``plan_drivable`` the edges of the drivable area in the image, likewise; ``plan_traffic`` x, y and
    heading in rad of the vehicles that indicate the course of the road; ``ground`` the planes under the sweep, n·p + d
    = 0, and the segments of x in which they apply; ``ranking`` every object, best candidate for the CIPV first."""
    layers = result.layers
    path = {"center": result.path.center, "left": result.path.left, "right": result.path.right}
    return {
        "lidar_boxes": _boxes_json(layers.lidar_boxes, scale),
        "vision_boxes": _boxes_json(layers.vision_boxes, scale),
        "far_view": _window_json(result.sensors.far_view, scale),
        "lanes_far_view": _window_json(result.sensors.lanes_far_view, scale),
        "cuboids": _cuboids_json(result, aligned, scale),
        "path": _on_ground(path, layers.ground, aligned, scale),
        **_lanes_json(layers.lanes, aligned, scale),
        "plan_edges": np.round(layers.edges, 2).tolist() if layers.edges is not None else None,
        "plan_drivable": np.round(layers.drivable, 2).tolist() if layers.drivable is not None else None,
        "plan_traffic": np.round(layers.traffic, 3).tolist() if layers.traffic is not None else None,
        "ground": _ground_json(layers.ground),
        "vision_ranges": _vision_ranges(result),
        "ranking": ranking_json(result),
    }


def _window_json(window: PixelWindow | None, scale: float) -> list[float] | None:
    return [side * scale for side in window] if window is not None else None


def _cuboids_json(result: Result, aligned: Alignment | None, scale: float) -> dict[str, list[list[float] | None]]:
    """For each object, the pixels of its cuboid's corners. All are projected at once, since a sweep has dozens."""
    boxed = [(item.id, item.cuboid) for item in result.objects if item.cuboid is not None]
    if aligned is None or not boxed:
        return {}
    corners = corners_of([cuboid for _, cuboid in boxed]).reshape(-1, 3)
    pixels = _pixel_list(aligned.project(corners) * scale)
    return {str(number): pixels[8 * place : 8 * place + 8] for place, (number, _) in enumerate(boxed)}


def _on_ground(
    lines: dict[str, F64], ground: Ground | None, aligned: Alignment | None, scale: float
) -> dict[str, list[list[float] | None]] | None:
    """Each (K, 2) ego line as pixels, one per point; None if the ground or the camera is not known."""
    if ground is None or aligned is None or not ground.fitted.any():
        return None
    return {
        name: _pixel_list(aligned.project(np.column_stack([line, ground.height(line)])) * scale)
        for name, line in lines.items()
    }


def _lanes_json(lane: EgoLane | None, aligned: Alignment | None, scale: float) -> dict[str, Any]:
    """The ego lane's lines as seen in the image and from above."""
    if lane is None:
        return {"lanes": None, "plan_lanes": None}
    seen = in_image(lane, aligned) if aligned is not None else None
    return {
        "lanes": {side: _pixel_list(uv * scale) for side, uv in seen.items()} if seen is not None else None,
        "plan_lanes": {side: np.round(line, 3).tolist() for side, line in polylines(lane).items()},
    }


def _ground_json(ground: Ground | None) -> dict[str, Any] | None:
    if ground is None or not ground.fitted.any():
        return None
    return {"edges": np.round(ground.edges, 2).tolist(), "planes": np.round(ground.planes, 5).tolist()}


def _vision_ranges(result: Result) -> dict[str, dict[str, float]]:
    tracks = {track.id: track for track in result.layers.vision_tracks}
    seen = ((item.id, tracks.get(item.vision_track)) for item in result.objects if item.vision_track is not None)
    return {
        str(number): {"distance_m": round(track.distance_m, 3), "sigma_m": round(track.sigma_m, 3)}
        for number, track in seen
        if track is not None and track.distance_m is not None and track.sigma_m is not None
    }


def _pixel_list(uv: F64) -> list[list[float] | None]:
    return [None if u != u else [u, v] for u, v in np.round(uv, 1).tolist()]


def _boxes_json(boxes: dict[int, Box], scale: float) -> dict[str, list[float]]:
    return {str(number): [round(value * scale, 1) for value in box] for number, box in sorted(boxes.items())}


def _image_json(image: SentImage | None, frame: Frame) -> dict[str, Any] | None:
    if image is None or frame.image is None:
        return None
    return {
        "width": image.width,
        "height": image.height,
        "scale": image.scale,
        "bytes": len(image.jpeg),
        "full_width": frame.image.bgr.shape[1],
        "full_height": frame.image.bgr.shape[0],
    }
