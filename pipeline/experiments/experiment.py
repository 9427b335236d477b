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
    """As a file name."""
    title: str
    """For people."""
    text: tuple[str, ...]
    """What happened in it, as paragraphs."""
    scenario: Scenario
    """With the ego vehicle as it drove, or with its script."""
    params: Params
    """That it was driven with."""
    sensors: Sensors
    """That the pipeline was given."""
    charts: tuple[Chart, ...]
    """Of the drive, with time along x."""
    detections: Detections | None = GIVEN
    """Its detections; None: those of the embedded network."""

    def as_seen(self) -> Scenario:
        """The scenario with the detections of that drive, so that a run reproduces its results."""
        return self.scenario.model_copy(update={"sensors": self.sensors, "detections": self.detections})


Case = TypeVar("Case")
Outcome = TypeVar("Outcome")


@dataclass(frozen=True)
class Experiment(Generic[Case, Outcome]):
    """Cases to drive, and how their outcomes are reported."""

    name: str
    """For scripts, and in the names of its drives."""
    suite: Suite
    """Which set of experiments it belongs to."""
    title: str
    """For people."""
    cases: Callable[[bool], Sequence[Case]]
    """The cases, or fewer when called with True. They can be pickled."""
    run: Callable[[Case], Outcome]
    """Case to outcome: a pure function at module level."""
    report: Callable[[Sequence[Case], Sequence[Outcome]], ReportSection]
    """All cases and outcomes, in order, to a section of the report."""
    as_drive: Callable[[Case, Outcome], ExperimentDrive | None]
    """The drive behind an outcome; None for one that is not worth keeping."""
