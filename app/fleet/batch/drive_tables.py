"""One drive's part of each table, written while the drive runs, so that memory holds only a few hundred frames."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from app.drive.events.event import Event
from app.drive.frame_rows import Objects, Row
from app.fleet.batch.tables import DRIVES, EVENTS, FRAMES, OBJECTS, SCORES, TIMINGS, TableShape
from pipeline.common.clips import begins_clip
from pipeline.decision.object_motion import closing_speed_mps
from pipeline.evaluation.label_free.score import DriveScores
from pipeline.types import Frame, FusedObject, Result

GROUP_FRAMES = 512
"""Frames per row group: held in memory before they are written."""
_AFTER_S, _AROUND_S = 3.0, 2.0
"""Around an event: for the shortest TTC after it, and for the largest gap between the sensors."""
Values = tuple[Any, ...]


class PartWriter:
    """One table of one drive: a Parquet file, written in groups. Use it as a context manager."""

    def __init__(self, shape: TableShape, path: Path) -> None:
        self._schema = shape.schema()
        self._rows: list[Values] = []
        self._file = pq.ParquetWriter(path, self._schema, compression="zstd")

    def __enter__(self) -> PartWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.flush()
        self._file.close()

    def add(self, rows: Iterable[Values]) -> None:
        """Rows, each as long as there are columns."""
        self._rows += rows

    def flush(self) -> None:
        """Write what was added."""
        columns = list(zip(*self._rows, strict=True)) or [()] * len(self._schema)
        arrays = [
            pa.array(values, field.type, from_pandas=True)  # NaN is null
            for values, field in zip(columns, self._schema, strict=True)
        ]
        self._file.write_table(pa.Table.from_arrays(arrays, schema=self._schema))
        self._rows = []


class FrameTables:
    """The tables that grow frame by frame, in a folder of this machine. Use it as a context manager."""

    def __init__(self, folder: Path) -> None:
        self._stack = ExitStack()
        self._frames, self._objects, self._timings = (
            self._stack.enter_context(PartWriter(shape, folder / f"{shape.name}.parquet"))
            for shape in (FRAMES, OBJECTS, TIMINGS)
        )
        self._count, self._began_ns = 0, 0

    def __enter__(self) -> FrameTables:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def add(self, frame: Frame, result: Result, row: Row, records: Objects) -> None:
        """The next frame. row, records: as ``app.drive.frame_rows`` makes them of it."""
        if not self._count:
            self._began_ns = frame.t_ns
        t_s = (frame.t_ns - self._began_ns) / 1e9
        self._frames.add([_frame(frame, result, row, records, t_s)])
        self._objects.add(
            _object(frame, result, item, record) for item, record in zip(result.objects, records, strict=True)
        )
        self._timings.add((frame.index, stage, ms) for stage, ms in sorted(result.timing_ms.items()))
        self._count += 1
        if self._count % GROUP_FRAMES == 0:
            for part in (self._frames, self._objects, self._timings):
                part.flush()


def write_events(path: Path, events: Sequence[Event], rows: Sequence[Row], gaps: Sequence[Gap], gap_s: float) -> None:
    """The events of a drive. gaps: of each frame's CIPV. gap_s: longest time between frames of one clip."""
    t_ns = [row.t_ns for row in rows]
    with PartWriter(EVENTS, path) as part:
        for event in events:
            part.add([_event(event, rows, gaps, t_ns, gap_s)])


def write_scores(path: Path, scores: DriveScores) -> None:
    """The scores of a drive."""
    with PartWriter(SCORES, path) as part:
        part.add((name, over / under if under else None, over, under) for name, (over, under) in scores.items())


def write_drive(path: Path, values: Values) -> None:
    """The drive's own row."""
    with PartWriter(DRIVES, path) as part:
        part.add([values])


Gap = tuple[float, float]
"""Camera's minus LiDAR's distance of a frame's CIPV, in metres, and its absolute value in standard deviations; NaN:
unknown."""
NO_GAP: Gap = (math.nan, math.nan)


