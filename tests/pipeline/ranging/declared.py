"""A third sensor, declared for a while."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from pipeline.types import sensors
from tests.pipeline.ranging.radar import RADAR


@contextmanager
def radar_declared() -> Iterator[None]:
    """Within it, ``RADAR`` is the only kind besides camera and LiDAR."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sensors, "SENSOR_KINDS", (sensors.CAMERA, sensors.LIDAR, RADAR))
        _forget()
        try:
            yield
        finally:
            patch.undo()
            _forget()


def _forget() -> None:
    sensors.is_ranging_in.cache_clear()
    sensors.further_sensors.cache_clear()
