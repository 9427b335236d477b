"""A third sensor, declared for a while."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from pipeline.types import sensors
from tests.pipeline.ranging.radar import RADAR


@contextmanager
def radar_declared() -> Iterator[None]:
    """Within it, ``RADAR`` is appended to ``SENSOR_KINDS``."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sensors, "SENSOR_KINDS", (*sensors.SENSOR_KINDS, RADAR))
        _forget()
        try:
            yield
        finally:
            patch.undo()
            _forget()


def _forget() -> None:
    sensors.is_ranging_in.cache_clear()
    sensors.further_sensors.cache_clear()
