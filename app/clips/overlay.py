"""The camera image with the pipeline's result drawn over it, for videos and reports."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from app.streaming.encode import display_json
from app.views.colors import Rgb, rgb, role_of
from app.views.scene import cipv_id, object_text, stands_out
from pipeline.alignment.projection import resolve
from pipeline.common.geometry import CUBOID_EDGES
from pipeline.params import Params
from pipeline.types import U8, Frame, FusedObject, Result

WIDTH_PX = 1280
_BLANK = (720, 1280)
_BANNER_PX = 58
_FONT = cv2.FONT_HERSHEY_SIMPLEX
_PATH_OPACITY = 0.25
_STATES = {"warn": "WARNING", "partial_brake": "PARTIAL BRAKING", "full_brake": "FULL BRAKING"}


def draw_frame(frame: Frame, result: Result, params: Params) -> U8:
    """(H, W, 3) uint8 BGR, at most ``WIDTH_PX`` wide, with even sides as video codecs require: path, boxes, cuboids of
    the highlighted objects, and a banner with the CIPV. Without an image, a black background says so."""
    canvas, scale = _background(frame)
    aligned = resolve(params.alignment, frame.camera)
    display = display_json(result, aligned, scale)
    _draw_path(canvas, display["path"])
    shown = sorted(result.objects, key=lambda item: (item.id == cipv_id(result), -(item.distance_m or 0.0)))
    for item in shown:
        if stands_out(item, result):
            _draw_object(canvas, item, result, display)
    if frame.image is None:
        _text(canvas, "no image in this frame", (24, canvas.shape[0] // 2), rgb("warning"), 0.9)
    _draw_banner(canvas, frame, result)
    return canvas


def _background(frame: Frame) -> tuple[U8, float]:
    """The canvas, and its scale in canvas pixels per image pixel."""
    if frame.image is None:
        return np.zeros((*_BLANK, 3), np.uint8), 1.0
    height, width = frame.image.bgr.shape[:2]
    scale = min(1.0, WIDTH_PX / width)
    even = (max(2, round(width * scale) // 2 * 2), max(2, round(height * scale) // 2 * 2))
    if even == (width, height):
        return frame.image.bgr.copy(), 1.0
    return np.asarray(cv2.resize(frame.image.bgr, even, interpolation=cv2.INTER_AREA), np.uint8), even[0] / width


def _draw_path(canvas: U8, path: dict[str, Any] | None) -> None:
    if path is None:
        return
    left, right = (_visible(path[side], canvas) for side in ("left", "right"))
    if len(left) < 2 or len(right) < 2:
        return
    tinted = canvas.copy()
    cv2.fillPoly(tinted, [np.vstack([left, right[::-1]])], _bgr(rgb("path")), cv2.LINE_AA)
    cv2.addWeighted(tinted, _PATH_OPACITY, canvas, 1.0 - _PATH_OPACITY, 0.0, canvas)
    for side in (left, right):
        cv2.polylines(canvas, [side], False, _bgr(rgb("path")), 2, cv2.LINE_AA)


def _visible(line: list[list[float] | None], canvas: U8) -> np.ndarray:
    """(K, 2) int32: the points of a polyline that are not far outside the canvas."""
    reach = 4 * max(canvas.shape)
    points = [point for point in line if point is not None and max(map(abs, point)) < reach]
    return np.round(np.array(points, np.float64).reshape(-1, 2)).astype(np.int32)


def _draw_object(canvas: U8, item: FusedObject, result: Result, display: dict[str, Any]) -> None:
    leads = item.id == cipv_id(result)
    color, thick = rgb(role_of(item, cipv_id(result))), 3 if leads else 1
    box = display["vision_boxes"].get(str(item.id)) or display["lidar_boxes"].get(str(item.id))
    corners = display["cuboids"].get(str(item.id))
    if corners is not None and all(corner is not None for corner in corners):
        places = _visible(corners, canvas)
        if len(places) == len(corners):
            for a, b in CUBOID_EDGES:
                cv2.line(canvas, tuple(map(int, places[a])), tuple(map(int, places[b])), _bgr(color), 1, cv2.LINE_AA)
    if box is None:
        return
    x1, y1, x2, y2 = (round(value) for value in box)
    cv2.rectangle(canvas, (x1, y1), (x2, y2), _bgr(color), thick, cv2.LINE_AA)
    # Captions for all camera-only objects would hide the image.
    if leads or item.in_path or item.tracked_by_two_sensors:
        _text(canvas, object_text(item), (x1, max(y1 - 6, _BANNER_PX + 14)), color, 0.5)


def _draw_banner(canvas: U8, frame: Frame, result: Result) -> None:
    width = canvas.shape[1]
    canvas[:_BANNER_PX] = canvas[:_BANNER_PX] // 4
    lead, acc = result.cipv, result.acc
    _text(canvas, _lead_text(result), (14, 25), rgb("cipv") if lead else rgb("ego"), 0.75)
    second = lead.reason if lead is not None else "no vehicle in the path"
    _text(canvas, second, (14, 48), rgb("ego"), 0.45)
    right = [f"frame {frame.name}"]
    if acc is not None:
        right.append(_STATES.get(acc.state, f"ACC {acc.state}") + f"  {acc.accel_mps2:+.1f} m/s2")
    for line, text in enumerate(right):
        color = rgb("warning") if acc is not None and line and acc.state in _STATES else rgb("ego")
        (wide, _), _ = cv2.getTextSize(_plain(text), _FONT, 0.5, 1)
        _text(canvas, text, (width - wide - 14, 23 + 24 * line), color, 0.5)


def _lead_text(result: Result) -> str:
    lead = result.cipv
    if lead is None:
        return "CIPV: none"
    closing = "" if lead.closing_speed_mps is None else f"   closing {lead.closing_speed_mps * 3.6:+.0f} km/h"
    ttc = "" if lead.ttc_s is None else f"   TTC {lead.ttc_s:.1f} s"
    return f"CIPV #{lead.id}  {lead.distance_m:.1f} m{closing}{ttc}"


def _text(canvas: U8, text: str, at: tuple[int, int], color: Rgb, size: float) -> None:
    """Draw text on a darkened background, readable on any image."""
    (wide, high), below = cv2.getTextSize(_plain(text), _FONT, size, 1)
    x, y = max(at[0], 0), max(at[1], high)
    plate = canvas[max(y - high - 2, 0) : y + below, max(x - 2, 0) : x + wide + 2]
    plate[:] = plate // 3
    cv2.putText(canvas, _plain(text), (x, y), _FONT, size, _bgr(color), 1, cv2.LINE_AA)


def _plain(text: str) -> str:
    """The text with only those characters that OpenCV's font has."""
    return text.replace("²", "2").replace("σ", "sigma").encode("ascii", "replace").decode()


def _bgr(color: Rgb) -> tuple[int, int, int]:
    return color[2], color[1], color[0]
