"""Benchmarks queries on a fleet's tables: tables of many synthetic drives, as large as real ones."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

DRIVES, FRAMES_A_DRIVE, OBJECTS_A_FRAME, EVENTS_A_DRIVE = 10_000, 600, 2, 20
ROUNDS = 5
QUESTIONS = {
    "cut-ins under 1.5 s, sensors disagreeing": ("events", "cut_in AND min_ttc_s < 1.5 AND disagreement"),
    "events at night in a bend": ("events", "night AND bend AND severity = 'warning'"),
    "frames with hard braking close behind a lead": ("frames", "accel_mps2 < -5 AND distance_m < 10"),
    "objects in the path, sensors disagreeing": ("objects", "in_path AND vl_gap_sigmas > 3.5 AND distance_m < 20"),
    "drives with a lead in most frames": ("drives", "frames_with_lead > 0.9 * frames"),
}


def figures(drives: int = DRIVES) -> dict[str, Any]:
    """Median time of each query in milliseconds, each on a new connection, and the sizes of the tables."""
    from app.fleet.find import FleetTables
    from app.fleet.store import Store

    with tempfile.TemporaryDirectory(prefix="cipv-bench-fleet-") as folder:
        rows = make_tables(Path(folder), drives)
        size_mb = sum(file.stat().st_size for file in Path(folder).rglob("*.parquet")) / 1e6
        out: dict[str, Any] = {"drives": drives, "rows": rows, "size_mb": round(size_mb, 1), "questions": {}}
        for name, (of, where) in QUESTIONS.items():
            times_ms, found = [], 0
            for _ in range(ROUNDS):
                start = perf_counter()
                found = FleetTables(Store(folder)).find(where, of, 100).total  # type: ignore[arg-type]
                times_ms.append((perf_counter() - start) * 1e3)
            out["questions"][name] = {"median_ms": round(float(np.median(times_ms)), 1), "found": found}
    return out


def make_tables(folder: Path, drives: int) -> dict[str, int]:
    """Write packs of synthetic drives as `cipv batch` would. Returns the number of rows of each table."""
    import pyarrow as pa

    from app.fleet.batch.tables import EQUAL_TABLES
    from app.fleet.pack import PACK_DRIVES, write_pack
    from app.fleet.pack_index import packed_file

    run, rows = "0" * 12, dict.fromkeys((shape.name for shape in EQUAL_TABLES), 0)
    counts = {
        "drives": 1,
        "frames": FRAMES_A_DRIVE,
        "objects": FRAMES_A_DRIVE * OBJECTS_A_FRAME,
        "events": EVENTS_A_DRIVE,
        "scores": 10,
    }
    names = [f"drive-{number:05d}" for number in range(drives)]
    packs = [names[first : first + PACK_DRIVES] for first in range(0, drives, PACK_DRIVES)]
    random = np.random.default_rng(0)
    for number, inside in enumerate(packs):
        for shape in EQUAL_TABLES:
            file = folder / packed_file(shape.name, run, number)
            file.parent.mkdir(parents=True, exist_ok=True)
            count = counts[shape.name]
            whole = pa.table(
                [_values(column.name, column.kind, count * len(inside), count, random) for column in shape.columns],
                schema=shape.schema(),
            )
            write_pack(file, shape, ((name, whole.slice(n * count, count)) for n, name in enumerate(inside)))
            rows[shape.name] += count * len(inside)
    index = [dict.fromkeys(inside, "0" * 16) for inside in packs]
    (folder / "packed" / f"run={run}.json").write_text(json.dumps(index), encoding="utf-8")
    (folder / "latest.json").write_text(json.dumps({"run": run}), encoding="utf-8")
    (folder / "runs").mkdir()
    (folder / "runs" / f"{run}.json").write_text("{}", encoding="utf-8")
    return rows


_SCALES = {
    "ttc_s": 20.0,
    "min_ttc_s": 20.0,
    "distance_m": 60.0,
    "speed_mps": 35.0,
    "max_gap_sigmas": 4.0,
    "vl_gap_sigmas": 4.0,
    "accel_mps2": -6.0,
    "brightness": 200.0,
    "yaw_rate_radps": 0.2,
}


def _values(name: str, kind: str, rows: int, a_drive: int, random: np.random.Generator) -> Any:
    """A column of random values that vary from row to row like measured ones, so that they compress as badly."""
    import pyarrow as pa

    from app.drive.events import event_kinds

    n = np.arange(rows) % a_drive
    if name == "index":
        return pa.array((n // max(1, a_drive // FRAMES_A_DRIVE)).astype(np.int32))
    if name == "t_ns":
        return pa.array(n.astype(np.int64) * 100_000_000)
    if kind == "string":
        choice = event_kinds() if name == "kind" else ("info", "notice", "warning", "alarm")
        return pa.array(np.array(choice)[random.integers(len(choice), size=rows)])
    if kind == "bool":
        return pa.array(random.random(rows) < 0.1)
    if kind.startswith("int"):
        return pa.array(random.integers(0, 700, rows).astype(kind))
    return pa.array((random.random(rows) * _SCALES.get(name, 1.0)).astype(kind))
