"""`cipv scenarios run`: run the experiments of the paper, Euro NCAP and ISO 15622 in the simulator."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from app.commands.support.arguments import option
from app.commands.support.progress_bars import frames_progress
from app.reports.experiment_drives import ReplayFolder
from app.reports.html import html
from app.reports.terminal_tables import show
from pipeline.common.errors import BadInput
from pipeline.common.files.output_files import ensure_writable
from pipeline.evaluation.report_sections import as_json
from pipeline.experiments.experiment import Experiment
from pipeline.experiments.robustness.experiment import suite as robustness
from pipeline.experiments.runner import count_cases, of_suite, run_all

ROBUSTNESS = "robustness"
_FAILED_DRIVES = Path("robustness-failures")
"""Default folder for drives with a failure."""
_MOST_KM = 1_000_000


@dataclass(frozen=True)
class Scenarios:
    """Run experiments in the closed-loop simulator and report their figures next to the published ones. Exits with 1
    when a required figure is missed.

    Example: cipv scenarios run --suite euroncap --report ncap.html --drives ncap-drives
    """

    what: tyro.conf.Positional[Literal["run"]]
    """Run the experiments"""
    suite: Annotated[str, tyro.conf.arg(metavar="NAME")] = "paper"
    """paper, curves, streets, euroncap, iso, all, robustness, or the name of one experiment"""
    short: bool = False
    """Run only a few cases of each: seconds instead of minutes"""
    jobs: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Number of processes; 0 for one per core"""
    km: Annotated[int | None, option("KM")] = None
    """robustness: kilometres of random traffic; default: 100"""
    seed: Annotated[int | None, option("N")] = None
    """robustness: seed of the random traffic; default: 0"""
    ablation: bool = False
    """robustness: repeat with each rule against false leads switched off in turn"""
    report: Annotated[Path | None, option("FILE")] = None
    """Write an HTML file with tables and charts; an existing file is replaced"""
    drives: Annotated[Path | None, option("DIR")] = None
    """Save every drive to this folder, listed in its index.html and linked from the report; open one as sim:<file>.
    robustness: only drives with a failure; default: robustness-failures"""
    json: bool = False
    """Print the figures as JSON"""

    def __call__(self) -> int:
        experiments = self._experiments()
        if self.jobs < 0:
            raise BadInput(f"--jobs {self.jobs}: expected a number of processes, or 0 for one per core")
        if self.report is not None:
            ensure_writable(self.report)
        drives = self.drives or (_FAILED_DRIVES if self.suite == ROBUSTNESS else None)
        folder = ReplayFolder(drives) if drives is not None else None
        with frames_progress() as progress:
            bar = progress.add_task("driving", total=count_cases(experiments, self.short))
            sections = run_all(
                experiments, self.short, self.jobs, lambda: progress.advance(bar), folder.keep if folder else None
            )
        if folder is not None:
            print(folder.list_all(), file=sys.stderr)
        if self.report is not None:
            link = folder.link_from(self.report) if folder else ""
            self.report.write_text(html(sections, f"Experiments: {self.suite}", link), encoding="utf-8")
        if self.json:
            print(json.dumps([as_json(section) for section in sections], indent=1, ensure_ascii=False))
        else:
            show(sections)
        failures = [failure for section in sections for failure in section.failures]
        for failure in failures:
            print(f"FAILED: {failure}", file=sys.stderr)
        return 1 if failures else 0

    def _experiments(self) -> tuple[Experiment[Any, Any], ...]:
        if self.suite != ROBUSTNESS:
            if self.km is not None or self.seed is not None or self.ablation:
                raise BadInput(f"--km, --seed and --ablation are for --suite {ROBUSTNESS}")
            return of_suite(self.suite)
        km, seed = 100 if self.km is None else self.km, self.seed or 0
        if not 0 < km <= _MOST_KM or seed < 0:
            raise BadInput(f"--km {km} --seed {seed}: expected 1 to {_MOST_KM} km and a seed of 0 or more")
        return (robustness(km, seed, self.ablation),)
