"""An experiment: its cases, how one is run, how the outcomes are reported, and the drive behind each outcome."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, Literal, TypeVar

from pipeline.evaluation.report_sections import Chart, Section
from pipeline.experiments.perception import GIVEN
from pipeline.params import Params
from pipeline.run import Sensors
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.sensors.detection_model import Detections

Suite = Literal["paper", "curves", "euroncap", "iso"]


@dataclass(frozen=True)
class ExperimentDrive:
    """A drive that can be seen again. name: fit for a file. scenario: with the ego vehicle as driven, or its script.
    text: what came of it. detections: what was seen in its pictures; None: what the embedded network saw there."""

    name: str
    title: str
    text: tuple[str, ...]
    scenario: Scenario
    params: Params
    sensors: Sensors
    charts: tuple[Chart, ...]
    detections: Detections | None = GIVEN

    def as_seen(self) -> Scenario:
        """The scenario with the detections of that drive, so that a run gives the same results."""
        return self.scenario.model_copy(update={"sensors": self.sensors, "detections": self.detections})


Case = TypeVar("Case")
Outcome = TypeVar("Outcome")


@dataclass(frozen=True)
class Experiment(Generic[Case, Outcome]):
    """cases: what is to be driven, in short or in full; each can be sent to another process. run: one case to its
    outcome, a pure function at a module's top level. report: all of them, in order, to a section. as_drive: the drive
    behind an outcome."""

    name: str
    suite: Suite
    title: str
    cases: Callable[[bool], Sequence[Case]]
    run: Callable[[Case], Outcome]
    report: Callable[[Sequence[Case], Sequence[Outcome]], Section]
    as_drive: Callable[[Case, Outcome], ExperimentDrive]
