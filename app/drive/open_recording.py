"""One open recording for whole-drive runs: its frames as inputs, its truth, its runs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np

from app.core.detection_cache import DetectionCache
from app.drive.frame_inputs import InputStore
from app.drive.full_run import DriveRun, KnownState, calibration_digest, digest
from app.drive.run_registry import RunRegistry
from pipeline.common.progress import Progress
from pipeline.common.watchdog import at_work
from pipeline.detection import Detectors, Look
from pipeline.evaluation.lead_verdict import LeadRule
from pipeline.params import Params
from pipeline.run import Sensors, sensed
from pipeline.sources.driven_way import DrivenWay
from pipeline.step import State, step
from pipeline.types import F64, I64, Frame
from pipeline.types.source import Mark, Marked, Source, TruthObject, is_simulated

if TYPE_CHECKING:
    from pipeline.labels.formats.base import LabeledDrive

RULE = LeadRule()
Truth = tuple[TruthObject, ...] | None


@dataclass(frozen=True, eq=False)
class RunSetup:
    """The common inputs of all runs of a recording."""

    source: Source
    """Also used to read the shown frames; safe on any thread."""
    timeline_s: F64
    """(total,) position of each frame on the playback timeline, in seconds."""
    detectors: Detectors
    """Detectors for vehicles and lanes; their names are part of a run's digest."""
    sensors: Sensors
    """The sensors whose data the pipeline may use."""

    @property
    def uri(self) -> str:
        return self.source.uri

    @property
    def total(self) -> int:
        return len(self.timeline_s)

    @property
    def simulated(self) -> bool:
        """Whether the truth comes from the simulator."""
        return is_simulated(self.source)


class OpenRecording:
    """An open recording. Its source may be read at the same time for the shown frame."""

    def __init__(self, setup: RunSetup, detections: DetectionCache, next_number: int) -> None:
        self.setup = setup
        self.runs = RunRegistry(
            lambda number, params, preset: DriveRun(number, params, preset, setup.total), next_number
        )
        self.inputs = InputStore()
        self._ask = detections.look_at(setup.uri)
        self._truths: dict[int, Truth] = {}
        self.describing = Lock()
        self.described: LabeledDrive | None = None
        """Description of the drive for label files, once requested; ``describing`` is locked while it is made."""

    @cached_property
    def way(self) -> DrivenWay:
        """The way that the car takes in it."""
        return DrivenWay.of(self.setup.source)

    def advance(self, run: DriveRun, frame: Frame | None = None) -> None:
        """Process the next frame of a run. frame: it as input of ``step``, if it is at hand. Raises whatever a source
        or a network raises."""
        index = run.done
        run.add(frame or self.input(index), self.truth(index), RULE)

    def state_before(self, index: int, params: Params) -> State | None:
        """The state before a frame in the run with these parameters; None if it has not got that far."""
        run = self.runs.of(params)
        kept = run.nearest_state(index) if run is not None else None
        return self._onwards(kept, index, params) if kept is not None else None

    def last_known_state(self, index: int, params: Params) -> KnownState:
        """The last known state at or before a frame; the initial state if there is no run."""
        run = self.runs.of(params)
        known = run.nearest_state(min(index, run.done)) if run is not None else None
        return known or KnownState(0, State())

    def state_from_start(self, index: int, params: Params) -> State:
        """The state before a frame in the run with these parameters; computes the frames that no run has reached."""
        return self._onwards(self.last_known_state(index, params), index, params)

    def input(self, index: int) -> Frame:
        """A frame as input of ``step``; its image may be without pixels."""
        held = self.inputs.get(index)
        return held if held is not None else self.frame(index)

    def frame(self, index: int) -> Frame:
        """A frame as input of ``step``, read from the source, with its image."""
        return self.look(self.as_read(index), self.setup.detectors, self._ask)

    def look(self, frame: Frame, detectors: Detectors, ask: Look) -> Frame:
        """A frame as read from the source as input of ``step``. detectors: the recording's, wherever they run. ask: see
        ``detections``."""
        seen = sensed(frame, detectors, self.setup.sensors, ask)
        self.inputs.offer(seen)
        return seen

    def detections(self) -> Look:
        """How another thread calls detectors: through the same cache."""
        return self._ask.clone()

    def with_boxes(self, index: int) -> Frame:
        """A frame read from its source, only with the detector's boxes: no lanes, no far view."""
        return sensed(self.as_read(index), Detectors(self.setup.detectors.boxes), ask=self._ask)

    def has_been_looked_at(self, index: int) -> bool:
        """Whether the outputs of all networks for a frame are available."""
        is_without = self.setup.sensors == "lidar" or self.setup.detectors == Detectors()
        return is_without or self.inputs.get(index) is not None

    def as_read(self, index: int) -> Frame:
        """A frame as read from its source, without detections."""
        with at_work("reading a frame"):
            return self.setup.source.frame(index)

    def names(self) -> tuple[str, ...]:
        """The names of all frames; frames that have not been read yet are read."""
        return tuple(self.inputs.name(index) or self.as_read(index).name for index in range(self.setup.total))

    @cached_property
    def marks(self) -> tuple[Mark, ...]:
        """Marks made during the recording."""
        return self.setup.source.marks() if isinstance(self.setup.source, Marked) else ()

    @cached_property
    def stamps_ns(self) -> I64:
        """(total,) timestamps of the frames."""
        return np.array([self.setup.source.t_ns(index) for index in range(self.setup.total)], np.int64)

    def at_hand(self, index: int) -> Frame:
        """A frame as input of ``step``, without pixels, if it is cached; otherwise as read from its source."""
        return self.inputs.get(index) or self.as_read(index)

    def save(self, path: Path, first: int, last: int, progress: Progress) -> None:
        """Write frames to a session file, with all data of the source."""
        from pipeline.recording.save import save  # MCAP takes 0.2 s to import, so it is imported only when saving

        save(self.setup.source, path, first, last, progress)

    def truth(self, index: int) -> Truth:
        """The labelled objects of a frame; None if it is not labelled."""
        if index not in self._truths:
            self._truths[index] = self.setup.source.truth(index)
        return self._truths[index]

    def digest(self, params: Params) -> str:
        """Digest of a run's inputs, twelve characters."""
        return digest(self.setup.uri, self.setup.detectors.names, self.setup.sensors, params)

    def calibration_digest(self, params: Params) -> str:
        """Digest of the calibration that aligns images and points, twelve characters."""
        return calibration_digest(self.at_hand(0).camera, params)

    def _onwards(self, known: KnownState, index: int, params: Params) -> State:
        state = known.state
        for between in range(known.at, index):
            state, _ = step(state, self.input(between), params)
        return state
