"""`cipv find`: find moments, frames, objects or drives of a batch that meet a condition."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import tyro
from rich.console import Console
from rich.table import Table

from app.commands.evaluate import DASHBOARD, dashboard_link
from app.commands.support.arguments import option
from app.fleet.extra import need_extra
from pipeline.common.errors import BadInput

_WIDEST = 60
_PIPED_WIDTH = 240


@dataclass(frozen=True)
class Find:
    """Search the tables of `cipv batch` with an SQL condition on their columns. Each kind of event is a boolean
    column; `close`, `disagreement`, `night` and `bend` are named conditions.

    Example: cipv find "cut_in and min_ttc_s < 1.5 and disagreement" --out drives
    """

    where: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="CONDITION")]
    """SQL condition, e.g. "cut_in and speed_mps > 20"; the reference lists the columns"""
    out: Annotated[str, tyro.conf.arg(metavar="DIR")]
    """The folder of the batch, or its address in a store"""
    of: Literal["events", "frames", "objects", "drives"] = "events"
    """The table to search"""
    show: Annotated[tuple[str, ...], tyro.conf.arg(metavar="COLUMN")] = ()
    """Columns to print besides drive, address and time; default: the usual ones"""
    run: Annotated[str | None, option("NAME")] = None
    """The run to search; default: that of the last batch"""
    limit: int = 100
    """Print at most this many rows"""
    dashboard: Annotated[str, tyro.conf.arg(metavar="URL")] = DASHBOARD
    """Dashboard address for the links, as `cipv serve` prints it"""
    json: bool = False
    """Print as JSON"""

    def __call__(self) -> int:
        need_extra()
        if not 1 <= self.limit <= 1_000_000:
            raise BadInput(f"--limit {self.limit}: expected 1 to 1000000")
        from app.fleet.find import FleetTables
        from app.fleet.store import Store

        tables = FleetTables(Store(self.out), self.run)
        found = tables.find(self.where, self.of, self.limit, self.show)
        rows = [dict(zip(found.columns, row, strict=True)) for row in found.rows]
        rows = [row | {"link": dashboard_link(self.dashboard, row["address"], row.get("index", 0))} for row in rows]
        if self.json:
            print(json.dumps({"run": tables.run, "total": found.total, "rows": rows}, indent=1, ensure_ascii=False))
        else:
            _print(rows)
        more = f", the first {len(rows)} shown" if found.total > len(rows) else ""
        print(f"cipv: {found.total} {self.of} found{more}", file=sys.stderr)
        return 0


def _print(rows: list[dict[str, Any]]) -> None:
    """Print a table with a dashboard link for each moment."""
    if not rows:
        return
    names = [name for name in rows[0] if name not in ("address", "link")]
    table = Table(*names)
    for row in rows:
        cells = [_cell(row[name]) for name in names]
        table.add_row(f"[link={row['link']}]{cells[0]}[/link]", *cells[1:])
    Console(width=None if sys.stdout.isatty() else _PIPED_WIDTH).print(table)


def _cell(value: Any) -> str:
    if value is None:
        return "–"
    return f"{value:.2f}" if isinstance(value, float) else str(value)[:_WIDEST].replace("[", r"\[")
