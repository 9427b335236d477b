"""Where two runs differ: the drives and frames with a different lead, and the events that only one of them has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import duckdb

from app.drive.compare import SAME_PLACE_M
from app.fleet.find import FleetTables
from app.fleet.query_result import QueryTable

EVENT_SLACK_S = 1.0
"""Events of one kind within this time count as the same."""


@dataclass(frozen=True)
class LeadChange:
    """A drive in which the lead differs."""

    drive: str
    """Its name in the tables."""
    address: str
    """The recording's, as `cipv serve` opens it."""
    index: int
    """The first frame of the longest stretch with another lead."""
    frames: int
    """Frames with another lead."""
    longest: int
    """Of them, in a row."""
    text: str
    """What the leads are there."""


@dataclass(frozen=True)
class EventChange:
    """Events of one kind."""

    kind: str
    """What happened, e.g. ``cut_in``."""
    base: int
    """How many the base has, in the drives that both have."""
    run: int
    """How many the compared run has there."""
    lost: int
    """In the base alone."""
    gained: int
    """In the run alone."""


def changed_drives(base: FleetTables, run: FleetTables, most: int = 20) -> tuple[list[LeadChange], int, int]:
    """The drives with the longest stretches in which the lead differs, worst first; the number of frames in which it
    differs; and the number of frames in both runs."""
    both = _joined(base, run, "frames", "drive, address, index, t_s, cipv_id, distance_m, path_offset_m")
    near = f"abs(a.distance_m - b.distance_m) <= {SAME_PLACE_M} AND " + (
        f"coalesce(abs(a.path_offset_m - b.path_offset_m) <= {SAME_PLACE_M}, a.path_offset_m IS NULL AND "
        "b.path_offset_m IS NULL)"
    )
    both.execute(
        f"""CREATE TABLE differing AS SELECT a.drive, a.address, a.index, a.distance_m AS base_m, b.distance_m AS run_m,
        a.index - row_number() OVER (PARTITION BY a.drive ORDER BY a.index) AS stretch
        FROM base a JOIN run b USING (drive, index)
        WHERE NOT CASE WHEN a.cipv_id IS NULL OR b.cipv_id IS NULL THEN a.cipv_id IS NULL AND b.cipv_id IS NULL
        ELSE coalesce({near}, false) END"""
    )
    compared = _one(both, "SELECT count(*) FROM base a JOIN run b USING (drive, index)")
    differing = _one(both, "SELECT count(*) FROM differing")
    rows = both.execute(
        """WITH stretches AS (SELECT drive, address, min(index) AS first, count(*) AS longest,
        arg_min(coalesce(base_m, -1), index) AS base_m, arg_min(coalesce(run_m, -1), index) AS run_m
        FROM differing GROUP BY drive, address, stretch)
        SELECT drive, address, arg_max(first, longest), sum(longest), max(longest), arg_max(base_m, longest),
        arg_max(run_m, longest) FROM stretches GROUP BY drive, address
        ORDER BY max(longest) DESC, sum(longest) DESC, drive LIMIT $1""",
        [most],
    ).fetchall()
    changes = [
        LeadChange(drive, address, int(first), int(frames), int(longest), f"base: {_lead(was)}; now: {_lead(now)}")
        for drive, address, first, frames, longest, was, now in rows
    ]
    return changes, differing, compared


def changed_events(base: FleetTables, run: FleetTables) -> list[EventChange]:
    """By kind: how many there are, and how many have no other near them in the other run."""
    both = _joined(base, run, "events", "drive, kind, t_s")
    unmatched = f"""SELECT kind, count(*) FROM {{one}} a WHERE NOT EXISTS (SELECT 1 FROM {{other}} b
        WHERE a.drive = b.drive AND a.kind = b.kind AND abs(a.t_s - b.t_s) <= {EVENT_SLACK_S}) GROUP BY kind"""
    found: dict[str, Mapping[str, int]] = {
        "base": dict(both.execute("SELECT kind, count(*) FROM base GROUP BY kind").fetchall()),
        "run": dict(both.execute("SELECT kind, count(*) FROM run GROUP BY kind").fetchall()),
        "lost": dict(both.execute(unmatched.format(one="base", other="run")).fetchall()),
        "gained": dict(both.execute(unmatched.format(one="run", other="base")).fetchall()),
    }
    kinds = sorted(found["base"].keys() | found["run"].keys())
    return [EventChange(kind, *(found[name].get(kind, 0) for name in found)) for kind in kinds]


def _joined(base: FleetTables, run: FleetTables, table: QueryTable, columns: str) -> duckdb.DuckDBPyConnection:
    """Both runs' rows of the drives that both have, as ``base`` and ``run``."""
    shared = sorted(set(base.drives()) & set(run.drives()))
    connection = duckdb.connect()
    for name, tables in (("base", base), ("run", run)):
        rows = tables.arrow(table, columns)
        connection.register(f"{name}_rows", rows)
        connection.execute(
            f"CREATE TABLE {name} AS SELECT * FROM {name}_rows WHERE drive IN (SELECT unnest($1))", [shared]
        )
    return connection


def _one(connection: duckdb.DuckDBPyConnection, sql: str) -> int:
    row = connection.execute(sql).fetchone()
    assert row is not None
    return int(row[0])


def _lead(distance_m: float) -> str:
    return "none" if distance_m < 0.0 else f"a lead at {distance_m:.1f} m"
