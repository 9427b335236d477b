"""`cipv bench`: measures the speed of each stage, compared with common libraries in the same run."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Annotated, Any

from rich.console import Console
from rich.table import Column, Table

from app.bench import clients as clients_bench
from app.bench.calibration import speed_warning
from app.bench.demands import PAGE_DEMANDS, broken, page_rows
from app.bench.other_load import load_warning, read_cpu_times
from app.bench.page import measure as page_bench
from app.bench.suite import CALIBRATION, run_all
from app.commands.support.arguments import option
from app.commands.support.options import PipelineOptions
from app.fleet.extra import need_extra
from pipeline.common.errors import BadInput

CLIENTS_EACH_S, PAGE_S = 6.0, 12.0
_PEER_WIDTH, _FILE_WIDTH = 18, 120
"""Columns of the narrowest legible table, and of one that is written to a file."""


@dataclass(frozen=True)
class Bench:
    """Time each stage and comparable libraries, interleaved in one process. Takes up to 45 s. Exits with 1 when a stage
    is slower than required on an idle machine with two cores.

    Example: cipv bench --json > bench.json
    """

    pipeline: PipelineOptions = field(default_factory=PipelineOptions)
    json: bool = False
    """Print the figures as JSON"""
    clients: int = 0
    """Measure the server load of N stream clients instead, e.g. 50"""
    page: Annotated[str | None, option("SOURCE")] = None
    """Measure the latency of the dashboard in a browser instead, while it plays this source, e.g. sim:straight"""

    drives: int = 0
    """Measure queries on the tables of N synthetic drives instead, e.g. 10000 (2 GB on disk)"""

    def __call__(self) -> int:
        if self.clients < 0:
            raise BadInput(f"--clients {self.clients}: must not be negative")
        if self.drives < 0:
            raise BadInput(f"--drives {self.drives}: must not be negative")
        if self.drives:
            from app.bench import fleet_tables  # needs the extra `fleet`

            need_extra()
            print(json.dumps(fleet_tables.figures(self.drives), indent=1))
            return 0
        before = read_cpu_times()
        if self.clients or self.page is not None:
            live: dict[str, Any] = {}
            if self.clients:
                live["clients"] = clients_bench.figures(self.clients, CLIENTS_EACH_S)
            if self.page is not None:
                live["page"] = page_bench.figures(self.page, PAGE_S)
            print(json.dumps(live, indent=1))
            _warn(load_warning(before, read_cpu_times()))
            return _judge(broken(page_rows(live["page"]), PAGE_DEMANDS) if "page" in live else ())
        figures = run_all(self.pipeline.parameters(), self.pipeline.detector)
        warning = load_warning(before, read_cpu_times())
        if self.json:
            print(json.dumps(figures, indent=1))
        else:
            terminal = Console()
            Console(width=None if terminal.is_terminal else _FILE_WIDTH).print(_table(figures))
            for sentence in _absent(figures):
                print(sentence)
        _warn(warning)
        _warn(speed_warning(figures[CALIBRATION]))
        return _judge(broken(figures))


def _warn(warning: str | None) -> None:
    """Say what makes figures doubtful, if anything."""
    if warning is not None:
        print(f"cipv: {warning}", file=sys.stderr)


def _judge(failures: Iterable[str]) -> int:
    """Print each failure. Returns the exit status."""
    status = 0
    for failure in failures:
        print(f"cipv: {failure}", file=sys.stderr)
        status = 1
    return status


def _table(figures: dict[str, dict[str, Any]]) -> Table:
    stage_column, peer_column = Column("stage", no_wrap=True), Column("peer", min_width=_PEER_WIDTH)
    columns = (stage_column, "median ms", "p99 ms", "samples", peer_column, "median ms", "times faster")
    table = Table(*columns, title="cipv bench")
    for stage, row in figures.items():
        peers = [_peer_cells(name, peer) for name, peer in row["peers"].items()] or [_remark(row)]
        for n, cells in enumerate(peers):
            own = (
                (stage, f"{row['median_ms']:.3f}", f"{row['p99_ms']:.3f}", f"{row['samples']}") if n == 0 else [""] * 4
            )
            table.add_row(*own, *cells)
    return table


def _absent(figures: dict[str, dict[str, Any]]) -> Iterator[str]:
    """A sentence for each reason why peers could not be measured, with their names."""
    names: dict[str, list[str]] = {}
    for row in figures.values():
        for name, peer in row["peers"].items():
            if peer["ratio"] is None and name not in names.setdefault(peer["absent"], []):
                names[peer["absent"]].append(name)
    for reason, peers in names.items():
        yield f"Absent: {'; '.join(peers)}: {reason}"


def _remark(row: dict[str, Any]) -> tuple[str, str, str]:
    """The cells of a stage without peers."""
    if "p99_to_idle_median" in row:
        return f"p99 is {row['p99_to_idle_median']:.1f} × the idle step's median", "", ""
    if "rate_hz" in row:
        return f"{row['rate_hz']:.0f} Hz", "", ""
    return (f"{row['cpu_ms']:.2f} ms of processor time", "", "") if "cpu_ms" in row else ("", "", "")


def _peer_cells(name: str, peer: dict[str, Any]) -> tuple[str, str, str]:
    """The cells of a peer; ``_absent`` says why one could not be measured."""
    if peer["ratio"] is None:
        return name, "absent", ""
    return name, f"{peer['median_ms']:.2f}", f"{peer['ratio']:.1f} ×"
