"""A drive kept by an experiment, opened again."""

from __future__ import annotations

from collections.abc import Callable
from itertools import islice
from pathlib import Path

import pytest

from pipeline.detection import Detectors
from pipeline.experiments.experiment import ExperimentDrive
from pipeline.run import run
from pipeline.simulation.drive_as_scenario import to_yaml
from pipeline.sources import open_source
from pipeline.types import Result

SeeAgain = Callable[[ExperimentDrive, int], list[Result]]


@pytest.fixture
def see_again(tmp_path: Path) -> SeeAgain:
    """The pipeline's results in the first frames of a saved drive with given detections, opened as a file."""

    def believed(driven: ExperimentDrive, frames: int) -> list[Result]:
        file = tmp_path / f"{driven.name}.yaml"
        file.write_text(to_yaml(driven.as_seen()), encoding="utf-8")
        drive = run(open_source(f"sim:{file}"), driven.params, Detectors())
        return [result for _, result in islice(drive, frames)]

    return believed
