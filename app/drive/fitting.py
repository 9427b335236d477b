"""Fits to the open recording in the background, one of each kind at a time: the alignment, and the time offsets."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from app.core.jobs import BackgroundJob
from app.drive.background_runs import BackgroundRuns
from app.drive.open_recording import OpenRecording
from pipeline.calibration.alignment.drive import fit_drive
from pipeline.calibration.alignment.fit import AlignmentFit
from pipeline.calibration.alignment.models import ModelName
from pipeline.calibration.times import TimeOffsets, fit_times
from pipeline.common.errors import BadInput
from pipeline.common.progress import Progress
from pipeline.params import Params

ResultT = TypeVar("ResultT")


class FitRefused(BadInput):
    """A fit that cannot start; the text gives the reason."""


class _Fitting(Generic[ResultT]):
    """Read ``job``, ``cancel`` it. Any thread. Does not change parameters."""

    def __init__(self, drives: BackgroundRuns) -> None:
        self._drives = drives
        self._lock = threading.Lock()
        self._job: tuple[OpenRecording, BackgroundJob[ResultT]] | None = None

    @property
    def job(self) -> BackgroundJob[ResultT] | None:
        """The fit for the open recording; None if none was started for it."""
        with self._lock:
            return self._job[1] if self._job is not None and self._job[0] is self._drives.recording else None

    def cancel(self) -> bool:
        """Stop the fit, or discard its result. False if there is none."""
        with self._lock:
            if self._job is None:
                return False
            self._job[1].cancel()
            self._job = None
            return True

    def _start(
        self, recording: OpenRecording, name: str, work: Callable[[Progress], ResultT]
    ) -> BackgroundJob[ResultT]:
        """FitRefused if another fit is running. Not scheduled with the background runs, because the user waits for
        it."""
        with self._lock:
            if self._job is not None and not self._job[1].status.has_ended and self._job[0] is self._drives.recording:
                raise FitRefused("a fit is under way")
            job = BackgroundJob(work, is_superseded=lambda: self._drives.recording is not recording, name=name)
            self._job = recording, job
        threading.Thread(target=job.run, name=f"cipv-{name.replace(' ', '-')}", daemon=True).start()
        return job


class AlignmentFitting(_Fitting[AlignmentFit]):
    """The alignment of LiDAR and camera."""

    def begin(
        self, recording: OpenRecording, model: ModelName, params: Params, offset: bool
    ) -> BackgroundJob[AlignmentFit]:
        """FitRefused if another fit is running, or if there is no detector."""
        if recording.setup.detectors.boxes is None and not recording.as_read(0).detections_given:
            raise FitRefused("a fit needs boxes of vehicles, but no detector is running")
        return self._start(
            recording,
            "alignment fit",
            lambda told: fit_drive(recording.with_boxes, recording.setup.total, model, params, offset, told),
        )


class TimeFitting(_Fitting[TimeOffsets]):
    """The time offsets of the camera and of ego speed."""

    def begin(self, recording: OpenRecording, params: Params) -> BackgroundJob[TimeOffsets]:
        """FitRefused if another fit is running."""
        source = recording.setup.source
        return self._start(recording, "time fit", lambda told: fit_times(source, params, told))
