"""A car with sessions, and a store in memory."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import fsspec
import pytest

from tests.pipeline.recording.frames import full, write


@pytest.fixture
def car(tmp_path: Path) -> Path:
    """Two sessions without events, the younger one first by name, and one that is still being recorded."""
    folder = tmp_path / "car"
    (folder / "may").mkdir(parents=True)
    write(folder / "may" / "b.mcap", [full(index) for index in range(6)])
    write(folder / "a.mcap", [full(index) for index in range(600, 604)])
    whole = (folder / "a.mcap").read_bytes()
    (folder / "now.mcap").write_bytes(whole[: len(whole) // 2])
    return folder


@pytest.fixture
def in_memory() -> Iterator[str]:
    yield "memory://car-7"
    fsspec.filesystem("memory").rm("/car-7", recursive=True)
