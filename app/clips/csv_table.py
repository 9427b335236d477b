"""Exports a clip as a CSV table with a row for each object in each frame."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from app.clips.clip import Clip, clip_frames
from pipeline.common.progress import Progress
from pipeline.types.result_json import to_json

_OBJECT_FIELDS = (
    "id", "source", "type", "type_score", "distance_m", "distance_sigma_m", "speed_over_ground_mps",
    "speed_over_ground_sigma_mps", "in_path", "in_path_probability", "path_offset_m", "moving", "ttc_s", "carried",
    "hits", "lidar_points",
)  # fmt: skip
_COLUMNS = (
    "frame", "t_ns", "ego_speed_mps", "ego_yaw_rate_radps", "acc_state", "acc_accel_mps2",
    "is_cipv", "closing_speed_mps", *_OBJECT_FIELDS,
    "x_m", "y_m", "vx_mps", "vy_mps", "length_m", "width_m", "height_m", "yaw_rad",
)  # fmt: skip


def write(clip: Clip, path: Path, progress: Progress) -> None:
    """Write the clip's results as a table."""
    write_csv((to_json(result) for _, result in clip_frames(clip, progress, images=False)), path)


def write_csv(results: Iterable[dict[str, Any] | None], out: Path) -> None:
    """Write a row for each object of each result. results: None for a frame without a result."""
    with out.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, _COLUMNS)
        table.writeheader()
        for result in results:
            table.writerows(rows(result or {}))


def rows(result: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """A row for each object of a result (docs/reference/results.md); one row without an object if it has none."""
    ego, acc, cipv = result.get("ego") or {}, result.get("acc") or {}, result.get("cipv") or {}
    about = {
        "frame": result.get("frame"),
        "t_ns": result.get("t_ns"),
        "ego_speed_mps": ego.get("speed_mps"),
        "ego_yaw_rate_radps": ego.get("yaw_rate_radps"),
        "acc_state": acc.get("state"),
        "acc_accel_mps2": acc.get("accel_mps2"),
    }
    for each in result.get("objects") or [{}]:
        is_cipv = bool(cipv) and each.get("id") == cipv.get("id")
        yield {
            **about,
            "is_cipv": is_cipv,
            "closing_speed_mps": cipv.get("closing_speed_mps") if is_cipv else None,
            **{name: each.get(name) for name in _OBJECT_FIELDS},
            **_numbers(each.get("closest_point"), "x_m", "y_m"),
            **_numbers(each.get("velocity_mps"), "vx_mps", "vy_mps"),
            **_numbers((each.get("cuboid") or {}).get("size"), "length_m", "width_m", "height_m"),
            "yaw_rad": (each.get("cuboid") or {}).get("yaw_rad"),
        }


def _numbers(values: list[float] | None, *names: str) -> dict[str, float | None]:
    """The values by name; None for each if there are no values."""
    return dict(zip(names, values, strict=False)) if values else dict.fromkeys(names)
