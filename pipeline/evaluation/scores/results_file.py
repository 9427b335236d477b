"""Reads a ``results.jsonl`` file back, as far as scores need it."""

from __future__ import annotations

import json
import math
from itertools import pairwise
from pathlib import Path as FilePath
from typing import Any, get_args, get_type_hints

import numpy as np

from pipeline.common.errors import BadInput
from pipeline.common.files.user_file_errors import reason_of
from pipeline.common.files.user_files import open_regular
from pipeline.common.geometry import Cuboid
from pipeline.types import AccCommand, Cipv, EgoState, FusedObject, Layers, Path, Result, SensorHealth, object_sources
from pipeline.types.result_json import VERSION

EMPTY = Layers(np.zeros((0, 4), np.float32), np.zeros(0, np.int32))
NO_HEALTH = SensorHealth(None, None, None, None, None)
_NO_LINE = np.zeros((0, 2))
NO_PATH = Path("straight", _NO_LINE, _NO_LINE, _NO_LINE, 0.0, {}, {})


def read_results(path: FilePath) -> list[Result]:
    """The results of ``cipv run --out``, in order of time; ``score_drive`` reorders them as in the recording. Parts
    that are not scored (path, gates, health, pedals) are not read and stay empty. BadInput names the invalid line, or
    the frame with two results."""
    try:
        with open_regular(path) as file:
            text = file.read().decode("utf-8")
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {reason_of(error)}") from None
    except (UnicodeDecodeError, ValueError):
        raise BadInput(f"{path}: not a text file; expected the JSON lines of `cipv run --out`") from None
    results = [_result(line, f"{path}, line {n}") for n, line in enumerate(text.split("\n"), 1) if line.strip()]
    if not results:
        raise BadInput(f"{path}: contains no results")
    results.sort(key=lambda result: result.t_ns)
    twice = next((a.frame for a, b in pairwise(results) if a.t_ns == b.t_ns), None)
    if twice is not None:
        raise BadInput(f"{path}: two results with the same time, at frame {twice}; is this the output of several runs?")
    return results


def _result(line: str, where: str) -> Result:
    try:
        row = json.loads(line, parse_constant=_refuse)
        if row["version"] != VERSION:
            raise BadInput(f"{where}: version {row['version']!r} of results; this program reads {VERSION}")
        return Result(
            frame=str(row["frame"]),
            t_ns=int(row["t_ns"]),
            sensors=NO_HEALTH,
            ego=_ego(row["ego"], int(row["t_ns"])),
            objects=tuple(_object(each) for each in row["objects"]),
            path=NO_PATH,
            cipv=_cipv(row["cipv"]),
            rejected=(),
            acc=_acc(row["acc"]),
            notes=(),
            timing_ms={},
            layers=EMPTY,
        )
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
        raise BadInput(f"{where}: not a result as `cipv run --out` writes it") from None


def _refuse(word: str) -> float:
    raise ValueError(word)


def _ego(row: dict[str, Any] | None, t_ns: int) -> EgoState | None:
    if row is None:
        return None
    yaw_rate = row["yaw_rate_radps"]
    return EgoState(t_ns, _number(row["speed_mps"]), None if yaw_rate is None else _number(yaw_rate))


def _cipv(row: dict[str, Any] | None) -> Cipv | None:
    if row is None:
        return None
    return Cipv(int(row["id"]), _number(row["distance_m"]), None, None, str(row["reason"]))


def _acc(row: dict[str, Any] | None) -> AccCommand | None:
    """Its state, the only part that is scored."""
    if row is None:
        return None
    state = row["state"]
    if state not in get_args(get_type_hints(AccCommand)["state"]):
        raise ValueError(state)
    return AccCommand(state, 0.0, _number(row["accel_mps2"]), 0.0, 0.0, "")


def _object(row: dict[str, Any]) -> FusedObject:
    bev = [_numbers(corner, 2) for corner in row["bev"]] if row["bev"] is not None else None
    if bev is not None and len(bev) != 4:
        raise ValueError("four corners")
    box = row["cuboid"]
    if row["source"] not in object_sources():
        raise ValueError(row["source"])
    if row["type"] is not None and not isinstance(row["type"], str):
        raise ValueError(row["type"])
    return FusedObject(
        id=int(row["id"]),
        source=row["source"],
        label=row["type"],
        score=None,
        bbox=_some(row["bbox"], 4),  # type: ignore[arg-type]
        bev=tuple(bev) if bev is not None else None,  # type: ignore[arg-type]
        cuboid=Cuboid(_numbers(box["center"], 3), _numbers(box["size"], 3), _number(box["yaw_rad"]))  # type: ignore[arg-type]
        if box is not None
        else None,
        closest_point=_some(row["closest_point"], 3),  # type: ignore[arg-type]
        distance_m=_number(row["distance_m"]) if row["distance_m"] is not None else None,
        distance_sigma_m=None,
        velocity_mps=_some(row["velocity_mps"], 2),  # type: ignore[arg-type]
        seen_by="" if row["carried"] else row["source"],
        hits=int(row["hits"]),
        lidar_points=int(row["lidar_points"]),
        lidar_track=None,
        vision_track=None,
        in_path=bool(row["in_path"]),
    )


def _some(values: list[Any] | None, count: int) -> tuple[float, ...] | None:
    return None if values is None else _numbers(values, count)


def _numbers(values: list[Any], count: int) -> tuple[float, ...]:
    if len(values) != count:
        raise ValueError(f"{count} numbers")
    return tuple(_number(value) for value in values)


def _number(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(value)
    return number
