"""Fits the alignment to a drive: selects frames and collects boxes, clusters and edges."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.calibration.alignment.edges import EdgeView, frames_kept
from pipeline.calibration.alignment.fit import STEPS, AlignmentFit, fit_alignment
from pipeline.calibration.alignment.models import ModelName
from pipeline.calibration.alignment.scenes import FitScene, fit_scene
from pipeline.calibration.depth_edges import edge_scene
from pipeline.common.ahead import ahead
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

    frame_of: returns a frame by its index, with its detections; called from a thread of its own. offset: also fit the
    camera's position. NothingToFit if too little is visible.
    """
    indices = np.unique(np.linspace(0, count - 1, min(count, FRAMES)).round().astype(int)).tolist()
    total = len(indices) + STEPS
    scenes: list[FitScene] = []
    edges: list[EdgeView] = []
    kept: set[int] | None = None
    # Reading, or rendering, and detection take longer than all else.
    for number, frame in enumerate(ahead(frame_of, indices)):
        progress(number, total)
        scene = fit_scene(frame, params)
        if scene is None:
            continue
        scenes.append(scene)
        kept = set(frames_kept(len(indices), scene.size).tolist()) if kept is None else kept
        if name == "pinhole" and number in kept and frame.sweep is not None and frame.image is not None:
            edges.append(EdgeView(edge_scene(frame.sweep, frame.image.bgr), frame.t_ns))
    looked = len(indices)

    def told(done: int, _: int) -> None:
        progress(looked + done, total)

    found = fit_alignment(scenes, name, params.alignment, offset, told, edges)
    progress(total, total)
    return found
