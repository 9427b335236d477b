"""Frame rows and objects of results that a session holds as JSON, so that its events are found without running the
pipeline again.

Results do not hold the camera's own distance of an object that both sensors see, nor what the pipeline's layers know:
such columns are unknown, and disagreements between the sensors are not found.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from app.drive.frame_rows import OBJECT, Objects, Row, sources
from pipeline.types import VEHICLES

_SENSORS = ("lidar", "camera", "ego")


def recorded_row(result: Mapping[str, Any]) -> Row:
    """result: one frame, as in ``docs/reference/results.md``. KeyError or TypeError if it is invalid."""
    lead, acc, ego, sensors = (result[name] or {} for name in ("cipv", "acc", "ego", "sensors"))
    item: Mapping[str, Any] = next((each for each in result["objects"] if each["id"] == lead.get("id")), {})
    return Row(
        t_ns=result["t_ns"],
        cipv_id=lead.get("id"),
        source=item.get("source"),
        carried=item.get("carried"),
        distance_m=lead.get("distance_m"),
        closing_speed_mps=lead.get("closing_speed_mps"),
        ttc_s=lead.get("ttc_s"),
        path_offset_m=item.get("path_offset_m"),
        speed_mps=ego.get("speed_mps"),
        desired_speed_mps=acc.get("desired_speed_mps"),
        accel_mps2=acc.get("accel_mps2"),
        brake=acc.get("brake"),
        acc_state=acc.get("state"),
        gaps=",".join(name for name in _SENSORS if not sensors.get(name)),
        vl_disagreement_m=None,
        judged=None,
        yaw_rate_radps=ego.get("yaw_rate_radps"),
    )


def recorded_objects(result: Mapping[str, Any]) -> Objects:
    """(N,) ``OBJECT`` records of one frame, in the result's order. Raises the same errors as ``recorded_row``."""
    records = np.zeros(len(result["objects"]), OBJECT)
    for field in ("closing_speed_mps", "vl_gap_m", "vl_gap_sigmas", "cuboid", "bbox", "bev", "velocity_mps"):
        records[field] = math.nan
    for record, item in zip(records, result["objects"], strict=True):
        record["id"], record["hits"] = item["id"], item["hits"]
        record["source"] = sources().index(item["source"])
        record["carried"], record["in_path"] = item["carried"], item["in_path"]
        record["vehicle"] = item["type"] is None or item["type"] in VEHICLES
        for field in ("distance_m", "ttc_s", "path_offset_m"):
            record[field] = math.nan if item[field] is None else item[field]
    return records
