"""The look-ahead process of these tests runs at the usual priority, because at idle priority a busy machine starves it,
and for short recordings, too."""

from __future__ import annotations

import pytest

from app.drive.look_ahead import client, worker
from tests.app.drive.look_ahead.networks import COMMAND


@pytest.fixture(autouse=True)
def _at_usual_priority(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client, "_COMMAND", COMMAND)


@pytest.fixture(autouse=True)
def _for_short_recordings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker, "_WORTH_FRAMES", 20)
