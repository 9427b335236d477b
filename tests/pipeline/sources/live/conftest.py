"""Closes live sources at the end of a test."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from pipeline.sources.live.source import LiveSensors


@pytest.fixture
def sensors() -> Iterator[list[LiveSensors]]:
    """A list of live sources, which are closed at the end of the test."""
    opened: list[LiveSensors] = []
    yield opened
    for each in opened:
        each.close()
