"""A clip of a drive: its frames, with the results of the run over the whole drive.

All clips are run here. The dashboard's exports and ``cipv export`` both use this module, so object numbers,
confirmations and histories are those of ``cipv run``, wherever the clip begins.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from app.core.detection_cache import DetectionCache
from app.core.playback_clock import timeline_s
from app.drive.compute_scheduler import ComputeScheduler
from app.drive.open_recording import OpenRecording, RunSetup
from app.views.rerun.start_options import RerunStartOptions
from pipeline.common.progress import Progress
from pipeline.detection import Detectors
from pipeline.params import Params
from pipeline.step import step
from pipeline.types import Frame, Result
from pipeline.types.source import Source


@dataclass(frozen=True, eq=False)
class Clip:
    """Frames ``first`` to ``last`` of a recording, both included, run with one set of parameters."""

    recording: OpenRecording
    """The recording with its whole-drive runs, whose states the clip starts from."""
    params: Params
    """Parameters of the run whose results it shows."""
    first: int
    """First frame."""
    last: int
    """Last frame, included."""
    scheduler: ComputeScheduler
    """Asked before each frame is computed, so that interactive requests take priority."""
    title: str
    """Title shown in the exported file."""
    rate_hz: float
    """Nominal frame rate of the recording."""
    start: RerunStartOptions = RerunStartOptions()
    """How the rerun viewer starts with the clip."""

    @classmethod
    def of_source(cls, source: Source, params: Params, first: int, last: int, detectors: Detectors) -> Clip:
        """A clip of a recording that is not open in a dashboard."""
        times_s = timeline_s([source.t_ns(index) for index in range(len(source))], source.rate_hz)
        recording = OpenRecording(RunSetup(source, times_s, detectors, "both"), DetectionCache(), 1)
        return cls(recording, params, first, last, ComputeScheduler(), source.title, source.rate_hz)


def clip_frames(clip: Clip, progress: Progress, *, images: bool = True) -> Iterator[tuple[Frame, Result]]:
    """The clip's frames with their results, in order; without ``images``, pixels may be missing.

    The pipeline starts from the last known state of the whole-drive run at or before the clip; without such a run, from
    the beginning of the drive. ``progress`` counts these frames too.
    """
    recording, params = clip.recording, clip.params
    known = recording.last_known_state(clip.first, params)
    state, total = known.state, clip.last + 1 - known.at
    progress(0, total)
    for index in range(known.at, clip.last + 1):
        is_in_clip = index >= clip.first
        with clip.scheduler.background(to_the_end=True):
            frame = recording.frame(index) if images and is_in_clip else recording.input(index)
            state, result = step(state, frame, params)
        if is_in_clip:
            yield frame, result
        progress(index + 1 - known.at, total)


def one_frame(recording: OpenRecording, params: Params, index: int) -> tuple[Frame, Result]:
    """A frame with its image, and its result in the whole-drive run."""
    frame = recording.frame(index)
    return frame, step(recording.state_from_start(index, params), frame, params)[1]