def gap_of(row: Row, records: Objects) -> Gap:
    """Of the frame's CIPV."""
    match = records[records["id"] == row.cipv_id] if row.cipv_id is not None else records[:0]
    return (float(match["vl_gap_m"][0]), float(match["vl_gap_sigmas"][0])) if len(match) else NO_GAP


def _frame(frame: Frame, result: Result, row: Row, records: Objects, t_s: float) -> Values:
    gap_m, gap_sigmas = gap_of(row, records)
    chosen = result.chosen()
    return (
        frame.index,
        frame.t_ns,
        t_s,
        frame.name,
        row.cipv_id,
        row.source,
        row.carried,
        row.distance_m,
        chosen.distance_sigma_m if chosen is not None else None,
        row.closing_speed_mps,
        row.ttc_s,
        row.path_offset_m,
        gap_m,
        gap_sigmas,
        row.speed_mps,
        row.yaw_rate_radps,
        row.desired_speed_mps,
        row.accel_mps2,
        row.brake,
        row.acc_state,
        row.gaps,
        row.reach_m,
        result.path.source,
        len(result.objects),
        " ".join(result.notes),
    )


def _object(frame: Frame, result: Result, item: FusedObject, record: Any) -> Values:
    x, y = item.closest_point[:2] if item.closest_point is not None else (None, None)
    return (
        frame.index,
        frame.t_ns,
        item.id,
        result.cipv is not None and item.id == result.cipv.id,
        item.source,
        item.seen_by,
        item.label,
        item.score,
        item.distance_m,
        item.distance_sigma_m,
        item.distance_from,
        item.height_from,
        closing_speed_mps(item),
        item.ttc_s,
        item.speed_over_ground_mps,
        item.moving,
        item.in_path,
        item.in_path_probability,
        item.existence,
        item.path_offset_m,
        float(record["vl_gap_m"]),
        float(record["vl_gap_sigmas"]),
        x,
        y,
        *(item.velocity_mps or (None, None)),
        *(item.bbox or (None,) * 4),
        *((*item.cuboid.size, item.cuboid.yaw_rad) if item.cuboid is not None else (None,) * 4),
        item.hits,
        item.lidar_points,
    )


def _event(event: Event, rows: Sequence[Row], gaps: Sequence[Gap], t_ns: Sequence[int], gap_s: float) -> Values:
    row = rows[event.index]
    after = _near(t_ns, event.index, 0.0, _AFTER_S, gap_s)
    around = _near(t_ns, event.index, _AROUND_S, _AROUND_S, gap_s)
    ttc = [value for n in after if (value := rows[n].ttc_s) is not None]
    gap_m = [abs(gaps[n][0]) for n in around if not np.isnan(gaps[n][0])]
    sigmas = [gaps[n][1] for n in around if not np.isnan(gaps[n][1])]
    first, second = (*event.ids, None, None)[:2]
    return (
        event.index,
        row.t_ns,
        (row.t_ns - t_ns[0]) / 1e9,
        event.kind,
        event.severity,
        event.text,
        first,
        second,
        row.source,
        row.distance_m,
        row.closing_speed_mps,
        row.ttc_s,
        min(ttc, default=None),
        max(gap_m, default=None),
        max(sigmas, default=None),
        row.speed_mps,
        row.yaw_rate_radps,
        row.accel_mps2,
    )


def _near(t_ns: Sequence[int], at: int, before_s: float, after_s: float, gap_s: float) -> range:
    """Frames of the same clip within these times before and after a frame."""
    first = last = at
    while first > 0 and t_ns[at] - t_ns[first - 1] <= before_s * 1e9:
        if begins_clip(t_ns[first - 1], t_ns[first], gap_s):
            break
        first -= 1
    while last + 1 < len(t_ns) and t_ns[last + 1] - t_ns[at] <= after_s * 1e9:
        if begins_clip(t_ns[last], t_ns[last + 1], gap_s):
            break
        last += 1
    return range(first, last + 1)
