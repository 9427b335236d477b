"""/api/alignment: how well LiDAR and pictures lie on each other with the present parameters."""

from __future__ import annotations

import threading

import numpy as np
from fastapi import APIRouter
from pydantic import BaseModel

from app.drive.recording import Recording
from app.engine import Engine
from app.routes.refusals import open_recording
from pipeline.alignment import resolve
from pipeline.calibration.edges import EdgeScene, EdgeScore, edge_scene, edge_score
from pipeline.params import AlignmentParams
from pipeline.types import CameraCalibration

FRAMES = 12
"""Frames over the whole drive that are looked at: one sweep of 16 rings has few borders."""


class Score(BaseModel):
    """score: 1 when every border in the sweeps lies on an edge of its picture, 0 when no more than by chance; null
    where there are too few. median_px: from a border to the nearest edge."""

    score: float | None
    median_px: float | None
    pairs: int
    text: str


def alignment_router(engine: Engine) -> APIRouter:
    """The score's route; what it looks at is found once a recording."""
    router = APIRouter(prefix="/api/alignment", tags=["alignment"])
    scenes = _Scenes()

    @router.get("/score")
    def score() -> Score:
        """How well the borders of what the LiDAR sees lie on the edges of the pictures. Greater is better; compare
        it with itself, not over recordings. The first call takes a second or two."""
        return _json(scenes.score(open_recording(engine.drives), engine.control.peek().params.alignment))

    return router


class _Scenes:
    """The looked-at frames of the recording that was asked about last."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._of: Recording | None = None
        self._scenes: list[tuple[EdgeScene, CameraCalibration | None]] = []

    def score(self, recording: Recording, params: AlignmentParams) -> EdgeScore:
        with self._lock:
            if self._of is not recording:
                self._of, self._scenes = recording, list(_look(recording))
            resolved = [(scene, resolve(params, camera)) for scene, camera in self._scenes]
        return edge_score((scene, aligned) for scene, aligned in resolved if aligned is not None)


def _look(recording: Recording) -> list[tuple[EdgeScene, CameraCalibration | None]]:
    found = []
    for index in np.unique(np.linspace(0, recording.recipe.total - 1, FRAMES).round().astype(int)).tolist():
        frame = recording.as_read(index)
        if frame.sweep is not None and frame.picture is not None:
            found.append((edge_scene(frame.sweep, frame.picture.bgr), frame.camera))
    return found


def _json(found: EdgeScore) -> Score:
    if found.score is None:
        text = f"only {found.pairs} borders of the LiDAR lie in the pictures: too few to say"
    else:
        text = f"{found.pairs} borders, {found.median_px:.0f} px in the middle from the nearest edge"
    return Score(score=found.score, median_px=found.median_px, pairs=found.pairs, text=text)
