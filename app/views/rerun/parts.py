"""Converts objects, boxes, lines and images to rerun's types; None when there are none."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import rerun as rr

from app.views import scene
from pipeline.common.geometry import F64
from pipeline.types import Box, CameraImage, FusedObject, Path, Result

FAINT, THIN, THICK, POINT = (rr.Radius.ui_points(size) for size in (0.5, 1.0, 2.5, 1.4))
"""Radii in screen points, independent of the zoom."""
_JPEG_QUALITY = 80


def sides(path: Path) -> dict[str, F64]:
    """The three lines of the corridor by name."""
    return {"center": path.center, "left": path.left, "right": path.right}


def to_bev(points: npt.NDArray[np.floating]) -> F64:
    """Ego x, y as axes of an image seen from above, with forward up: right is −y, down is −x."""
    return np.column_stack([-points[:, 1], -points[:, 0]])


def closed(ring: F64) -> F64:
    """A polygon (N, D) with its first point repeated at the end."""
    return np.vstack([ring, ring[:1]])


def cuboids(objects: list[FusedObject], result: Result, fill: rr.components.FillMode) -> rr.Boxes3D | None:
    """The LiDAR cuboids of the objects, ego frame; None without any."""
    boxes = [each.cuboid for each in objects if each.cuboid is not None]
    if not boxes:
        return None
    return rr.Boxes3D(
        centers=[box.center for box in boxes],
        sizes=[box.size for box in boxes],
        rotations=[rr.RotationAxisAngle(axis=(0, 0, 1), radians=box.yaw_rad) for box in boxes],
        colors=[scene.object_color(each, result) for each in objects],
        labels=[scene.object_text(each) for each in objects],
        show_labels=False,
        fill_mode=fill,
        radii=THIN,
    )


def footprints(objects: list[FusedObject], result: Result, ground_m: float) -> rr.LineStrips3D | None:
    """Outlines of the objects just above the ground at ``ground_m``; None without any."""
    outlines = [scene.flat_outline(each, ground_m + 0.05) for each in objects]
    if not outlines:
        return None
    colors = [scene.object_color(each, result) for each in objects]
    lines = [line for line in outlines if line is not None]
    return rr.LineStrips3D(lines, colors=colors, radii=THICK)


def labels(objects: list[FusedObject], result: Result, ground_m: float) -> rr.Points3D | None:
    """A text above each object, ego frame; None without any."""
    if not objects:
        return None
    return rr.Points3D(
        [scene.top_of(each, ground_m) for each in objects],
        colors=[scene.object_color(each, result) for each in objects],
        labels=[scene.object_text(each) for each in objects],
        show_labels=True,
        radii=POINT,
    )


def bev_labels(objects: list[FusedObject], result: Result) -> rr.Points2D | None:
    """A text on each footprint in the top view; None without any."""
    if not objects:
        return None
    return rr.Points2D(
        [to_bev(np.asarray(each.bev)).mean(axis=0) for each in objects],
        colors=[scene.object_color(each, result) for each in objects],
        labels=[scene.object_text(each) for each in objects],
        show_labels=True,
        radii=POINT,
    )


def boxes(
    boxes: dict[int, Box], colors: dict[int, tuple[int, int, int]], texts: dict[int, str], radius: Any
) -> rr.Boxes2D | None:
    """Image boxes by number, pixels; None without any."""
    if not boxes:
        return None
    return rr.Boxes2D(
        array=np.asarray(list(boxes.values())),
        array_format=rr.Box2DFormat.XYXY,
        colors=[colors[number] for number in boxes],
        labels=[texts[number] for number in boxes] if texts else None,
        radii=radius,
    )


def encoded(image: CameraImage) -> rr.EncodedImage:
    """The camera's own JPEG unchanged; a raw image is encoded here."""
    if image.encoded is not None and image.encoded.startswith(b"\xff\xd8"):
        return rr.EncodedImage(contents=image.encoded, media_type="image/jpeg")
    jpeg = cv2.imencode(".jpg", image.bgr, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1]
    return rr.EncodedImage(contents=jpeg.tobytes(), media_type="image/jpeg")
