"""Runs experiments case by case on all cores. Outcomes are returned in the order of the cases, so the report does not
depend on timing."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from typing import Any

from pipeline.common.errors import BadInput
from pipeline.evaluation.report_sections import ReportSection
from pipeline.experiments.curves.experiment import CURVES
from pipeline.experiments.euro_ncap.experiment import NCAP
from pipeline.experiments.experiment import Experiment, ExperimentDrive
from pipeline.experiments.iso15622.experiment import ISO
from pipeline.experiments.paper.bev_error import BEV_ERROR
from pipeline.experiments.paper.braking import BRAKING
from pipeline.experiments.paper.cipv_choice import CHOOSING
from pipeline.experiments.paper.distance_regression import REGRESSION
from pipeline.experiments.paper.lidar_range import RANGING
from pipeline.experiments.streets.experiment import STREETS

EXPERIMENTS: tuple[Experiment[Any, Any], ...] = (
    RANGING,
    REGRESSION,
    BEV_ERROR,
    CHOOSING,
    CURVES,
    STREETS,
    BRAKING,
    NCAP,
    ISO,
)
Keep = Callable[[Experiment[Any, Any], ExperimentDrive], None]
SUITES = ("paper", "curves", "streets", "euroncap", "iso", "all")


class NoSuchSuite(BadInput):
    """Raised for a suite that does not exist."""


def of_suite(suite: str) -> tuple[Experiment[Any, Any], ...]:
    """The experiments of a suite, or the experiment of that name; NoSuchSuite if there is neither. The suite
    ``robustness`` depends on the number of kilometres: see ``robustness.experiment.suite``."""
    found = tuple(each for each in EXPERIMENTS if suite in ("all", each.suite, each.name))
    if not found:
        names = ", ".join(dict.fromkeys((*SUITES, "robustness", *(each.name for each in EXPERIMENTS))))
        raise NoSuchSuite(f"no suite or experiment named {suite!r}; there are {names}")
    return found


def count_cases(experiments: Iterable[Experiment[Any, Any]], short: bool) -> int:
    return sum(len(each.cases(short)) for each in experiments)


def run_all(
    experiments: Iterable[Experiment[Any, Any]],
    short: bool = False,
    jobs: int = 0,
    done: Callable[[], None] = lambda: None,
    keep: Keep | None = None,
) -> list[ReportSection]:
    """Run the experiments and return the report of each. jobs: number of processes; 0 for one per core, 1 for only this
    one. ``done`` is called after every case, ``keep`` with every drive."""
    jobs = jobs or os.cpu_count() or 1
    if jobs == 1:
        return [_reported(each, short, map(each.run, each.cases(short)), done, keep) for each in experiments]
    # spawn, since a forked child would inherit broken threads of numba and onnxruntime
    pool = ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn"))
    try:
        return [_reported(each, short, pool.map(each.run, each.cases(short)), done, keep) for each in experiments]
    finally:
        pool.shutdown(cancel_futures=True)  # after an interrupt, do not drive the remaining cases first


def _reported(
    experiment: Experiment[Any, Any],
    short: bool,
    outcomes: Iterable[Any],
    done: Callable[[], None],
    keep: Keep | None,
) -> ReportSection:
    """The report, made from outcomes that arrive one by one in the order of the cases."""
    cases, got = experiment.cases(short), []
    for case, outcome in zip(cases, outcomes, strict=True):
        got.append(outcome)
        if keep is not None:
            kept = experiment.as_drive(case, outcome)
            if kept is not None:
                keep(experiment, kept)
        done()
    return experiment.report(cases, got)
