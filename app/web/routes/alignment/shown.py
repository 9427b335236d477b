"""The shown frame as the routes of the alignment use it."""

from __future__ import annotations

from fastapi import HTTPException

from app.engine.engine import Engine
from pipeline.types import Frame


def shown_frame(engine: Engine) -> tuple[Frame, tuple[int, int]]:
    """The shown frame, and width and height of its images; 404 without images or calibration."""
    processed = engine.snapshot.processed
    frame = processed.frame if processed is not None else None
    size = None
    if frame is not None:
        size = (frame.camera.width, frame.camera.height) if frame.camera is not None else frame.image_size
    if frame is None or size is None:
        raise HTTPException(404, "nothing with a camera is shown")
    return frame, size
