"""`cipv evaluate`: score the pipeline against labels."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Literal
from urllib.parse import quote, urlsplit

import tyro

from app.commands.support.arguments import option
from app.commands.support.options import PipelineOptions, SourceOptions
from app.commands.support.progress_bars import frames_progress
from app.labels.project_classes import project_classes
from app.reports.html import html
from app.reports.terminal_tables import show
from pipeline.common.errors import BadInput
from pipeline.common.files.output_files import ensure_writable
from pipeline.common.files.user_file_errors import given_path
from pipeline.detection import Detectors
from pipeline.evaluation.lead_verdict import LeadRule
from pipeline.evaluation.scores.drive import DriveScore, Rules, score_drive
from pipeline.evaluation.scores.report import as_json, sections
from pipeline.evaluation.scores.results_file import EMPTY, read_results
from pipeline.evaluation.scores.truth import DriveTruth, NoTruth, of_labels, of_source
from pipeline.labels.classes import ClassList, as_bases, read_classes
from pipeline.labels.formats import native
from pipeline.labels.formats.reading import read_bytes
from pipeline.params import Params, from_yaml, preset
from pipeline.run import Sensors, sensed
from pipeline.sources.driven_way import DrivenWay
from pipeline.step import State, step
from pipeline.types import Result
from pipeline.types.source import Source
from pipeline.warm_up import warm_up

DASHBOARD = "http://127.0.0.1:8420"
"""The address on which `cipv serve` listens by default."""
_PRESETS = ("default", "paper")


@dataclass(frozen=True)
class Evaluate:
    """Score the pipeline's results on recordings against labels: lead, distances, tracking, warnings.

    Example: cipv evaluate astyx:PATH --set cluster.z_weight=0.4 --against default --report scores.html
    """

    sources: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="SOURCE")]
    """Labelled recordings; with two or more, figures get confidence intervals"""
    truth: Annotated[tuple[str, ...], tyro.conf.arg(metavar="FILE")] = ("native",)
    """native: the labels that come with a recording; or one file of labels (cipv-labels JSON) per recording"""
    classes: Annotated[Path | None, option("FILE")] = None
    """A class list (YAML), by which sub-classes in the labels are scored as their parents; default: the one that
    `cipv labels classes` lists"""
    pipeline: PipelineOptions = field(default_factory=PipelineOptions)
    sensors: Literal["lidar", "camera", "both"] = "both"
    """Ablation: run as if the car had this sensor only"""
    rings: int = 16
    """KITTI: LiDAR channels to keep: 16, like a VLP-16, or 64 for all"""
    results: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="FILE")] = ()
    """Score these results of `cipv run --out`, one file per recording, instead of running the pipeline"""
    against: Annotated[tuple[str, ...], tyro.conf.arg(metavar="FILE|PRESET")] = ()
    """Compare with another run: results of `cipv run --out`, one per recording, or a preset by name or file (YAML)"""
    max_range_m: float = 60.0
    """Leads beyond this distance are ignored"""
    report: Annotated[Path | None, option("FILE")] = None
    """Write an HTML file with tables, charts and links to the worst frames; an existing file is replaced"""
    dashboard: Annotated[str, tyro.conf.arg(metavar="URL")] = DASHBOARD
    """Dashboard address for the report's links, as `cipv serve` prints it"""
    json: bool = False
    """Print the figures as JSON"""

    def __call__(self) -> int:
        self._check()
        params = self.pipeline.parameters()
        base = self._base_params()
        if self.report is not None:
            ensure_writable(self.report)
        run_scores, base_scores = [], []
        for n in range(len(self.sources)):
            scores = self._score(n, params, base)
            run_scores.append(scores[0])
            base_scores += scores[1:]
        self._tell(run_scores, base_scores or None)
        return 0

    def _check(self) -> None:
        count = len(self.sources)
        if not count:
            raise BadInput("no recording to evaluate; give at least one")
        if self.truth != ("native",) and len(self.truth) != count:
            raise BadInput(f"--truth: {len(self.truth)} files for {count} recordings; give one for each")
        if self.results and len(self.results) != count:
            raise BadInput(f"--results: {len(self.results)} files for {count} recordings; give one for each")
        if self.against and self._base_preset() is None and len(self.against) != count:
            raise BadInput(f"--against: {len(self.against)} files for {count} recordings; give one for each")
        if urlsplit(self.dashboard).scheme not in ("http", "https") or not urlsplit(self.dashboard).netloc:
            raise BadInput(f"--dashboard {self.dashboard}: not a valid address; expected e.g. {DASHBOARD}")
        if not 0.0 < self.max_range_m < 1000.0:
            raise BadInput(f"--max-range-m {self.max_range_m:g}: expected metres, more than 0 and less than 1000")
        if self.classes is not None:
            read_classes(given_path(self.classes))  # report a bad file before the work, also if no label needs it

    def _base_preset(self) -> str | None:
        """The preset named by --against; None if it names a file of results."""
        one = self.against[0] if len(self.against) == 1 else ""
        return one if one in _PRESETS or one.endswith((".yaml", ".yml")) else None

    def _base_params(self) -> Params | None:
        name = self._base_preset()
        if name is None:
            return None
        return preset(name) if name in _PRESETS else from_yaml(Path(name), preset("default"))

    def _score(self, n: int, params: Params, base: Params | None) -> list[DriveScore]:
        """The score of one recording, followed by that of the base run if there is one."""
        source = SourceOptions(self.sources[n], self.rings).open()
        rules = Rules(LeadRule(max_range_m=self.max_range_m), params.aeb)
        truth = self._truth(n, source, rules)
        given = [read_results(self.results[n])] if self.results else []
        wanted = [*([] if given else [params]), *([base] if base is not None else [])]
        runs = [*given, *self._run(source, wanted)]
        if self.against and base is None:
            runs.append(read_results(Path(self.against[n])))
        return [score_drive(results, truth, rules) for results in runs]

    def _truth(self, n: int, source: Source, rules: Rules) -> DriveTruth:
        if self.truth == ("native",) or self.truth[n] == "native":
            return of_source(source, rules.lead)
        file = Path(self.truth[n])
        known = native.from_json(read_bytes(file), str(file))
        truth = of_labels(as_bases(known, self._classes()), rules.lead, lambda: DrivenWay.of(source))
        ticks = tuple(source.t_ns(index) for index in range(len(source)))
        frames = {tick: frame for tick, frame in truth.frames.items() if tick in set(ticks)}
        if not frames:
            raise NoTruth(f"{file}: labels of another recording ({truth.uri}): no frame in common")
        return replace(truth, uri=source.uri, ticks=ticks, frames=frames)

    def _classes(self) -> ClassList:
        return read_classes(given_path(self.classes)) if self.classes is not None else project_classes()

    def _run(self, source: Source, wanted: list[Params]) -> list[list[Result]]:
        """Run the pipeline with each set of parameters. The networks run once per image."""
        if not wanted:
            return []
        detectors = self.pipeline.open_detectors(source, self.sensors)
        with frames_progress() as progress:
            bar = progress.add_task(source.title, total=len(source))
            ran = list(_lines(source, wanted, detectors, self.sensors, lambda: progress.advance(bar)))
        return [list(results) for results in zip(*ran, strict=True)]

    def _tell(self, run: list[DriveScore], base: list[DriveScore] | None) -> None:
        if self.json:
            print(json.dumps(as_json(run, base), indent=1, ensure_ascii=False))
        if self.json and self.report is None:
            return
        told = sections(run, partial(dashboard_link, self.dashboard), base)
        if self.report is not None:
            title = "Scores: " + ", ".join(drive.uri for drive in run)
            self.report.write_text(html(told, title), encoding="utf-8")
            print(f"cipv: report written to {self.report}", file=sys.stderr)
        if not self.json:
            show(told)


def _lines(
    source: Source, wanted: list[Params], detectors: Detectors, sensors: Sensors, done: Callable[[], None]
) -> Iterator[list[Result]]:
    """Each frame's results, one per set of parameters, without their layers."""
    warm_up()
    states = [State() for _ in wanted]
    for index in range(len(source)):
        frame = sensed(source.frame(index), detectors, sensors)
        row = []
        for n, params in enumerate(wanted):
            states[n], result = step(states[n], frame, params)
            row.append(replace(result, layers=EMPTY))
        yield row
        done()


def dashboard_link(dashboard: str, uri: str, index: int) -> str:
    """The URL that opens a dashboard at a frame."""
    return f"{dashboard.rstrip('/')}/#uri={quote(uri, safe='')}&frame={index}"
