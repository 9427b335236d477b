"""Restores the stored results of a run, as far as labels and scores need them.

Numbers are stored in 32 bits, which is accurate to micrometres. The path, gates, health and pedals are not stored.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, cast

from app.drive.frame_rows import LABELS, Objects, Row, sources
from app.drive.full_run import DriveRun
from pipeline.common.geometry import Cuboid
from pipeline.evaluation.scores.results_file import EMPTY, NO_HEALTH, NO_PATH
from pipeline.labels.headings import Moment
from pipeline.labels.propose import Seen
from pipeline.types import AccCommand, Box, Cipv, EgoState, FusedObject, Result
from pipeline.types.rounding import DECIMALS


def seen_of(records: Objects) -> list[Seen]:
    """The objects of one frame as input for label proposals."""
    return [
        Seen(
            int(record["id"]),
            LABELS[record["label"]] or None,
            _cuboid(record),
            _bbox(record),
            bool(record["in_path"]),
            bool(record["carried"]),
            _known(record["score"]),
        )
        for record in records
    ]


def moments_of(rows: Sequence[Row]) -> dict[int, Moment]:
    """The car's motion in each frame, by index."""
    return {index: Moment(row.t_ns, row.speed_mps, row.yaw_rate_radps, row.reach_m) for index, row in enumerate(rows)}


def results_of(run: DriveRun, *, leads_only: bool = False) -> Iterator[Result]:
    """The results of all available frames, with the index as name. leads_only: only the CIPV of the objects, which is
    faster."""
    for (index, records), row in zip(run.objects(), run.rows(), strict=False):
        yield _result(index, row, records[records["id"] == row.cipv_id] if leads_only else records)


def _result(index: int, row: Row, records: Objects) -> Result:
    cipv = None
    if row.cipv_id is not None and row.distance_m is not None:
        cipv = Cipv(row.cipv_id, row.distance_m, row.closing_speed_mps, row.ttc_s, "")
    acc = None
    if row.acc_state is not None:
        acc = AccCommand(cast("Any", row.acc_state), 0.0, row.accel_mps2 or 0.0, 0.0, row.brake or 0.0, "")
    return Result(
        frame=str(index),
        t_ns=row.t_ns,
        sensors=NO_HEALTH,
        ego=EgoState(row.t_ns, row.speed_mps, None) if row.speed_mps is not None else None,
        objects=tuple(map(_object, records)),
        path=NO_PATH,
        cipv=cipv,
        rejected=(),
        acc=acc,
        notes=(),
        timing_ms={},
        layers=EMPTY,
    )


def _object(record: Any) -> FusedObject:
    source = sources()[record["source"]]
    corners = record["bev"].reshape(4, 2)
    vx, vy = (float(value) for value in record["velocity_mps"])
    return FusedObject(
        id=int(record["id"]),
        source=source,
        label=LABELS[record["label"]] or None,
        score=_known(record["score"]),
        bbox=_bbox(record),
        bev=cast("Any", tuple((float(x), float(y)) for x, y in corners)) if math.isfinite(corners[0, 0]) else None,
        cuboid=_cuboid(record),
        closest_point=None,
        distance_m=_known(record["distance_m"]),
        distance_sigma_m=None,
        velocity_mps=(vx, vy) if math.isfinite(vx) else None,
        seen_by="" if record["carried"] else source,
        hits=int(record["hits"]),
        lidar_points=0,
        lidar_track=None,
        vision_track=None,
        in_path=bool(record["in_path"]),
    )


def _cuboid(record: Any) -> Cuboid | None:
    x, y, z, length, width, height, yaw = (round(float(value), DECIMALS) for value in record["cuboid"])
    return Cuboid((x, y, z), (length, width, height), yaw) if math.isfinite(x) else None


def _bbox(record: Any) -> Box | None:
    x1, y1, x2, y2 = (round(float(value), DECIMALS) for value in record["bbox"])
    return (x1, y1, x2, y2) if math.isfinite(x1) else None


def _known(value: Any) -> float | None:
    number = float(value)
    return number if math.isfinite(number) else None
