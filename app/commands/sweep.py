"""`cipv sweep`: run many sets of parameters over the drives of a fleet."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from app.commands.support.arguments import option
from app.commands.support.cluster import ClusterOptions, run_with_bar, tally_of
from app.commands.support.options import PipelineOptions
from app.fleet.extra import need_extra
from pipeline.common.errors import BadInput
from pipeline.evaluation.report_sections import Chart, ReportSection, Series, Table
from pipeline.params import Params, to_yaml, with_changes

if TYPE_CHECKING:
    from app.fleet.batch.plan import Plan
    from app.fleet.store import Store
    from app.fleet.sweep import Tried

_MISSED = ("labelled.lead_missed", "late_leads")
_PHANTOMS = ("labelled.cipv_false", "phantom_leads")
"""Scores that a set of parameters is judged by: against labels where the fleet has some, else without."""


@dataclass(frozen=True)
class ParameterSweep:
    """Run a fleet's recordings with many sets of parameters. Networks process each image once. Prints the scores of
    each set and marks the Pareto front: missed leads against phantom leads.

    Example: cipv sweep recordings/ --out drives --over cluster.tolerance_m=0.6:1.2:4 --over cipv.confirm_hits=2,3,4
    """

    addresses: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="ADDRESS")]
    """Recordings, as for `cipv batch`"""
    out: Annotated[str, tyro.conf.arg(metavar="DIR")]
    """Output folder for the tables, or an address in a store"""
    over: Annotated[tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="NAME=VALUES")] = ()
    """A parameter and its values: NAME=a,b,c or NAME=low:high:count"""
    latin: Annotated[int | None, option("N")] = None
    """Try N sets spread over the space (Latin hypercube) instead of every combination"""
    pipeline: PipelineOptions = field(default_factory=PipelineOptions)
    sensors: Literal["lidar", "camera", "both"] = "both"
    """Ablation: run as if the cars had this sensor only"""
    rings: int = 16
    """KITTI: LiDAR channels to keep: 16, like a VLP-16, or 64 for all"""
    cluster: ClusterOptions = field(default_factory=ClusterOptions)
    save: Annotated[Path | None, option("FILE")] = None
    """Write the best set as a preset file (YAML)"""
    report: Annotated[Path | None, option("FILE")] = None
    """Write an HTML file with the table and the Pareto front"""
    json: bool = False
    """Print the figures as JSON"""

    def __call__(self) -> int:
        need_extra()
        from app.fleet.batch.addresses import absolute
        from app.fleet.batch.plan import Plan
        from app.fleet.batch.schedule import SchedulerLost
        from app.fleet.store import Store
        from app.fleet.sweep import best_of, front

        sets = self._sets()
        base = self.pipeline.parameters()
        points = [with_changes(base, changes) for changes in sets]  # all, so that a wrong one is told before the work
        plan = Plan(tuple(map(absolute, self.addresses)), base, self.pipeline.choice(), self.sensors, self.rings)
        store = Store(self.out)
        try:
            runs = self._run(plan, points, store)
        except SchedulerLost as lost:
            print(f"cipv: connection to Dask lost: {lost}; run the same command again to continue", file=sys.stderr)
            return 1
        tried, names = _judged(store, list(zip(runs, sets, strict=True)))
        best = best_of(tried)
        self._tell(tried, front(tried), best, names)
        if self.save is not None and best is not None:
            self.save.write_text(to_yaml(points[tried.index(best)]), encoding="utf-8")
            print(f"cipv: {self.save}: the set of run {best.run}", file=sys.stderr)
        return 0

    def _sets(self) -> list[dict[str, Any]]:
        from app.fleet.sweep import MOST_POINTS, grid, latin, parse_axis

        if not self.addresses:
            raise BadInput("no recording to sweep over; give at least one")
        if not self.over:
            raise BadInput("--over NAME=VALUES: give at least one parameter")
        self.cluster.check()
        axes = [parse_axis(text) for text in self.over]
        if self.latin is None:
            return grid(axes)
        if not 1 <= self.latin <= MOST_POINTS:
            raise BadInput(f"--latin {self.latin}: expected 1 to {MOST_POINTS}")
        return latin(axes, self.latin)

    def _run(self, plan: Plan, points: list[Params], store: Store) -> list[str]:
        """The name of the run of each set."""
        from app.fleet.batch.plan import begin, work_of
        from app.fleet.pack import pack

        runs = []
        with self.cluster.client(len(work_of(plan, store).all)) as client:
            for number, params in enumerate(points, 1):
                this = replace(plan, params=params)
                work = work_of(this, store)
                begin(this, work, store)
                tally = tally_of(work)
                if work.jobs:
                    run_with_bar(client, work, tally, f"set {number} of {len(points)}")
                for address, reason in (tally.aside | tally.failed if number == 1 else tally.failed).items():
                    print(f"cipv: skipped: {address}: {reason}", file=sys.stderr)
                pack(store, work.key.name)
                runs.append(work.key.name)
        return runs

    def _tell(self, tried: list[Tried], best: list[Tried], one: Tried | None, names: tuple[str, str]) -> None:
        from app.reports.html import html
        from app.reports.terminal_tables import show

        if self.json:
            rows = [
                {"run": each.run, "set": dict(each.changes), names[0]: each.missed, names[1]: each.phantoms}
                for each in tried
            ]
            said = {"tried": rows, "front": [each.run for each in best], "best": one.run if one is not None else None}
            print(json.dumps(said, indent=1))
        parameters = tuple(tried[0].changes)
        table = Table(
            "Sets of parameters",
            ("run", *parameters, *names, ""),
            tuple(
                (each.run, *each.changes.values(), each.missed, each.phantoms, _word(each, best, one)) for each in tried
            ),
            decimals=3,
        )
        chart = Chart(
            "Each point is a set of parameters; the line is the Pareto front",
            names[1],
            names[0],
            (
                Series.of_points("sets", [(each.phantoms or 0.0, each.missed or 0.0) for each in tried]),
                Series(
                    "front", tuple(each.phantoms or 0.0 for each in best), tuple(each.missed or 0.0 for each in best)
                ),
            ),
        )
        section = ReportSection("sweep", "Sweep", (), (table,), (chart,))
        if self.report is not None:
            self.report.write_text(html([section], "Sweep"), encoding="utf-8")
            print(f"cipv: report written to {self.report}", file=sys.stderr)
        if not self.json and self.report is None:
            show([section])


def _word(each: Tried, best: list[Tried], one: Tried | None) -> str:
    return "best" if each is one else "front" if each in best else ""


def _judged(store: Store, runs: list[tuple[str, dict[str, Any]]]) -> tuple[list[Tried], tuple[str, str]]:
    """Every set with its two scores, and the names of these."""
    from app.fleet.compare.worth import values_of
    from app.fleet.find import FleetTables
    from app.fleet.sweep import Tried

    values = {run: values_of(FleetTables(store, run).scores()) for run, _ in runs}
    names = tuple(
        next((name for name in pair if any(found.get(name) is not None for found in values.values())), pair[-1])
        for pair in (_MISSED, _PHANTOMS)
    )
    tried = [Tried(run, changes, values[run].get(names[0]), values[run].get(names[1])) for run, changes in runs]
    return tried, (names[0], names[1])
