"""Defines an experiment: its cases, how to run one, how to report the outcomes, and the drive behind each outcome."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, Literal, TypeVar

from pipeline.evaluation.report_sections import Chart, ReportSection
from pipeline.experiments.perception import GIVEN
from pipeline.params import Params
from pipeline.run import Sensors
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.sensors.detection_model import Detections

Suite = Literal["paper", "curves", "streets", "euroncap", "iso", "robustness"]


@dataclass(frozen=True)
class ExperimentDrive:
    """The drive behind an outcome, which can be opened again as a scenario."""

    name: str
    """Name for use in file names."""
    title: str
    """Title in reports."""
    text: tuple[str, ...]
    """Description of what happened, as paragraphs."""
    scenario: Scenario
    """The scenario, with the ego vehicle's motion as driven or as scripted."""
    params: Params
    """Parameters of the drive."""
    sensors: Sensors
    """Sensors that the pipeline got."""
    charts: tuple[Chart, ...]
    """Charts of the drive over time."""
    detections: Detections | None = GIVEN
    """Its detections; None for those of the embedded network."""

    def as_seen(self) -> Scenario:
        """The scenario with the detections of that drive, so that a run reproduces its results."""
        return self.scenario.model_copy(update={"sensors": self.sensors, "detections": self.detections})


Case = TypeVar("Case")
Outcome = TypeVar("Outcome")


@dataclass(frozen=True)
class Experiment(Generic[Case, Outcome]):
    """Cases to drive, and how their outcomes are reported."""

    name: str
    """Name on the command line and in the names of its drives."""
    suite: Suite
    """Which set of experiments it belongs to."""
    title: str
    """Title in reports."""
    cases: Callable[[bool], Sequence[Case]]
    """Returns the cases; with True, a short selection. Cases can be pickled."""
    run: Callable[[Case], Outcome]
    """Runs one case; a pure function at module level."""
    report: Callable[[Sequence[Case], Sequence[Outcome]], ReportSection]
    """Turns all cases and outcomes, in order, into a section of the report."""
    as_drive: Callable[[Case, Outcome], ExperimentDrive | None]
    """Returns the drive behind an outcome; None if it is not worth keeping."""
