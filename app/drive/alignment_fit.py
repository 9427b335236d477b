"""Fits the alignment to the open recording in the background, one fit at a time."""

from __future__ import annotations

import threading

from app.core.jobs import BackgroundJob
from app.drive.background_runs import BackgroundRuns
from app.drive.open_recording import OpenRecording
from pipeline.calibration.alignment.drive import fit_drive
from pipeline.calibration.alignment.fit import AlignmentFit
from pipeline.calibration.alignment.models import ModelName
from pipeline.common.errors import BadInput
from pipeline.common.progress import Progress
from pipeline.params import Params

FitJob = BackgroundJob[AlignmentFit]


class FitRefused(BadInput):
    """A fit that cannot start; the text gives the reason."""


class AlignmentFitting:
    """``begin`` a fit, read ``job``, ``cancel`` it. Any thread. Does not change parameters."""

    def __init__(self, drives: BackgroundRuns) -> None:
        self._drives = drives
        self._lock = threading.Lock()
        self._job: tuple[OpenRecording, FitJob] | None = None

    @property
    def job(self) -> FitJob | None:
        """The fit for the open recording; None if none was started for it."""
        with self._lock:
            return self._job[1] if self._job is not None and self._job[0] is self._drives.recording else None

    def begin(self, recording: OpenRecording, model: ModelName, params: Params, offset: bool) -> FitJob:
        """FitRefused if another fit is running, or if there is no detector."""
        if recording.setup.detectors.boxes is None and not recording.as_read(0).detections_given:
            raise FitRefused("a fit needs boxes of vehicles, but no detector is running")
        with self._lock:
            if self._job is not None and not self._job[1].status.has_ended and self._job[0] is self._drives.recording:
                raise FitRefused("a fit is under way")

            def work(progress: Progress) -> AlignmentFit:
                # not scheduled with the background runs, because the user waits for it
                return fit_drive(recording.with_boxes, recording.setup.total, model, params, offset, progress)

            job: FitJob = BackgroundJob(
                work, is_superseded=lambda: self._drives.recording is not recording, name="alignment fit"
            )
            self._job = recording, job
        threading.Thread(target=job.run, name="cipv-alignment-fit", daemon=True).start()
        return job

    def cancel(self) -> bool:
        """Stop the fit, or discard its result. False if there is none."""
        with self._lock:
            if self._job is None:
                return False
            self._job[1].cancel()
            self._job = None
            return True
