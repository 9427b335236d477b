"""A part of a recording in the form of another program: a session (MCAP), a rerun recording, a table (CSV)."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Literal

from app.core.line import WARM_UP_FRAMES
from app.views.rerun_start_options import PLAYING, Opening
from pipeline.common.progress import Progress, silent
from pipeline.detection import Detectors
from pipeline.params import Params
from pipeline.recording.save import save
from pipeline.recording.session.source import SessionSource
from pipeline.run import through
from pipeline.types import Frame, Result
from pipeline.types.result_json import to_json
from pipeline.types.source import Source

Kind = Literal["mcap", "rrd", "csv"]

_OBJECT_FIELDS = (
    "id", "source", "type", "type_score", "distance_m", "distance_sigma_m", "speed_over_ground_mps",
    "in_path", "in_path_probability", "path_offset_m", "moving", "ttc_s", "carried", "hits", "lidar_points",
)  # fmt: skip
_COLUMNS = (
    "frame", "t_ns", "ego_speed_mps", "ego_yaw_rate_radps", "acc_state", "acc_accel_mps2",
    "is_cipv", "closing_speed_mps", *_OBJECT_FIELDS,
    "x_m", "y_m", "vx_mps", "vy_mps", "length_m", "width_m", "height_m", "yaw_rad",
)  # fmt: skip


_NO_DETECTORS = Detectors()


def export_clip(
    source: Source,
    first: int,
    last: int,
    out: Path,
    kind: Kind,
    *,
    params: Params | None = None,
    detectors: Detectors = _NO_DETECTORS,
    progress: Progress = silent,
) -> None:
    """Frames ``first`` to ``last``, both included, to ``out``.

    mcap: a session, see ``pipeline.recording.save``. csv: a row for each object, of the results that the session holds,
    else of the line run anew. rrd: the line run anew, as its layers are in no session. params, detectors: to run it
    with; without params those that the clip's first frame was recorded with, else the defaults.
    """
    if kind == "mcap":
        return save(source, out, first, last, progress)
    recorded = source.params(first) if isinstance(source, SessionSource) else None
    run = _run(source, first, last, params or recorded or Params(), detectors, progress)
    if kind == "rrd":
        return write_rrd(source.title, run, out, params or recorded or Params())
    if params is None and isinstance(source, SessionSource) and source.result(first) is not None:
        return write_csv((source.result(index) for index in range(first, last + 1)), out)
    return write_csv((to_json(result) for _, result in run), out)


def rows(result: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """A row for each object of a result in the contract's form; one without an object where it holds none."""
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


def _run(
    source: Source, first: int, last: int, params: Params, detectors: Detectors, progress: Progress
) -> Iterator[tuple[Frame, Result]]:
    """Frames with results, from a few frames before the clip so that trackers have their history when it begins."""
    frames = (source.frame(index) for index in range(max(0, first - WARM_UP_FRAMES), last + 1))
    for frame, result in through(frames, params, detectors):
        if frame.index >= first:
            yield frame, result
            progress(frame.index + 1 - first, last + 1 - first)


def write_rrd(
    title: str, run: Iterable[tuple[Frame, Result]], out: Path, params: Params, opening: Opening = PLAYING
) -> None:
    """A replay for the rerun viewer."""
    from app.views.rerun_view import RerunSink  # half a second to import: only who asks pays

    with RerunSink(out, title, params.alignment, opening) as sink:
        for frame, result in run:
            sink.show(frame, result)


def write_csv(results: Iterable[dict[str, Any] | None], out: Path) -> None:
    """A row for each object of each result; null: a frame without one."""
    with out.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, _COLUMNS)
        table.writeheader()
        for result in results:
            table.writerows(rows(result or {}))


def _numbers(values: list[float] | None, *names: str) -> dict[str, float | None]:
    """The first of the values by name; null where there are none."""
    return dict(zip(names, values, strict=False)) if values else dict.fromkeys(names)
