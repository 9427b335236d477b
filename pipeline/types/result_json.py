"""A ``Result`` as one JSON object per frame that scripts, labels and scores read: the results contract, version 1.

``docs/reference/results.md`` defines every field.

Metres, metres per second, radians and pixels are rounded to four decimals; nanoseconds are whole. Unknown values are
null, and so are numbers that are not finite, so NaN and infinity never reach a file. Keys have a fixed order, so the
same result gives the same bytes.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import fields
from typing import Any, TextIO

from pipeline.common.geometry import F64, Cuboid
from pipeline.types import (
    AccCommand,
    Cipv,
    EgoState,
    FusedObject,
    Gate,
    OwnMotion,
    Path,
    Result,
    SensorHealth,
    StreamHealth,
)

VERSION = 1
_DECIMALS = 4


def to_json(result: Result) -> dict[str, Any]:
    """The result in the form of ``docs/reference/results.md``: plain dicts, lists, strings, booleans, finite
    numbers and nulls.

    ``Result.layers`` stays out: it is for views.
    """
    return {
        "version": VERSION,
        "frame": result.frame,
        "t_ns": result.t_ns,
        "sensors": _sensors(result.sensors, result.streams),
        "ego": _ego(result.ego),
        "own_motion": _own_motion(result.own_motion),
        "objects": [_object(each) for each in result.objects],
        "path": _path(result.path),
        "cipv": _cipv(result.cipv),
        "next_cipv": _cipv(result.next_cipv),
        "rejected": [{"id": each.id, "reason": each.reason} for each in result.rejected],
        "acc": _acc(result.acc),
        "notes": list(result.notes),
        "timing_ms": {stage: _number(value) for stage, value in result.timing_ms.items()},
    }


def to_line(result: Result) -> str:
    """One line of a ``results.jsonl`` file, with its newline."""
    return json.dumps(to_json(result), ensure_ascii=False, separators=(",", ":"), allow_nan=False) + "\n"


def write_line(stream: TextIO, result: Result) -> None:
    """Append the result to an open UTF-8 text file, one JSON object a line."""
    stream.write(to_line(result))


def _sensors(health: SensorHealth, streams: tuple[StreamHealth, ...]) -> dict[str, Any]:
    """Data of each sensor in the frame; for live sensors also the health of their streams."""
    sensors: dict[str, dict[str, Any]] = {
        "lidar": {"age_ms": _number(health.lidar_age_ms), "points": health.lidar_points},
        "camera": {
            "age_ms": _number(health.camera_age_ms),
            "skew_ms": _number(health.camera_skew_ms),
            "far_view": list(health.far_view) if health.far_view is not None else None,
        },
        "ego": {"age_ms": _number(health.ego_age_ms)},
    }
    for name, stream in streams_json(streams).items():
        sensors[name] = {**stream, **sensors.get(name, {})}
    return sensors


def streams_json(streams: tuple[StreamHealth, ...]) -> dict[str, Any]:
    """Health of live sensors, by sensor."""
    return {
        stream.sensor: {
            "age_ms": _number(stream.age_ms),
            "state": stream.state,
            "rate_hz": _number(stream.rate_hz),
            "jitter_ms": _number(stream.jitter_ms),
            "lost": stream.lost,
            "note": stream.note,
        }
        for stream in streams
    }


def _ego(ego: EgoState | None) -> dict[str, Any] | None:
    if ego is None:
        return None
    return {"speed_mps": _number(ego.speed_mps), "yaw_rate_radps": _number(ego.yaw_rate_radps)}


def _own_motion(own: OwnMotion | None) -> dict[str, Any] | None:
    if own is None:
        return None
    return {
        "speed_from": own.speed.source,
        "speed_sigma_mps": _number(own.speed.speed_sigma_mps),
        "yaw_rate_from": own.turning.source if own.turning is not None else None,
        "yaw_rate_sigma_radps": _number(own.turning.yaw_rate_sigma_radps) if own.turning is not None else None,
        "pose": _numbers(own.pose),
        "sources": [
            {
                "source": each.source,
                "speed_mps": _number(each.speed_mps),
                "yaw_rate_radps": _number(each.yaw_rate_radps),
            }
            for each in own.sources
        ],
    }


def _object(each: FusedObject) -> dict[str, Any]:
    return {
        "id": each.id,
        "source": each.source,
        "type": each.label,
        "type_score": _number(each.score),
        "bbox": _numbers(each.bbox),
        "bev": _points(each.bev),
        "cuboid": _cuboid(each.cuboid),
        "closest_point": _numbers(each.closest_point),
        "distance_m": _number(each.distance_m),
        "distance_sigma_m": _number(each.distance_sigma_m),
        "distance_from": each.distance_from,
        "height_from": each.height_from,
        "velocity_mps": _numbers(each.velocity_mps),
        "speed_over_ground_mps": _number(each.speed_over_ground_mps),
        "in_path": each.in_path,
        "existence_probability": _number(each.existence),
        "in_path_probability": _number(each.in_path_probability),
        "path_offset_m": _number(each.path_offset_m),
        "lateral_mps": _number(each.lateral_mps),
        "crossing_s": _number(each.crossing_s),
        "moving": each.moving,
        "ttc_s": _number(each.ttc_s),
        "carried": each.carried,
        "seen_by": each.seen_by,
        "hits": each.hits,
        "lidar_points": each.lidar_points,
        "gates": [_gate(gate) for gate in each.gates],
    }


def _gate(gate: Gate) -> dict[str, Any]:
    return {"name": gate.name, "value": _number(gate.value), "limit": _number(gate.limit), "passed": gate.passed}


def _cuboid(cuboid: Cuboid | None) -> dict[str, Any] | None:
    if cuboid is None or not _finite((*cuboid.center, *cuboid.size, cuboid.yaw_rad)):
        return None
    return {
        "center": _numbers(cuboid.center),
        "size": _numbers(cuboid.size),
        "yaw_rad": _number(cuboid.yaw_rad),
    }


def _path(path: Path) -> dict[str, Any]:
    return {
        "source": path.source,
        "center": _line(path.center),
        "left": _line(path.left),
        "right": _line(path.right),
        "sigma_m": {at_m: _number(value) for at_m, value in path.sigma_m.items()},
        "weights": {source: _number(value) for source, value in path.weights.items()},
        "carried_by": {
            at_m: {source: _number(value) for source, value in shares.items()}
            for at_m, shares in path.carried_by.items()
        },
        "reach_m": _number(path.reach_m),
        "usable": path.usable,
        "confidence": _number(path.confidence),
    }


def _cipv(cipv: Cipv | None) -> dict[str, Any] | None:
    return None if cipv is None else _plain(cipv)


def _acc(acc: AccCommand | None) -> dict[str, Any] | None:
    return None if acc is None else _plain(acc)


def _plain(record: Cipv | AccCommand) -> dict[str, Any]:
    """A flat record as a dict; its field names are those in docs/reference/results.md."""
    values = {field.name: getattr(record, field.name) for field in fields(record)}
    return {name: _number(value) if isinstance(value, float) else value for name, value in values.items()}


def _finite(values: Iterable[float]) -> bool:
    return all(math.isfinite(value) for value in values)


def _number(value: float | None) -> float | None:
    """Rounded; null if unknown. Minus zero becomes zero, so that rounding noise does not change a file."""
    return None if value is None or not math.isfinite(value) else round(float(value), _DECIMALS) + 0.0


def _numbers(values: Iterable[float] | None) -> list[float | None] | None:
    """A point or box; null as a whole if any of its numbers is unknown."""
    if values is None:
        return None
    rounded = [_number(value) for value in values]
    return None if None in rounded else rounded


def _points(points: Iterable[Iterable[float]] | None) -> list[Any] | None:
    """A polygon; null as a whole if any corner is unknown."""
    if points is None:
        return None
    corners = [_numbers(point) for point in points]
    return None if None in corners else corners


def _line(points: F64) -> list[Any]:
    """A polyline without its unknown points."""
    return [point for point in map(_numbers, points.tolist()) if point is not None]
