"""Live sources that are closed in the end."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from pipeline.sources.live.source import LiveSensors


@pytest.fixture
def sensors() -> Iterator[list[LiveSensors]]:
    """What is put in here is closed."""
    opened: list[LiveSensors] = []
    yield opened
    for each in opened:
        each.close()
