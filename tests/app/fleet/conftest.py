"""What tests of a fleet share: sessions, and batches of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.app.fleet.fleets import make_fleet


@pytest.fixture(scope="session")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Nine sessions of eight frames, and one that is none."""
    return make_fleet(tmp_path_factory.mktemp("fleet"), copies=3)
