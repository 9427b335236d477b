"""Writes the images of a fit of the alignment as PNG files."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from pipeline.calibration.alignment.fit import AlignmentFit
from pipeline.calibration.alignment.residual_image import FRAMES, residual_image
from pipeline.common.errors import BadInput
from pipeline.params import Params
from pipeline.types import Frame


def write_residual_images(
    folder: Path, frame_of: Callable[[int], Frame], count: int, fit: AlignmentFit, params: Params
) -> None:
    """One file for each of ``FRAMES`` frames over the drive in which vehicles are paired, named after the frame.
    frame_of: returns a frame by its index, with its detections. BadInput if the folder cannot be written."""
    written = 0
    for index in np.unique(np.linspace(0, count - 1, min(count, FRAMES)).round().astype(int)).tolist():
        frame = frame_of(index)
        drawn = residual_image(frame, fit, params)
        if drawn is None:
            continue
        path = folder / f"{frame.name}.png"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            path.write_bytes(cv2.imencode(".png", drawn)[1].tobytes())
        except OSError as error:
            raise BadInput(f"--images: {path}: {error.strerror}") from None
        written += 1
    print(f"cipv: {written} images in {folder}", file=sys.stderr)
