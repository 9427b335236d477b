"""`cipv sweep`: run many sets of parameters over the drives of a fleet."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from app.commands.support.arguments import option
from app.commands.support.cluster import ClusterOptions, run_with_bar, tally_of
from app.commands.support.interruption import says_when_interrupted
from app.commands.support.options import PipelineOptions
from app.core.terminal import one_line
from app.fleet.extra import need_extra
from pipeline.common.errors import BadInput
from pipeline.common.files.output_files import ensure_new, ensure_writable, write_new
from pipeline.evaluation.report_sections import Chart, ReportSection, Series, Table
from pipeline.params import Params, flat, to_yaml, with_changes

if TYPE_CHECKING:
    from app.fleet.batch.plan import Plan
    from app.fleet.store import Store
    from app.fleet.sweep import Proposer, Tried

_MISSED = ("labelled.lead_missed", "late_leads")
_PHANTOMS = ("labelled.cipv_false", "phantom_leads")
"""Scores by which a set of parameters is judged: with labels if the fleet has some, else without. Of all scores without
labels, these two rank parameters most like those with labels (docs/reference/fleet-scores.md)."""


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
    search: Annotated[int | None, option("N")] = None
    """Try N sets, one after another, each near those that scored best (optuna)"""
    pipeline: PipelineOptions = field(default_factory=PipelineOptions)
    sensors: Literal["lidar", "camera", "both"] = "both"
    """Ablation: run as if the cars had this sensor only"""
    rings: int = 16
    """KITTI: LiDAR channels to keep: 16, like a VLP-16, or 64 for all"""
    cluster: ClusterOptions = field(default_factory=ClusterOptions)
    save: Annotated[Path | None, option("FILE")] = None
    """Write the best set as a preset file (YAML); must not exist"""
    report: Annotated[Path | None, option("FILE")] = None
    """Write an HTML file with the table and the Pareto front; an existing file is replaced"""
    json: bool = False
    """Print the figures as JSON"""

    def __call__(self) -> int:
        need_extra()
        from app.fleet.batch.addresses import absolute
        from app.fleet.batch.plan import Plan
        from app.fleet.batch.schedule import SchedulerLost
        from app.fleet.runs import make_latest
        from app.fleet.store import Store
        from app.fleet.sweep import best_of, front

        base = self.pipeline.parameters()
        propose, count = self._proposer(base)
        plan = Plan(tuple(map(absolute, self.addresses)), base, self.pipeline.choice(), self.sensors, self.rings)
        if self.save is not None:
            ensure_new(self.save)
        for file in (self.save, self.report):
            if file is not None:
                ensure_writable(file)
        again = "run the same command again to continue"
        try:
            with says_when_interrupted(again):
                tried, names = self._run(plan, propose, count, Store(self.out))
        except SchedulerLost as lost:
            print(f"cipv: connection to Dask lost: {lost}; {again}", file=sys.stderr)
            return 1
        best = best_of(tried)
        make_latest(Store(self.out), (best or tried[-1]).run)  # usually searched and compared next
        self._tell(tried, front(tried), best, names)
        if best is None:
            print(f"cipv: no set has both scores, {names[0]} and {names[1]}; none is the best", file=sys.stderr)
            return 1
        if self.save is not None:
            write_new(self.save, to_yaml(with_changes(base, best.changes)))
            print(f"cipv: {self.save}: the set of run {best.run}", file=sys.stderr)
        return 0

    def _proposer(self, base: Params) -> tuple[Proposer, int]:
        """What to try, and how many sets. Every error is raised here, before the work."""
        from app.fleet.sweep import MOST_POINTS, fixed, grid, latin, parse_axis, searching

        if not self.addresses:
            raise BadInput("no recording to sweep over; give at least one")
        if not self.over:
            raise BadInput("--over NAME=VALUES: give at least one parameter")
        if self.latin is not None and self.search is not None:
            raise BadInput("--latin and --search: give one of them")
        self.cluster.check()
        current = flat(base)
        axes = [axis.of_type(current.get(axis.name)) for axis in map(parse_axis, self.over)]
        for option_name, number in (("--latin", self.latin), ("--search", self.search)):
            if number is not None and not 1 <= number <= MOST_POINTS:
                raise BadInput(f"{option_name} {number}: expected 1 to {MOST_POINTS}")
        for axis in axes:
            for value in axis.values:
                with_changes(base, {axis.name: value})
        if self.search is not None:
            return searching(axes, self.search), self.search
        sets = latin(axes, self.latin) if self.latin is not None else grid(axes)
        for each in sets:
            with_changes(base, each)
        return fixed(sets), len(sets)

    def _run(self, plan: Plan, propose: Proposer, count: int, store: Store) -> tuple[list[Tried], tuple[str, str]]:
        """Every set with its two scores, and the names of these. The plan of a batch in the folder stays as it is."""
        from app.fleet.batch.plan import note_run, work_of
        from app.fleet.compare.worth import values_of
        from app.fleet.find import FleetTables
        from app.fleet.pack import pack

        runs: list[tuple[str, Mapping[str, Any]]] = []
        values: dict[str, dict[str, float | None]] = {}
        tried, names = _judged(runs, values)
        drives = len(work_of(plan, store).all)
        with store.alone(), self.cluster.client(drives) as client:
            while (changes := propose(tried)) is not None:
                this = replace(plan, params=with_changes(plan.params, changes))
                work = work_of(this, store)
                note_run(this, work, store)
                tally = tally_of(work)
                if work.jobs:
                    run_with_bar(client, work, tally, f"set {len(runs) + 1} of {count}")
                for address, reason in (tally.failed if runs else tally.aside | tally.failed).items():
                    print(f"cipv: skipped: {one_line(f'{address}: {reason}')}", file=sys.stderr)
                pack(store, work.key.name)
                runs.append((work.key.name, changes))
                values[work.key.name] = values_of(FleetTables(store, work.key.name).scores())
                tried, names = _judged(runs, values)
        return tried, names

    def _tell(self, tried: list[Tried], best: list[Tried], one: Tried | None, names: tuple[str, str]) -> None:
        from app.fleet.sweep import points_of
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
        on_front = points_of(best)
        chart = Chart(
            "Each point is a set of parameters; the line is the Pareto front",
            names[1],
            names[0],
            (
                Series.of_points("sets", points_of(tried)),
                Series("front", tuple(x for x, _ in on_front), tuple(y for _, y in on_front)),
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


def _judged(
    runs: Sequence[tuple[str, Mapping[str, Any]]], values: Mapping[str, Mapping[str, float | None]]
) -> tuple[list[Tried], tuple[str, str]]:
    """Every set with its two scores, and the names of these. runs: name and set. values: by run and score."""
    from app.fleet.sweep import Tried

    missed, phantoms = (
        next((name for name in pair if any(found.get(name) is not None for found in values.values())), pair[-1])
        for pair in (_MISSED, _PHANTOMS)
    )
    tried = [Tried(run, changes, values[run].get(missed), values[run].get(phantoms)) for run, changes in runs]
    return tried, (missed, phantoms)
