"""/api/alignment: how well LiDAR and images lie on each other with the present parameters."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Mapping

import numpy as np
from fastapi import APIRouter, HTTPException
from pydantic import BaseModel

from app.drive.open_recording import OpenRecording
from app.engine.engine import Engine
from app.engine.snapshot import Snapshot
from pipeline.calibration.depth_edges import edge_scene
from pipeline.calibration.edge_match import FEWEST, REACH_DEG, EdgeScore, Seen, edge_score
from pipeline.types import Frame

FRAMES = 20
"""Frames that are looked at, over the whole drive or the last shown ones: one sweep of 16 rings has few borders."""
_NOTHING = "No frame has both an image and LiDAR points in it"
APART_NS = 500_000_000
"""Of live sensors, frames nearer to each other than this show the same once more."""


class Score(BaseModel):
    """score: 1 when nothing near is better, 0 when the usual mount near is as good; null where nothing can be said.
    better: changes of alignment parameters towards the best near; a factor for h_res_deg and v_res_deg. sigmas: how far
    the best near stands out. text: all of it in a sentence; brief: in a word or two."""

    score: float | None
    sigmas: float | None
    borders: int
    better: dict[str, float]
    brief: str
    text: str


def alignment_router(engine: Engine) -> APIRouter:
    """The score's route; what it looks at is found once a recording."""
    router = APIRouter(prefix="/api/alignment", tags=["alignment"])
    scenes = _Scenes()

    @router.get("/score")
    def score() -> Score:
        """Score the alignment of LiDAR and camera. Compares how well depth borders match image edges with the same
        for the mount rotated by up to 3°. Uses frames of the whole recording, which takes a second the first time; for
        live sensors, the frames shown at each request. 404 when nothing is shown."""
        recording, shown = engine.drives.recording, engine.snapshot
        seen = scenes.of_shown(shown) if recording is None else scenes.of_recording(recording)
        return _json(edge_score(seen, engine.control.peek().params.alignment), len(seen))

    return router


class _Scenes:
    """The looked-at frames of what was asked about last."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._of: OpenRecording | str | None = None
        self._newest_ns = 0
        self._seen: deque[Seen] = deque(maxlen=FRAMES)

    def of_recording(self, recording: OpenRecording) -> list[Seen]:
        with self._lock:
            if self._of is not recording:
                self._begin(recording)
                for index in np.unique(np.linspace(0, recording.setup.total - 1, FRAMES).round().astype(int)).tolist():
                    self._look(recording.as_read(index))
            return list(self._seen)

    def of_shown(self, shown: Snapshot) -> list[Seen]:
        """404 when nothing is."""
        if shown.processed is None or shown.uri is None:
            raise HTTPException(404, "nothing is shown yet")
        frame = shown.processed.frame
        with self._lock:
            if self._of != shown.uri:
                self._begin(shown.uri)
            if not self._seen or abs(frame.t_ns - self._newest_ns) >= APART_NS:
                self._look(frame)
            return list(self._seen)

    def _begin(self, of: OpenRecording | str) -> None:
        self._of = of
        self._seen.clear()

    def _look(self, frame: Frame) -> None:
        if frame.sweep is not None and frame.picture is not None:
            self._newest_ns = frame.t_ns
            self._seen.append((edge_scene(frame.sweep, frame.picture.bgr), frame.camera))


def _json(found: EdgeScore, frames: int) -> Score:
    """frames: how many were looked at."""
    if not frames:
        return Score(score=None, sigmas=None, borders=0, better={}, brief="nothing to match", text=_NOTHING)
    return Score(
        score=found.score,
        sigmas=found.sigmas,
        borders=found.borders,
        better=dict(found.better),
        brief=_brief(found),
        text=f"{_sentence(found)} ({found.borders} borders in {frames} frame{'' if frames == 1 else 's'})",
    )


def _brief(found: EdgeScore) -> str:
    if found.borders < FEWEST:
        return "too few borders"
    if found.score is None:
        return "no clear best"
    return f"{100 * found.score:.0f} %" + (f" · better {_words(found.better)}" if found.better else "")


def _sentence(found: EdgeScore) -> str:
    if found.borders < FEWEST:
        return "Too few LiDAR depth borders in the images for a score"
    if found.score is None:
        return f"No mount rotation within {REACH_DEG:.0f}° matches the image edges clearly best; no score"
    if found.better:
        return f"LiDAR depth borders match the image edges better with {_words(found.better)}"
    return f"No mount rotation within {REACH_DEG:.0f}° matches the image edges clearly better than the current one"


def _words(better: Mapping[str, float]) -> str:
    """As a person would change the parameters."""
    units = {"deg": "°", "px": " px"}
    if "h_res_deg" in better:
        return f"h_res and v_res × {better['h_res_deg']:g}"
    parts = [(name.rpartition("_"), by) for name, by in better.items()]
    return ", ".join(f"{name} {by:+g}{units[unit]}" for (name, _, unit), by in parts)
