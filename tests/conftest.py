"""Shared fixtures: where the real recordings are, and skipping with a reason when they are not."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.data import data_dir as recordings

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of real recordings and models (``CIPV_DATA``); the test is skipped when it is not there."""
    folder = recordings()
    if not folder.is_dir():
        pytest.skip(f"real recordings not found at {folder} (set CIPV_DATA)")
    return folder
