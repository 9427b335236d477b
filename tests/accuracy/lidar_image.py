"""An image of real and simulated sweeps side by side: from above, as rings and bearings, and points per car."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.types import U8, Sweep
from tests.accuracy.lidar_realism import CarSeen, Pair

_WIDTH, _ABOVE, _RINGS, _CHART = 640, 640, 200, 360
_PX_PER_M = 11.0
_BEARING_DEG = 50.0
_PAPER, _INK, _FAINT = (250, 250, 250), (40, 40, 40), (215, 215, 215)
_REAL, _SIMULATED, _LABEL = (150, 90, 20), (30, 90, 220), (60, 160, 60)
_CHART_M = 80.0
_FONT = cv2.FONT_HERSHEY_SIMPLEX


def draw(pair: Pair, cars: Sequence[CarSeen]) -> U8:
    """(1200, 1280, 3) uint8 blue green red: the sweeps of one frame, and below them all ``cars`` over distance."""
    columns = []
    for sweep, title, colour in ((pair.real, "real", _REAL), (pair.simulated, "simulated", _SIMULATED)):
        columns.append(np.vstack([_above(sweep, pair, f"{title}, frame {pair.name}", colour), _rings(sweep, colour)]))
    return np.asarray(np.vstack([np.hstack(columns), _chart(cars)]), dtype=np.uint8)


def _sheet(height: int, width: int) -> U8:
    return np.full((height, width, 3), _PAPER, dtype=np.uint8)


def _above(sweep: Sweep, pair: Pair, title: str, colour: tuple[int, int, int]) -> U8:
    """From above, ahead is up; labelled boxes in green."""
    sheet = _sheet(_ABOVE, _WIDTH)
    for reach in range(10, 60, 10):
        cv2.circle(sheet, (_WIDTH // 2, _ABOVE - 20), round(reach * _PX_PER_M), _FAINT, 1, cv2.LINE_AA)
    for item in pair.truth:
        cv2.polylines(sheet, [_pixels(item.cuboid.footprint())], True, _LABEL, 1, cv2.LINE_AA)
    _dots(sheet, _pixels(sweep.points[:, :2]), colour)
    cv2.putText(sheet, title, (12, 26), _FONT, 0.6, _INK, 1, cv2.LINE_AA)
    return sheet


def _pixels(places: npt.NDArray[np.floating]) -> npt.NDArray[np.int32]:
    u, v = _WIDTH / 2 - places[:, 1] * _PX_PER_M, _ABOVE - 20 - places[:, 0] * _PX_PER_M
    return np.column_stack([u, v]).round().astype(np.int32)


def _rings(sweep: Sweep, colour: tuple[int, int, int]) -> U8:
    """Rings over bearing, the highest ring at the top: what the sensor's own image would be."""
    sheet = _sheet(_RINGS, _WIDTH)
    ahead = sweep.points[:, 0] > 0.0
    bearing = np.degrees(np.arctan2(sweep.points[ahead, 1], sweep.points[ahead, 0]))
    u = (0.5 - bearing / (2 * _BEARING_DEG)) * _WIDTH
    v = _RINGS - 12 - sweep.ring[ahead].astype(np.float64) * (_RINGS - 24) / 15
    _dots(sheet, np.column_stack([u, v]).round().astype(np.int32), colour)
    return sheet


def _dots(sheet: U8, at: npt.NDArray[np.int32], colour: tuple[int, int, int]) -> None:
    inside = (at[:, 0] >= 1) & (at[:, 0] < sheet.shape[1] - 1) & (at[:, 1] >= 1) & (at[:, 1] < sheet.shape[0] - 1)
    u, v = at[inside].T
    for du, dv in ((0, 0), (1, 0), (0, 1)):
        sheet[v + dv, u + du] = colour


def _chart(cars: Sequence[CarSeen]) -> U8:
    """Points on each car over its distance, logarithmic."""
    sheet = _sheet(_CHART, 2 * _WIDTH)
    left, right, top, bottom = 60, 2 * _WIDTH - 20, 36, _CHART - 34

    def place(distance_m: float, points: int) -> tuple[int, int]:
        u = left + (right - left) * distance_m / _CHART_M
        v = bottom - (bottom - top) * np.log10(1 + points) / 3.2
        return round(u), round(float(v))

    for points in (0, 1, 10, 100, 1000):
        cv2.line(sheet, place(0.0, points), place(_CHART_M, points), _FAINT, 1)
        cv2.putText(sheet, str(points), (12, place(0.0, points)[1] + 5), _FONT, 0.45, _INK, 1, cv2.LINE_AA)
    for metres in range(0, 81, 10):
        cv2.line(sheet, place(metres, 0), place(metres, 1500), _FAINT, 1)
        cv2.putText(sheet, f"{metres} m", (place(metres, 0)[0] - 14, _CHART - 12), _FONT, 0.45, _INK, 1, cv2.LINE_AA)
    for car in cars:
        cv2.circle(sheet, place(car.distance_m, car.real_points), 4, _REAL, 1, cv2.LINE_AA)
        u, v = place(car.distance_m, car.simulated_points)
        cv2.drawMarker(sheet, (u, v), _SIMULATED, cv2.MARKER_TILTED_CROSS, 7, 1, cv2.LINE_AA)
    title = "points on each labelled car over its distance: circles real, crosses simulated"
    cv2.putText(sheet, title, (left, 22), _FONT, 0.5, _INK, 1, cv2.LINE_AA)
    return sheet
