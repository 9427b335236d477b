"""Estimates both time offsets that a drive can determine: the camera's, and that of ego speed."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.calibration.speed_delay import NoDelay, SpeedDelay, SpeedPair, speed_delay
from pipeline.calibration.time_offset import MovingScene, NoOffset, TimeOffset, time_offset


class NoTimes(NoOffset):
    """The drive determines neither offset; the text says why."""


def times_of(
    scenes: Sequence[MovingScene], speeds: Sequence[SpeedPair]
) -> tuple[TimeOffset | None, SpeedDelay | None, tuple[str, ...]]:
    """The offsets of the camera and of ego speed, None where the drive does not determine one, and the reasons as
    sentences. Raises NoTimes if it determines neither."""
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
    return camera, ego, tuple(untold)
