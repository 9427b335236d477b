"""What tests of a fleet share: sessions, and batches of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.app.fleet.fleets import COPIES, make_fleet


@pytest.fixture(scope="session")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """See ``make_fleet``."""
    return make_fleet(tmp_path_factory.mktemp("fleet"), COPIES)
