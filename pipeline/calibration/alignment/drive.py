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
"""Frames that are looked at, over the whole drive: a second of two slow cores for ten of them."""


def fit_drive(
    frame_of: Callable[[int], Frame],
    count: int,
    name: ModelName,
    params: Params,
    offset: bool = False,
    progress: Progress = silent,
) -> AlignmentFit:
    """The alignment of a drive of ``count`` frames. An exception of ``progress`` ends it.

    frame_of: a frame by its index, with what a detector saw in its image. offset: fit the camera's place too.
    NothingToFit where too little is seen.
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
