"""Estimates both time offsets that a drive can determine: the camera's, and that of ego speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.calibration.speed_delay import NoDelay, SpeedDelay, SpeedPair, speed_delay
from pipeline.calibration.time_offset import MovingScene, NoOffset, TimeOffset, time_offset, watch
from pipeline.common.progress import Progress, silent
from pipeline.params import Params
from pipeline.types.source import Parametrised, Source


class NoTimes(NoOffset):
    """The drive determines neither offset; the text says why."""


@dataclass(frozen=True)
class TimeOffsets:
    """The time offsets of a drive."""

    camera: TimeOffset | None
    """Of the camera; None if the drive does not determine it."""
    ego: SpeedDelay | None
    """Of ego speed; None if the drive does not determine it."""
    untold: tuple[str, ...]
    """Why the drive does not determine one of them, as sentences."""
    images: int
    """Number of images looked at."""
    speeds: int
    """Number of speeds compared."""
    recorded_ms: float = 0.0
    """Camera offset that the timestamps of the recording's images already include. Those of ego speed are as
    measured."""

    @property
    def changes(self) -> dict[str, float]:
        """By dotted name, as a change of parameters."""
        found = {}
        if self.camera is not None:
            offset_ms = self.recorded_ms + self.camera.camera_offset_ms
            found["sync.camera_offset_ms"] = round(offset_ms, 1)
        if self.ego is not None:
            found["sync.ego_offset_ms"] = self.ego.ego_offset_ms
        return found

    @property
    def sigmas(self) -> dict[str, float]:
        """Standard deviation of each of ``changes``."""
        found = {}
        if self.camera is not None:
            found["sync.camera_offset_ms"] = self.camera.sigma_ms
        if self.ego is not None:
            found["sync.ego_offset_ms"] = self.ego.sigma_ms
        return found

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the drive does not determine, as sentences."""
        return (*(self.camera.warnings if self.camera is not None else ()), *self.untold)


def fit_times(source: Source, params: Params, progress: Progress = silent) -> TimeOffsets:
    """The time offsets of a recording. Raises NoTimes if it determines neither. An exception of ``progress`` ends
    it."""
    scenes, speeds = watch(source.frame, len(source), params, progress)
    recorded = source.params(len(source) // 2) if isinstance(source, Parametrised) else None
    return times_of(scenes, speeds, recorded.sync.camera_offset_ms if recorded is not None else 0.0)


def times_of(scenes: Sequence[MovingScene], speeds: Sequence[SpeedPair], recorded_ms: float = 0.0) -> TimeOffsets:
    """The offsets of the camera and of ego speed. recorded_ms: see ``TimeOffsets``. Raises NoTimes if neither is
    determined."""
    camera: TimeOffset | None = None
    ego: SpeedDelay | None = None
    untold: list[str] = []
    try:
        camera = time_offset(scenes)
    except NoOffset as error:
        untold.append(str(error))
    try:
        ego = speed_delay(speeds)
    except NoDelay as error:
        untold.append(str(error))
    if camera is None and ego is None:
        raise NoTimes("; ".join(untold))
    return TimeOffsets(camera, ego, tuple(untold), len(scenes), len(speeds), recorded_ms)
