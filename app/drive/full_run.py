"""One run over a whole drive with one set of parameters, identical to ``cipv run``.

Frames are processed in order, with continuous state from frame 0. The state before every k-th frame is stored, so any
frame can be computed again exactly, with a few steps from the nearest stored state.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from typing import NamedTuple

from app.drive.frame_rows import Objects, Row, objects_of, row_of
from pipeline.evaluation.lead_verdict import LeadRule, judge
from pipeline.params import Params
from pipeline.step import State, step
from pipeline.types import CameraCalibration, Frame
from pipeline.types.source import TruthObject

_MOST_STATES = 4000
"""A state of a real drive adds about 25 KB to its neighbours: 100 MB at most."""
_THIN_STATES = 500
"""States kept of a run that is not shown."""


class KnownState(NamedTuple):
    """The pipeline's state before a frame of the whole-drive run."""

    at: int
    """Index of the frame."""
    state: State
    """The state before that frame."""


class DriveRun:
    """Written by one thread through ``add``; any thread may read entries below ``done``.

    number: its id. name: given by the user, empty without one. note: why it failed. seconds: time spent computing it.
    """

    def __init__(self, number: int, params: Params, preset: str, total: int) -> None:
        self.number, self.params, self.preset, self.total = number, params, preset, total
        self.name, self.kept, self.note, self.seconds = "", False, "", 0.0
        self._rows: list[Row] = []
        self._objects: list[Objects] = []
        self._every = max(1, -(-total // _MOST_STATES))
        self._states: dict[int, State] = {}
        self._head = KnownState(0, State())

    @property
    def done(self) -> int:
        """Frames 0 … done−1 are available."""
        return self._head.at

    @property
    def is_complete(self) -> bool:
        return self.done >= self.total

    def add(self, frame: Frame, truth: Sequence[TruthObject] | None, rule: LeadRule) -> None:
        """Run the next frame, which must be number ``done``. It already contains boxes and lanes."""
        index, before = self._head
        after, result = step(before, frame, self.params)
        judged = None if truth is None else judge(result, truth, rule)
        if index % self._every == 0:
            self._states[index] = before
        self._rows.append(row_of(frame, result, judged))
        self._objects.append(objects_of(result))
        self._head = KnownState(index + 1, after)

    def rows(self, first: int = 0) -> list[Row]:
        """The rows of frames first … done−1."""
        return self._rows[max(0, first) : self.done]

    def objects(self) -> list[tuple[int, Objects]]:
        """(index, records) of every available frame."""
        return list(enumerate(self._objects[: self.done]))

    def nearest_state(self, index: int) -> KnownState | None:
        """The last stored state at or before ``index``; None if the run has not got that far."""
        head, states = self._head, self._states
        if index >= head.at:
            return head if index == head.at else None
        at = next((kept for kept in range(index, -1, -1) if kept in states), None)
        return KnownState(at, states[at]) if at is not None else None

    def thin(self) -> None:
        """Keep fewer states: a run that is not shown needs them only if it is selected again."""
        while len(self._states) > _THIN_STATES:
            self._every *= 2
            self._states = {index: state for index, state in self._states.items() if index % self._every == 0}


def digest(uri: str, detectors: Sequence[str], sensors: str, params: Params) -> str:
    """Twelve characters that are equal if and only if the inputs of two runs are equal."""
    made_from = [uri, list(detectors), sensors, params.model_dump(mode="json")]
    return hashlib.sha256(json.dumps(made_from, sort_keys=True).encode()).hexdigest()[:12]


def calibration_digest(camera: CameraCalibration | None, params: Params) -> str:
    """Twelve characters that are equal if and only if images and points are aligned in the same way."""
    numbers = [] if camera is None else [camera.K, camera.distortion, camera.T_camera_ego]
    made_from = [[each.tolist() for each in numbers], params.alignment.model_dump(mode="json")]
    return hashlib.sha256(json.dumps(made_from, sort_keys=True).encode()).hexdigest()[:12]
