"""Fits the alignment to a drive: selects frames and collects boxes and clusters."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.calibration.alignment.fit import STEPS, AlignmentFit, fit_alignment
from pipeline.calibration.alignment.models import ModelName
from pipeline.calibration.alignment.scenes import FitScene, fit_scene
from pipeline.common.progress import Progress, silent
from pipeline.params import Params
from pipeline.types import Frame

FRAMES = 120
"""Number of evaluated frames, over the whole drive: ten of them take a second on two slow cores."""


def fit_drive(
    frame_of: Callable[[int], Frame],
    count: int,
    name: ModelName,
    params: Params,
    offset: bool = False,
    progress: Progress = silent,
) -> AlignmentFit:
    """The alignment of a drive of ``count`` frames. An exception of ``progress`` ends it.

    frame_of: returns a frame by its index, with its detections. offset: also fit the camera's position. NothingToFit if
    too little is visible.
    """
    indices = np.unique(np.linspace(0, count - 1, min(count, FRAMES)).round().astype(int)).tolist()
    total = len(indices) + STEPS
    scenes: list[FitScene] = []
    for number, index in enumerate(indices):
        progress(number, total)
        scene = fit_scene(frame_of(index), params)
        if scene is not None:
            scenes.append(scene)
    looked = len(indices)
    found = fit_alignment(scenes, name, params.alignment, offset, lambda done, _: progress(looked + done, total))
    progress(total, total)
    return found
