"""Builds rows and objects of synthetic drives for tests of events."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from app.drive.frame_rows import OBJECT, Objects, Row, sources

PERIOD_NS = 100_000_000


def row(index: int, cipv_id: int | None = None, **values: Any) -> Row:
    """Frame ``index`` at 10 Hz with data of every sensor. The CIPV, if any, is seen by both sensors at 30 m."""
    lead: dict[str, Any] = {} if cipv_id is None else {"source": "VL", "carried": False, "distance_m": 30.0}
    plain = dict.fromkeys(Row._fields) | {"gaps": "", "extra": ()}
    return Row(**(plain | {"t_ns": index * PERIOD_NS, "cipv_id": cipv_id} | lead | values))


def drive(*cipv_ids: int | None) -> list[Row]:
    """One row for each frame's CIPV."""
    return [row(index, cipv_id) for index, cipv_id in enumerate(cipv_ids)]


def objects(*records: dict[str, Any]) -> Objects:
    """The objects of one frame. By default, an object is an L object in the path at 30 m."""
    made = np.zeros(len(records), OBJECT)
    for place, given in enumerate(records):
        plain = {"source": sources().index("L"), "in_path": True, "vehicle": True, "distance_m": 30.0}
        unknown = dict.fromkeys(("closing_speed_mps", "ttc_s", "path_offset_m", "vl_gap_m", "vl_gap_sigmas"), math.nan)
        for name, value in (plain | unknown | given).items():
            made[place][name] = value
    return made


def beside(number: int, offset_m: float = 3.0) -> dict[str, Any]:
    return {"id": number, "in_path": False, "path_offset_m": offset_m}


def inside(number: int) -> dict[str, Any]:
    return {"id": number, "in_path": True, "path_offset_m": 0.2}
