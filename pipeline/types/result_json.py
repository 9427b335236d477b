"""A ``Result`` as one JSON object per frame that scripts, labels and scores read: the results contract, version 1.

``docs/reference/results.md`` defines every field.

Metres, metres per second, radians and pixels are rounded to four decimals; nanoseconds are whole. Unknown values are
null, and so are numbers that are not finite, so NaN and infinity never reach a file. Keys have a fixed order, so the
same result gives the same bytes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import fields
from typing import Any, TextIO

import msgspec
import numpy as np

from pipeline.common.geometry import F64
from pipeline.types import (
    AccCommand,
    Cipv,
    EgoState,
    FusedObject,
    OwnMotion,
    Path,
    Result,
    SensorHealth,
    StreamHealth,
)
from pipeline.types.rounding import DECIMALS, rounded, rounded_array

VERSION = 1


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
        "objects": _objects(result.objects),
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
    return encoded(to_json(result)).decode() + "\n"


def encoded(content: dict[str, Any]) -> bytes:
    """What ``to_json`` returns, as UTF-8 text without spaces."""
    return msgspec.json.encode(content)


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
            "lanes_age_ms": _number(health.lanes_age_ms),
            "lanes_far_view": list(health.lanes_far_view) if health.lanes_far_view is not None else None,
        },
        "ego": {"age_ms": _number(health.ego_age_ms)},
    }
    for name, scan in health.scans.items():
        sensors[name] = {"age_ms": _number(scan.age_ms), "points": scan.points}
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


_NUMBERS = 35
"""Numbers of an object besides its gates, in the order of ``_numbers_of``."""
_NAN2, _NAN3, _NAN4 = ((math.nan,) * count for count in (2, 3, 4))
_NO_CUBOID = (_NAN3, _NAN3, math.nan)


def _objects(objects: Sequence[FusedObject]) -> list[dict[str, Any]]:
    """Every object. Their numbers are rounded all at once."""
    numbers: list[float | None] = []
    for each in objects:
        numbers += _numbers_of(each)
        for _, value, limit, _ in each.gates:
            numbers += (value, limit)
    known = rounded(numbers)
    rows, first = [], 0
    for each in objects:
        end = first + _NUMBERS + 2 * len(each.gates)
        rows.append(_object(each, known[first : first + _NUMBERS], known[first + _NUMBERS : end]))
        first = end
    return rows


def _numbers_of(each: FusedObject) -> tuple[float | None, ...]:
    center, size, yaw_rad = each.cuboid if each.cuboid is not None else _NO_CUBOID
    a, b, c, d = each.bev if each.bev is not None else (_NAN2, _NAN2, _NAN2, _NAN2)
    return (
        each.score,
        each.distance_m,
        each.distance_sigma_m,
        each.speed_over_ground_mps,
        each.speed_over_ground_sigma_mps,
        each.existence,
        each.in_path_probability,
        each.path_offset_m,
        each.lateral_mps,
        each.crossing_s,
        each.ttc_s,
        *(each.velocity_mps if each.velocity_mps is not None else _NAN2),
        *(each.bbox if each.bbox is not None else _NAN4),
        *(each.closest_point if each.closest_point is not None else _NAN3),
        *center,
        *size,
        yaw_rad,
        *a,
        *b,
        *c,
        *d,
    )


def _object(each: FusedObject, numbers: list[float | None], of_gates: list[float | None]) -> dict[str, Any]:
    """One object. numbers: those of ``_numbers_of``, rounded; of_gates: value and limit of each gate, likewise."""
    score, distance, sigma, speed, speed_sigma, existence, probability, offset, lateral, crossing, ttc = numbers[:11]
    center, size, yaw_rad = numbers[20:23], numbers[23:26], numbers[26]
    has_cuboid = None not in numbers[20:27]
    return {
        "id": each.id,
        "source": each.source,
        "type": each.label,
        "type_score": score,
        "bbox": _whole(numbers[13:17]),
        "bev": None if None in numbers[27:] else [numbers[27:29], numbers[29:31], numbers[31:33], numbers[33:35]],
        "cuboid": {"center": center, "size": size, "yaw_rad": yaw_rad} if has_cuboid else None,
        "closest_point": _whole(numbers[17:20]),
        "distance_m": distance,
        "distance_sigma_m": sigma,
        "distance_from": each.distance_from,
        "height_from": each.height_from,
        "velocity_mps": _whole(numbers[11:13]),
        "speed_over_ground_mps": speed,
        "speed_over_ground_sigma_mps": speed_sigma,
        "in_path": each.in_path,
        "existence_probability": existence,
        "in_path_probability": probability,
        "path_offset_m": offset,
        "lateral_mps": lateral,
        "crossing_s": crossing,
        "moving": each.moving,
        "ttc_s": ttc,
        "carried": each.carried,
        "seen_by": each.seen_by,
        "hits": each.hits,
        "lidar_points": each.lidar_points,
        "gates": [
            {"name": name, "value": value, "limit": limit, "passed": passed}
            for (name, _, _, passed), value, limit in zip(each.gates, of_gates[::2], of_gates[1::2], strict=True)
        ],
    }


def _whole(numbers: list[float | None]) -> list[float | None] | None:
    """A point or box; null as a whole if any of its numbers is unknown."""
    return None if None in numbers else numbers


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


def _number(value: float | None) -> float | None:
    """Rounded; null if unknown. Minus zero becomes zero, so that rounding noise does not change a file."""
    return None if value is None or not math.isfinite(value) else round(float(value), DECIMALS) + 0.0


def _numbers(values: Iterable[float] | None) -> list[float | None] | None:
    """A few numbers that belong together; null as a whole if any is unknown."""
    return None if values is None else _whole([_number(value) for value in values])


def _line(points: F64) -> list[Any]:
    """A polyline without its unknown points."""
    places = rounded_array(np.asarray(points, dtype=np.float64).reshape(-1, 2))
    return places[~np.isnan(places).any(axis=1)].tolist()
