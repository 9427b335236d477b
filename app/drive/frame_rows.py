"""One frame of a drive as a row of plain values, and each object in it as a record, for timelines and events.

A row takes about 200 bytes and an object 130, so a whole drive fits in memory where its results would not. Unknown
values are None in a row, and NaN or 0 (``source``) in a record.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from app.drive.timeline_columns import EXTRA_COLUMNS, ColumnValue
from pipeline.decision.object_motion import closing_speed_mps
from pipeline.evaluation.lead_verdict import Judged
from pipeline.fusion.rows import LIDAR_RANGE_SIGMA_M
from pipeline.path.yaw_rate import usable_rate
from pipeline.types import VEHICLES, Frame, FusedObject, Result, VisionTrack, object_sources
from pipeline.types.rounding import DECIMALS
from pipeline.vision.classes import COCO_80

LABELS = ("", *COCO_80)
"""An object of any other class is stored without a class."""
_PLACE = {name: place for place, name in enumerate(LABELS)}
_NOWHERE = (math.nan,) * 7
_UNBOXED = (math.nan,) * 4
_FLAT = (math.nan,) * 8
_STILL = (math.nan,) * 2

OBJECT = np.dtype(
    [
        ("id", "i4"),
        ("source", "u1"),
        ("carried", "?"),
        ("in_path", "?"),
        ("vehicle", "?"),
        ("distance_m", "f4"),
        ("closing_speed_mps", "f4"),
        ("ttc_s", "f4"),
        ("path_offset_m", "f4"),
        ("vl_gap_m", "f4"),
        ("vl_gap_sigmas", "f4"),
        ("label", "i1"),
        ("cuboid", "f4", 7),
        ("bbox", "f4", 4),
        ("bev", "f4", 8),
        ("velocity_mps", "f4", 2),
        ("hits", "i4"),
        ("score", "f4"),
    ]
)
"""``source`` is an index into ``sources()``; ``vehicle``: of a vehicle class, or without a class; ``vl_gap``: camera's
minus LiDAR's distance of a VL object, also in standard deviations of both. ``label`` is an index into ``LABELS``.
``cuboid``: center x y z, length, width, height, yaw; ``bev``: x y of four corners. ``score``: the detector's score of
its class."""
Objects = npt.NDArray[np.void]


def sources() -> tuple[str, ...]:
    """The sources of objects by their number in ``OBJECT``."""
    return ("", *object_sources())


class Row(NamedTuple):
    """One frame. Fields of the CIPV are None without one."""

    t_ns: int
    """The tick."""
    cipv_id: int | None
    """Object id in this run."""
    source: str | None
    """The letters of its sensors: V, L or VL."""
    carried: bool | None
    """Predicted instead of seen in this frame."""
    distance_m: float | None
    """To the CIPV."""
    closing_speed_mps: float | None
    """Positive when the gap shrinks."""
    ttc_s: float | None
    """None when the gap does not shrink."""
    path_offset_m: float | None
    """Offset of the CIPV's nearest point from the centre of the path."""
    speed_mps: float | None
    """Ego speed; None if unknown."""
    desired_speed_mps: float | None
    """Speed requested by ACC."""
    accel_mps2: float | None
    """Acceleration requested by ACC and AEB."""
    brake: float | None
    """Pedal, 0–1."""
    acc_state: str | None
    """Such as ``follow``; None without ego speed."""
    gaps: str
    """The sensors without data, joined by commas."""
    vl_disagreement_m: float | None
    """Difference between the camera's and the LiDAR's distance of the CIPV; None unless both have one."""
    judged: Judged | None
    """The verdict against truth; None without truth."""
    extra: tuple[ColumnValue, ...] = ()
    """Values of ``EXTRA_COLUMNS``, in their order."""
    yaw_rate_radps: float | None = None
    """Own yaw rate; None if not measured."""
    reach_m: float = 0.0
    """How far ahead a vehicle in the path would be detected (``lead_reach_m``)."""


_INSIDE = ("t_ns", "judged", "extra", "yaw_rate_radps", "reach_m")
"""Fields that are not drawn in a timeline."""
_OWN_COLUMNS = tuple(name for name in Row._fields if name not in _INSIDE)


def column_names() -> tuple[str, ...]:
    """The columns returned by ``GET /api/drive``, in order."""
    return (*_OWN_COLUMNS, *EXTRA_COLUMNS)


