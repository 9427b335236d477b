"""`cipv scores`: print the scores of a batch's runs, with and without labels."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from app.fleet.extra import need_extra
from pipeline.common.errors import BadInput

if TYPE_CHECKING:
    from app.fleet.compare.worth import Worth


@dataclass(frozen=True)
class Scores:
    """Print the scores of a batch's runs that need no labels. If drives have labels, also print how well each score
    ranks drives and runs as the labels do.

    Example: cipv scores --out drives
    """

    out: Annotated[str, tyro.conf.arg(metavar="DIR")]
    """The folder of the batch, or its address in a store"""
    run: Annotated[tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="RUN")] = ()
    """Only this run; default: all"""
    json: bool = False
    """Print the figures as JSON"""

    def __call__(self) -> int:
        need_extra()
        from app.fleet.compare.worth import values_of, worths
        from app.fleet.find import FleetTables
        from app.fleet.pack_index import packs_of
        from app.fleet.runs import about_run, runs_of, summary
        from app.fleet.store import Store
        from app.reports.terminal_tables import show
        from pipeline.evaluation.label_free.score import SCORES
        from pipeline.evaluation.report_sections import ReportSection, Table

        store = Store(self.out)
        names = self.run or tuple(name for name in runs_of(store) if packs_of(store, name))
        if not names:
            raise BadInput(f"{store.address}: no tables of `cipv batch` here")
        rows = {name: FleetTables(store, name).scores() for name in names}
        values = {name: values_of(found) for name, found in rows.items()}
        worth = worths(rows)
        about = {name: summary(about_run(store, name)) for name in names}
        if self.json:
            said = {"runs": values, "about": about, "worth": {each.score.name: _json(each) for each in worth}}
            print(json.dumps(said, indent=1))
            return 0
        by_run = tuple((each.title, each.unit, *(values[name].get(each.name) for name in names)) for each in SCORES)
        against = tuple(
            (each.score.title, each.score.counterpart, each.drives, each.pairs, each.rank_correlation)
            + ((each.interval.low, each.interval.high) if each.interval is not None else (None, None))
            + (each.over_runs,)
            for each in worth
            if each.pairs
        )
        settings = tuple((name, about[name], len({drive for drive, *_ in rows[name]})) for name in names)
        tables = [
            Table("Runs", ("run", "settings", "drives"), settings),
            Table("Scores without labels", ("score", "unit", *names), by_run, decimals=3),
        ]
        if against:
            heads = ("score", "against labels", "drives", "pairs", "rank correlation", "95 % low", "high", "over runs")
            tables.append(Table("Compared with labels", heads, against))
        show([ReportSection("scores", "Scores of a fleet", (), tuple(tables))])
        return 0


def _json(each: Worth) -> dict[str, Any]:
    return {
        "counterpart": each.score.counterpart,
        "drives": each.drives,
        "pairs": each.pairs,
        "rank_correlation": each.rank_correlation,
        "interval": None if each.interval is None else [each.interval.low, each.interval.high],
        "over_runs": each.over_runs,
    }
