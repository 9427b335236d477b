"""`cipv compare`: compare two runs of `cipv batch` over the same drives."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import tyro

from app.commands.evaluate import DASHBOARD, dashboard_link
from app.commands.support.arguments import option
from app.fleet.extra import need_extra
from pipeline.common.errors import BadInput
from pipeline.common.files.output_files import ensure_writable

_CHANGES = 20


@dataclass(frozen=True)
class Compare:
    """Compare two runs of `cipv batch`, paired by drive: scores with confidence intervals, events, largest changes.
    With --gate, exits with 1 if a rule is broken.

    Example: cipv compare --out drives --base 0f04b5c90511 --gate rules.yaml
    """

    out: Annotated[str, tyro.conf.arg(metavar="DIR")]
    """The folder of the batch, or its address in a store"""
    base: Annotated[str, tyro.conf.arg(metavar="RUN")]
    """The run to compare against, by the name that `cipv batch` printed"""
    run: Annotated[str | None, option("RUN")] = None
    """The run to compare; default: that of the last batch"""
    base_out: Annotated[str | None, option("DIR")] = None
    """Folder of the base run, if it is another one"""
    gate: Annotated[Path | None, option("FILE")] = None
    """Rules that the run must meet (YAML)"""
    report: Annotated[Path | None, option("FILE")] = None
    """Write an HTML file with tables and links to the largest changes; an existing file is replaced"""
    dashboard: Annotated[str, tyro.conf.arg(metavar="URL")] = DASHBOARD
    """Dashboard address for the links, as `cipv serve` prints it"""
    json: bool = False
    """Print the figures as JSON"""

    def __call__(self) -> int:
        need_extra()
        from app.fleet.compare.gate import broken, read_rules
        from app.fleet.compare.report import as_json, compare_runs, sections
        from app.fleet.find import FleetTables
        from app.fleet.runs import set_aside
        from app.fleet.store import Store
        from app.reports.html import html
        from app.reports.terminal_tables import show

        rules = read_rules(self.gate) if self.gate is not None else None
        if self.report is not None:
            ensure_writable(self.report)
        run = FleetTables(Store(self.out), self.run)
        base = FleetTables(Store(self.base_out or self.out), self.base)
        if (base.store.address, base.run) == (run.store.address, run.run):
            raise BadInput(f"--base {self.base}: it is the run itself; choose another with --run")
        told = compare_runs(base, run, _CHANGES)
        link = partial(dashboard_link, self.dashboard)
        said = []
        if rules is not None:
            aside = len(set_aside(run.store, run.run).keys() - set_aside(base.store, base.run).keys())
            said = broken(rules, told.scores, told.events, told.drives, aside)
        if self.json:
            print(json.dumps(as_json(told, link) | {"broken": said}, indent=1, ensure_ascii=False))
        elif self.report is None:
            show(sections(told, link))
        if self.report is not None:
            title = f"Run {told.run} compared with {told.base}"
            self.report.write_text(html(sections(told, link), title), encoding="utf-8")
            print(f"cipv: report written to {self.report}", file=sys.stderr)
        for sentence in said:
            print(f"cipv: FAILED: {sentence}", file=sys.stderr)
        return 1 if said else 0