def row_of(frame: Frame, result: Result, judged: Judged | None = None) -> Row:
    """The values that a timeline stores for one frame."""
    lead, acc = result.cipv, result.acc
    item = result.chosen()
    gap = _vl_gap(item, _by_id(result)) if item is not None else None
    return Row(
        t_ns=frame.t_ns,
        cipv_id=lead.id if lead else None,
        source=item.source if item else None,
        carried=item.carried if item else None,
        distance_m=lead.distance_m if lead else None,
        closing_speed_mps=lead.closing_speed_mps if lead else None,
        ttc_s=lead.ttc_s if lead else None,
        path_offset_m=item.path_offset_m if item else None,
        speed_mps=result.ego.speed_mps if result.ego else None,
        desired_speed_mps=acc.desired_speed_mps if acc else None,
        accel_mps2=acc.accel_mps2 if acc else None,
        brake=acc.brake if acc else None,
        acc_state=acc.state if acc else None,
        gaps=",".join(_missing(frame)),
        vl_disagreement_m=abs(gap[0]) if gap else None,
        judged=judged,
        extra=tuple(column(frame, result) for column in EXTRA_COLUMNS.values()),
        yaw_rate_radps=usable_rate(result.ego) if result.ego is not None else None,
        reach_m=lead_reach_m(frame, result),
    )


def lead_reach_m(frame: Frame, result: Result) -> float:
    """How far ahead a vehicle in the path would be detected: as far as the path is known. 0 without camera detections:
    a LiDAR with 16 beams has hardly a point on a car beyond 35 m."""
    looks = frame.image is not None and frame.raw_boxes is not None
    return result.path.reach_m if looks else 0.0


def objects_of(result: Result) -> Objects:
    """(N,) ``OBJECT`` records of one frame, in the result's order."""
    tracks, numbered = _by_id(result), sources()
    records = np.zeros(len(result.objects), OBJECT)
    for place, item in enumerate(result.objects):
        gap, sigmas = _vl_gap(item, tracks) or (math.nan, math.nan)
        records[place] = (
            item.id,
            numbered.index(item.source),
            item.carried,
            item.in_path,
            item.label is None or item.label in VEHICLES,
            _float(item.distance_m),
            _float(closing_speed_mps(item)),
            _float(item.ttc_s),
            _float(item.path_offset_m),
            gap,
            sigmas,
            _PLACE.get(item.label or "", 0),
            (*item.cuboid.center, *item.cuboid.size, item.cuboid.yaw_rad) if item.cuboid is not None else _NOWHERE,
            item.bbox if item.bbox is not None else _UNBOXED,
            [value for corner in item.bev for value in corner] if item.bev is not None else _FLAT,
            item.velocity_mps if item.velocity_mps is not None else _STILL,
            item.hits,
            _float(item.score),
        )
    return records


def columns_json(rows: Sequence[Row]) -> dict[str, list[Any]]:
    """``{"cipv_id": […], …}``, numbers rounded as in results."""
    own = {name: [_plain(getattr(row, name)) for row in rows] for name in _OWN_COLUMNS}
    return own | {name: [_plain(row.extra[place]) for row in rows] for place, name in enumerate(EXTRA_COLUMNS)}


def row_json(row: Row) -> dict[str, Any]:
    """One frame's value of each column, in the format of ``columns_json``."""
    return {name: values[0] for name, values in columns_json([row]).items()}


def object_json(frames: Iterable[tuple[int, Objects]], object_id: int) -> dict[str, list[Any]]:
    """One object's values over the frames in which it existed, with the index of each frame."""
    found = [(index, records[records["id"] == object_id]) for index, records in frames]
    present = [(index, match[0]) for index, match in found if len(match)]
    curve: dict[str, list[Any]] = {
        "index": [index for index, _ in present],
        "source": [sources()[int(record["source"])] for _, record in present],
    }
    for name in ("carried", "in_path"):
        curve[name] = [bool(record[name]) for _, record in present]
    for name in ("distance_m", "closing_speed_mps", "ttc_s", "path_offset_m", "vl_gap_m"):
        curve[name] = [_plain(float(record[name])) for _, record in present]
    return curve


def _missing(frame: Frame) -> list[str]:
    sensors = {"lidar": frame.sweep, "camera": frame.image, "ego": frame.ego}
    return [name for name, gave in sensors.items() if gave is None]


def _by_id(result: Result) -> dict[int, VisionTrack]:
    return {track.id: track for track in result.layers.vision_tracks}


def _vl_gap(item: FusedObject, tracks: dict[int, VisionTrack]) -> tuple[float, float] | None:
    """Camera's minus LiDAR's distance of an object that both see now, in metres and in standard deviations of both."""
    track = tracks.get(item.vision_track) if item.vision_track is not None else None
    if not item.seen_by_two_sensors or track is None or not track.measured or item.distance_m is None:
        return None
    if track.distance_m is None or track.sigma_m is None:
        return None
    gap = track.distance_m - item.distance_m
    return gap, abs(gap) / math.hypot(track.sigma_m, item.distance_sigma_m or LIDAR_RANGE_SIGMA_M)


def _float(value: float | None) -> float:
    return math.nan if value is None else value


def _plain(value: Any) -> Any:
    if not isinstance(value, float):
        return value
    return round(value, DECIMALS) + 0.0 if math.isfinite(value) else None
