"""What tests of a fleet share: sessions, and batches of them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.app.fleet.fleets import COPIES, make_fleet


@pytest.fixture(scope="session")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """See ``make_fleet``."""
    return make_fleet(tmp_path_factory.mktemp("fleet"), COPIES)


@pytest.fixture(scope="module", autouse=True)
def _memory_is_kept(request: pytest.FixtureRequest) -> Iterator[None]:
    """Only ``test_unused_memory`` gives memory back after each recording: this process holds a gigabyte in which to
    look for what is unused, a worker a quarter of that."""
    with pytest.MonkeyPatch.context() as patch:
        if request.path.stem != "test_unused_memory":
            patch.setattr("app.fleet.batch.work.return_unused", lambda: None)
        yield
