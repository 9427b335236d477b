"""Lane lines on images whose camera nobody calibrated: drawn for people, and compared with marks made by hand.

Such an image is given a camera that a dashboard usually has. Metres are then a guess, but the way from the image to
the road and back is the pipeline's own, so the place of a line in the image is the pipeline's estimate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.alignment.projection import Alignment, Pinhole
from pipeline.common.geometry import F64
from pipeline.lanes.drawn_lines import in_image
from pipeline.lanes.road_lines import LaneState, RoadView, follow
from pipeline.params import LaneParams
from pipeline.types import U8, CameraCalibration, Moment, RawLanes
from pipeline.types.lane import EgoLane

EYE_HEIGHT_M = 1.4
_FOCAL_SHARE, _HORIZON_SHARE = 0.9, 0.57
_COLOURS = {"left": (0, 0, 255), "right": (0, 220, 0)}
_ROWS_BEYOND = 2
UNSURE = LaneParams(mount_height_m=EYE_HEIGHT_M, pitch_sigma_deg=1.5, min_width_m=2.0, max_width_m=5.5)
"""Pitch and scale of a guessed camera may be far off."""
Marks = Mapping[str, Mapping[int, tuple[float | None, float | None]]]
"""Image → row v → u of the left and the right line; None where there is no paint to mark."""


@dataclass(frozen=True)
class Miss:
    """One mark compared with the detected line: pixels to the right of the mark; None without a line."""

    image: str
    row: int
    side: str
    error_px: float | None


def guessed_camera(width: int, height: int) -> CameraCalibration:
    """A level dashboard camera with a field of view of 58°, located at the ego origin, with the horizon slightly below
    the middle of the image."""
    focal = _FOCAL_SHARE * width
    K = np.array([[focal, 0.0, width / 2], [0.0, focal, _HORIZON_SHARE * height], [0.0, 0.0, 1.0]])
    T = np.eye(4)
    T[:3, :3] = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    return CameraCalibration(K, np.zeros(0), T, width, height)


def alone(raw: RawLanes, width: int, height: int) -> tuple[EgoLane | None, Alignment]:
    """The ego lane of a single uncalibrated image, and the guessed camera it was seen with."""
    camera = guessed_camera(width, height)
    aligned = Pinhole(camera.K, camera.distortion, camera.T_camera_ego)
    _, lane = follow(LaneState(), raw, RoadView(aligned), Moment(0, None, None, None), UNSURE)
    return lane, aligned


def misses(name: str, lane: EgoLane | None, aligned: Alignment, marks: Marks) -> list[Miss]:
    """Every mark of one image compared with the line detected there."""
    lines = in_image(lane, aligned) if lane is not None else {}
    found = []
    for row, sides in marks[name].items():
        for side, marked in zip(("left", "right"), sides, strict=True):
            if marked is not None:
                column = _column(lines[side], row) if len(lines.get(side, ())) > 1 else None
                found.append(Miss(name, row, side, None if column is None else column - marked))
    return found


def draw(bgr: U8, raw: RawLanes, lane: EgoLane | None, aligned: Alignment, text: str = "") -> U8:
    """A copy of the image with the detected points (dots) and the estimated lines (left red, right green)."""
    drawn = bgr.copy()
    for (u, v), score in zip(raw.points.tolist(), raw.scores.tolist(), strict=True):
        cv2.circle(drawn, (round(u), round(v)), 2, (255, round(255 * score), 0), cv2.FILLED)
    for side, uv in (in_image(lane, aligned) if lane is not None else {}).items():
        seen = np.round(uv[~np.isnan(uv[:, 0])]).astype(np.int32)
        cv2.polylines(drawn, [seen], False, _COLOURS[side], 2, cv2.LINE_AA)
    cv2.putText(drawn, text or summary(lane), (12, 28), cv2.FONT_HERSHEY_SIMPLEX, 0.7, (255, 255, 255), 2, cv2.LINE_AA)
    return drawn


def summary(lane: EgoLane | None) -> str:
    """Qualities, width and pitch in one line."""
    if lane is None:
        return "no lane detector"
    sides = [f"{name} {line.quality:.2f}" for name, line in (("L", lane.left), ("R", lane.right)) if line is not None]
    width = f" width {lane.width_m:.2f} m" if lane.width_m is not None else ""
    return f"{lane.source[:24]}: {' '.join(sides) or 'no line'}{width} pitch {np.degrees(lane.pitch_rad):+.2f} deg"


def tiles(images: Sequence[U8], columns: int = 3, width: int = 640) -> U8:
    """A contact sheet of images, each ``width`` wide and 16:9."""
    size = (width, width * 9 // 16)
    small = [cv2.resize(each, size, interpolation=cv2.INTER_AREA) for each in images]
    small += [np.zeros_like(small[0])] * (-len(small) % columns)
    return np.vstack([np.hstack(small[i : i + columns]) for i in range(0, len(small), columns)]).astype(np.uint8)


def _column(uv: F64, row: int) -> float | None:
    """Column in which a line crosses a row. Below its nearest point it is extended straight; above its last one it is
    None."""
    uv = uv[~np.isnan(uv[:, 0])]
    (u0, v0), (u1, v1) = uv[:2]
    if row > v0:
        return float(u0 + (row - v0) * (u0 - u1) / (v0 - v1))
    if row < uv[-1, 1] - _ROWS_BEYOND:
        return None
    return float(np.interp(-row, -uv[:, 1], uv[:, 0]))
