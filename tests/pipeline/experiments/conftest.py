"""A drive kept by an experiment, opened again."""

from __future__ import annotations

from collections.abc import Callable
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from pipeline.detection import Detectors
from pipeline.experiments.experiment import ExperimentDrive
from pipeline.run import run
from pipeline.simulation.drive_as_scenario import to_yaml
from pipeline.simulation.sensors.camera import HEIGHT, WIDTH, DrawnCamera
from pipeline.sources import open_source
from pipeline.types import Result

SeeAgain = Callable[[ExperimentDrive, int], list[Result]]


@pytest.fixture
def see_again(tmp_path: Path) -> SeeAgain:
    """The pipeline's results in the first frames of a saved drive with given detections, opened as a file. Its images
    stay empty: nothing looks at them, and drawing them takes three times as long as the rest."""

    def believed(driven: ExperimentDrive, frames: int) -> list[Result]:
        file = tmp_path / f"{driven.name}.yaml"
        file.write_text(to_yaml(driven.as_seen()), encoding="utf-8")
        drive = run(open_source(f"sim:{file}"), driven.params, Detectors())
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(DrawnCamera, "image", lambda *_: np.zeros((HEIGHT, WIDTH, 3), np.uint8))
            seen = list(islice(drive, frames))
        assert all(frame.detections_given for frame, _ in seen)
        return [result for _, result in seen]

    return believed
